//! What `sample` keeps of files: by number, by chance, and so far apart.

use crate::support::random::Random;
use crate::support::runs::{Settings, run};
use crate::support::scan::Scan;
use pointmill::point::distance2;
use pointmill::synth::Scene;

fn stage(keys: &str) -> String {
    format!("[[stage]]\nkind = 'sample'\n{keys}\n")
}

#[test]
fn every_nth_record_of_the_input_stays_whoever_reads_it_and_whatever_stands_above() {
    // More than a part of a plain file, and chunks enough for threads.
    let scan = Scan::synthetic(Scene::Als, 300_000, 5);
    let class = |i: usize| scan.record(i)[CLASS];
    let low = scan.record(0)[CLASS];
    let some = format!("[[stage]]\nkind = 'drop'\nclasses = [{low}]\n");
    for (above, keeps) in [("", false), (some.as_str(), true)] {
        for threads in [1, 3] {
            let folder = tempfile::tempdir().unwrap();
            let files = scan.write_split(folder.path(), 3, &mut Random(threads as u64));
            let settings = Settings { threads, ..Settings::PLAIN };
            let stages = format!("{above}{}", stage("every = 7"));
            let ran = run(folder.path(), &files, &stages, "las", settings).unwrap();
            let stays = |i: &usize| i.is_multiple_of(7) && (!keeps || class(*i) != low);
            let expected = scan.pick(&(0..scan.points()).filter(stays).collect::<Vec<_>>());
            assert!(expected.points() > 1000 && expected.points() < 43_000);
            assert!(Scan::read(&ran.output, usize::MAX).records == expected.records);
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let limited = stage(&format!("every = 1000\nclasses = [{low}]"));
    let files = scan.write_split(folder.path(), 1, &mut Random(0));
    let ran = run(folder.path(), &files, &limited, "las", Settings::PLAIN).unwrap();
    let stays = |i: &usize| i.is_multiple_of(1000) || class(*i) != low;
    let expected = scan.pick(&(0..scan.points()).filter(stays).collect::<Vec<_>>());
    assert!(Scan::read(&ran.output, usize::MAX).records == expected.records);
}

/// Byte of a record that has its class, in point formats 6 to 10.
const CLASS: usize = 16;

#[test]
fn texts_and_binary_files_of_ply_are_numbered_alike() {
    let scan = Scan::synthetic(Scene::Plane, 5_000, 1);
    let folder = tempfile::tempdir().unwrap();
    let files = scan.write_split(folder.path(), 1, &mut Random(0));
    let mut kept = Vec::new();
    for encoding in ["ascii", "binary"] {
        let folder = tempfile::tempdir().unwrap();
        let write = format!("ply\nencoding = {encoding:?}");
        let text = run(folder.path(), &files, "", &write, Settings::PLAIN).unwrap();
        let input = folder.path().join("in.ply");
        std::fs::rename(&text.output, &input).unwrap();
        let again = folder.path().join("again.ply");
        std::fs::copy(&input, &again).unwrap();
        let write = "ply\nencoding = 'binary'";
        let ran = run(folder.path(), &[input, again], &stage("every = 3"), write, Settings::PLAIN);
        let written = Scan::read(&ran.unwrap().output, usize::MAX);
        assert_eq!(written.points(), 10_000usize.div_ceil(3));
        kept.push(written.positions());
    }
    assert_eq!(kept[0], kept[1]);
}

#[test]
fn numbers_are_refused_where_records_do_not_come_in_the_order_of_the_input() {
    let scan = Scan::synthetic(Scene::Plane, 500, 1);
    let folder = tempfile::tempdir().unwrap();
    let files = scan.write_split(folder.path(), 1, &mut Random(0));
    let stages = format!("[[stage]]\nkind = 'grid'\nside = 0.1\n{}", stage("every = 3"));
    let Err(error) = run(folder.path(), &files, &stages, "las", Settings::PLAIN) else {
        panic!("not refused")
    };
    assert!(error.to_string().contains("goes by the numbers that records have in the input"));
    assert!(error.remedy().unwrap().contains("above stages that work on tiles"), "{error:?}");
}

#[test]
fn chance_decides_alike_in_any_order_and_behind_tiles() {
    let scan = Scan::synthetic(Scene::Als, 30_000, 8).snapped(50).with_copies(2);
    let canonical = "las\norder = 'canonical'";
    let mut kept: Vec<Vec<u8>> = Vec::new();
    for seed in 0..3 {
        let mut order: Vec<usize> = (0..scan.points()).collect();
        Random(seed).shuffle(&mut order);
        let folder = tempfile::tempdir().unwrap();
        let files =
            scan.pick(&order).write_split(folder.path(), 1 + seed as usize, &mut Random(seed));
        let stages = stage("fraction = '30%'\nseed = 4");
        let ran = run(folder.path(), &files, &stages, canonical, Settings::PLAIN).unwrap();
        kept.push(ran.bytes());
    }
    assert!(kept.iter().all(|bytes| *bytes == kept[0]));
    // Behind tiles: of what they leave those stay that would stay of a file of it.
    let folder = tempfile::tempdir().unwrap();
    let files = scan.write_split(folder.path(), 1, &mut Random(0));
    let grid = "[[stage]]\nkind = 'grid'\nside = 0.6\n";
    let chance = stage("fraction = 0.5");
    let settings = Settings { tile_points: Some(500), threads: 2, ..Settings::PLAIN };
    let at_once =
        run(folder.path(), &files, &format!("{grid}{chance}"), canonical, settings).unwrap();
    let at_once = Scan::read(&at_once.output, usize::MAX);
    let left = run(folder.path(), &files, grid, canonical, settings).unwrap();
    let left_points = Scan::read(&left.output, usize::MAX).points();
    let between = folder.path().join("between.las");
    std::fs::rename(&left.output, &between).unwrap();
    let then = run(folder.path(), &[between], &chance, canonical, settings).unwrap();
    let then = Scan::read(&then.output, usize::MAX);
    assert!(at_once.records == then.records);
    assert!(at_once.points() > left_points / 3 && at_once.points() < left_points * 2 / 3);
}

#[test]
fn no_two_that_stay_are_nearer_than_the_distance_and_the_ledger_balances() {
    let scan = Scan::synthetic(Scene::Als, 20_000, 3).snapped(50).with_copies_and_an_outlier(2);
    let folder = tempfile::tempdir().unwrap();
    let files = scan.write_split(folder.path(), 2, &mut Random(1));
    let settings = Settings { tile_points: Some(600), threads: 2, ..Settings::PLAIN };
    let ran = run(folder.path(), &files, &stage("distance = 1.5"), "las", settings).unwrap();
    assert!(ran.count("tiles") >= 8, "{} tiles", ran.count("tiles"));
    let written = Scan::read(&ran.output, usize::MAX);
    let (positions, step) = (written.positions(), written.lattice().step);
    let apart = (1.5 / step).round() as u128;
    let near = positions
        .iter()
        .enumerate()
        .filter(|(i, p)| positions[..*i].iter().any(|q| distance2(**p, *q) < apart * apart));
    assert_eq!(near.count(), 0);
    assert!(written.points() > 100 && written.points() < scan.points() / 2);
    let reasons: Vec<&str> =
        ran.report.result.ledger.removed.iter().map(|r| r.reason.as_str()).collect();
    assert_eq!(reasons, ["coincident", "too near"]);
}
