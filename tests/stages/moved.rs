//! Stages that move points, beside brute force: where records go, what else of them changes, and
//! what the report measures.

use crate::support::case::Case;
use crate::support::runs::{Memory, Ran, Settings, run};
use crate::support::scan::Scan;
use pointmill::internals::morton_cmp;
use pointmill::point::{Position, distance2, names};
use pointmill::synth::Scene;

/// The offsets of the `k` nearest others and of the position itself.
fn neighborhood(all: &[Position], p: Position, k: usize) -> Vec<Position> {
    let mut others: Vec<Position> = all.iter().copied().filter(|q| *q != p).collect();
    others.sort_by(|a, b| distance2(*a, p).cmp(&distance2(*b, p)).then(morton_cmp(a, b)));
    others.truncate(k);
    others.push(p);
    others.iter().map(|q| [0, 1, 2].map(|axis| q[axis] - p[axis])).collect()
}

fn mean(hood: &[Position]) -> Position {
    // Sums of a few offsets: their mean is exact but for what is rounded.
    let of = |axis: usize| hood.iter().map(|o| o[axis]).sum::<i64>() as f64 / hood.len() as f64;
    [0, 1, 2].map(|axis| of(axis).round_ties_even() as i64)
}

fn median(hood: &[Position]) -> Position {
    [0, 1, 2].map(|axis| {
        let mut values: Vec<i64> = hood.iter().map(|o| o[axis]).collect();
        values.sort_unstable();
        values[(values.len() - 1) / 2]
    })
}

fn plus(p: Position, shift: Position) -> Position {
    [0, 1, 2].map(|axis| p[axis] + shift[axis])
}

const CUT: Settings = Settings {
    tile_points: Some(120),
    memory: Memory::Least(0),
    threads: 2,
    spill: "always",
    ..Settings::PLAIN
};

fn result(ran: &Ran) -> serde_json::Value {
    serde_json::from_slice(&ran.result).unwrap()
}

/// What the stages leave of a scan of 1,500 points, in tiles and whole, which are the same.
fn moved(scan: &Scan, stages: &str) -> (Ran, Scan) {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("scan.las");
    scan.write(&input);
    let whole =
        run(folder.path(), std::slice::from_ref(&input), stages, "las", Settings::PLAIN).unwrap();
    let bytes = whole.bytes();
    let ran = run(folder.path(), std::slice::from_ref(&input), stages, "las", CUT).unwrap();
    assert!(ran.count("tiles") > 5 && ran.bytes() == bytes, "tiles change nothing");
    assert_eq!(ran.result, whole.result);
    let written = Scan::read(&ran.output, usize::MAX);
    let again = folder.path().join("again.las");
    std::fs::copy(&ran.output, &again).unwrap();
    let sees = "[[stage]]\nkind = \"normals\"\n";
    let again =
        run(folder.path(), std::slice::from_ref(&again), sees, "las", Settings::PLAIN).unwrap();
    let plane = |of: &Ran, when: &str| result(of)["totals"]["scan_plane"][when].clone();
    let (told, measured) = (plane(&ran, "after"), plane(&again, "before"));
    for figure in ["rms", "mean"] {
        let [told, measured] = [&told, &measured].map(|plane| plane[figure].as_f64().unwrap());
        assert!((told - measured).abs() <= 1e-9 * measured, "{figure}: {told}, {measured}");
    }
    (ran, written)
}

fn scan() -> (Scan, Vec<Position>) {
    let scan = Scan::synthetic(Scene::Part, 1500, 3);
    let mut positions = scan.positions();
    positions.sort_by(morton_cmp);
    (scan, positions)
}

#[test]
fn every_point_goes_to_the_mean_or_the_median_of_its_neighbourhood_and_is_measured_there() {
    let (scan, positions) = scan();
    for (pick, center) in [("mean", mean as fn(&[Position]) -> Position), ("median", median)] {
        let stage = format!("[[stage]]\nkind = \"smooth\"\nneighbors = 9\npick = \"{pick}\"\n");
        let (ran, written) = moved(&scan, &stage);
        let there = written.positions();
        assert_eq!(there.len(), positions.len());
        let mut still = 0;
        for (i, (p, there)) in positions.iter().zip(&there).enumerate() {
            let shift = center(&neighborhood(&positions, *p, 9));
            assert_eq!(*there, plus(*p, shift), "{pick} of {p:?}");
            still += usize::from(shift == [0; 3]);
            let flag = written.schema.find(names::SYNTHETIC).unwrap();
            let is_set = flag.get(written.record(i), written.schema.endian).as_f64() == 1.0;
            assert_eq!(is_set, shift != [0; 3]);
        }
        let counted = result(&ran)["counts"]["smooth_moved"].as_u64();
        assert_eq!(counted, Some((positions.len() - still) as u64));
    }
}

#[test]
fn what_would_go_too_far_keeps_all_bytes_of_its_record() {
    let (scan, positions) = scan();
    let step = scan.lattice().step;
    let stage = "[[stage]]\nkind = \"smooth\"\nneighbors = 9\nmax_distance = 0.8\n";
    let (ran, written) = moved(&scan, stage);
    let most = (0.8 / step).round() as u128;
    let mut far = 0;
    for (p, there) in positions.iter().zip(written.positions()) {
        let shift = mean(&neighborhood(&positions, *p, 9));
        let is_far = distance2([0; 3], shift) > most * most;
        assert_eq!(there, if is_far { *p } else { plus(*p, shift) });
        far += u64::from(is_far);
    }
    assert!(far > 20 && far < 1400, "{far} are too far");
    assert_eq!(result(&ran)["counts"]["smooth_too_far"], far);
    let before: std::collections::BTreeSet<&[u8]> =
        (0..scan.points()).map(|i| scan.record(i)).collect();
    let same = (0..written.points()).filter(|&i| before.contains(written.record(i))).count();
    assert!(same as u64 >= far, "{same} records are as they were, of {far}");
}

#[test]
fn a_smoothing_of_some_classes_moves_none_of_the_others() {
    let scan = scan().0.with_classes_and_flags(5);
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("scan.las");
    scan.write(&input);
    let stage = "[[stage]]\nkind = \"smooth\"\nclasses = [2]\n";
    let run = "withheld = \"keep\"";
    let text = format!(
        "[run]\n{run}\n[[stage]]\nkind = \"read\"\npath = {input:?}\n{stage}[[stage]]\nkind = \
         \"write\"\npath = {:?}\n",
        folder.path().join("out.las")
    );
    crate::support::case::execute(&text, &Default::default(), &pointmill::Quiet).unwrap();
    let written = Scan::read(&folder.path().join("out.las"), usize::MAX);
    let class = written.schema.find(names::CLASSIFICATION).unwrap();
    let before: std::collections::BTreeSet<&[u8]> =
        (0..scan.points()).map(|i| scan.record(i)).collect();
    let (mut moved, mut same) = (0, 0);
    for i in 0..written.points() {
        let record = written.record(i);
        match class.get(record, written.schema.endian).as_f64() == 2.0 {
            true => moved += usize::from(!before.contains(record)),
            false => {
                assert!(before.contains(record), "record {i}");
                same += 1;
            }
        }
    }
    assert!(moved > 20 && same > 1000, "{moved} moved, {same} stayed");
}

#[test]
fn cells_are_represented_by_their_centres_of_mass() {
    let (scan, positions) = scan();
    let stages = "[[stage]]\nkind = \"normals\"\n[[stage]]\nkind = \"cells\"\nside = 8\n\
                  max_angle = 3.1\nmin_points = 100000\n[[stage]]\nkind = \"median\"\n\
                  pick = \"centroid\"\n";
    let (ran, written) = moved(&scan, stages);
    let side = (8.0 / scan.lattice().step).round() as i64;
    let mut cells = std::collections::BTreeMap::<Position, Vec<Position>>::new();
    for p in &positions {
        cells.entry(p.map(|v| v.div_euclid(side))).or_default().push(*p);
    }
    let mut expected: Vec<Position> = cells.values().map(|of| mean(of)).collect();
    let mut there = written.positions();
    expected.sort_unstable();
    there.sort_unstable();
    assert!(there.len() > 50);
    assert!(there == expected, "the centres of mass of {} cells", there.len());
    let result = result(&ran);
    let moved = result["counts"]["median_moved"].as_u64().unwrap();
    assert!(moved > 40 && moved <= there.len() as u64, "{moved} moved");
    let rms = result["totals"]["deviation"]["rms"].as_f64().unwrap();
    assert!(rms > 0.0, "deviations are measured from there");
}

#[test]
fn coordinates_of_floating_point_numbers_move_and_unmoved_ones_keep_their_bits() {
    let case = Case::new();
    let row = |i: u32| ([f64::from(i) * 0.3 + 1e-9, 0.1, if i == 5 { 9.0 } else { 0.2 }], i);
    case.ply(&(0..20).map(row).collect::<Vec<_>>());
    let stage = "[[stage]]\nkind = \"smooth\"\nneighbors = 2\npick = \"median\"\n";
    case.run("", stage, "").unwrap();
    let written = case.written();
    for ([x, y, z], i) in written {
        assert!(y == 0.1 && (z - 0.2).abs() < if i == 5 { 1e-9 } else { 1e-20 }, "point {i}");
        let own = row(i).0[0];
        match i {
            0 => assert!((x - own - 0.3).abs() < 1e-8, "the median of three at the end"),
            19 => assert!((x - own + 0.3).abs() < 1e-8),
            5 => assert!((x - own).abs() < 1e-8),
            _ => assert_eq!(x.to_bits(), own.to_bits(), "point {i}"),
        }
    }
}

#[test]
fn what_works_on_tiles_cannot_stand_behind_what_moves_points() {
    let case = Case::new();
    case.ply(&[([0.0; 3], 0), ([1.0; 3], 1)]);
    for below in ["grid\"\nside = 1", "smooth\"", "outliers\""] {
        let stages = format!("[[stage]]\nkind = \"smooth\"\n[[stage]]\nkind = \"{below}\n");
        let told = case.run("", &stages, "").unwrap_err();
        assert!(told.to_string().contains("and `smooth` moves points"), "{told}");
        assert_eq!(told.remedy(), Some("let a second run read what `smooth` leaves"));
    }
}
