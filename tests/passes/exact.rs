//! Stages of two phases, selections and repeated passes against brute force over all of a small
//! scan, in runs of many tiles.

use std::collections::{BTreeMap, BTreeSet};

use crate::support::random::Random;
use crate::support::runs::{Memory, Ran, Settings, run, run_with};
use crate::support::scan::Scan;
use pointmill::internals::{Estimate, Estimator, morton_cmp};
use pointmill::ops::normals::Method;
use pointmill::point::{Position, distance2, names};
use pointmill::synth::Scene;

const TILED: Settings = Settings {
    tile_points: Some(100),
    memory: Memory::Least(0),
    threads: 2,
    spill: "always",
    simd: "auto",
};
const NORMALS: &str = "dimensions = [\"NormalX\", \"NormalY\", \"NormalZ\"]";

/// Stages, each a kind and its keys.
fn stages(each: &[(&str, &str)]) -> String {
    each.iter().map(|(kind, keys)| format!("[[stage]]\nkind = \"{kind}\"\n{keys}\n")).collect()
}

/// A landscape with copies, of different class and flags some of them.
fn landscape(points: u64) -> Scan {
    let scan = Scan::synthetic(Scene::Als, points, 21).snapped(60);
    scan.with_copies(5).with_classes_and_flags(6)
}

/// What a tiled run left, and its records.
fn reduced(scan: &Scan, stages: &str, write: &str, keys_of_run: &str) -> (Ran, Scan) {
    let folder = tempfile::tempdir().unwrap();
    let files = scan.write_split(folder.path(), 2, &mut Random(3));
    let ran = run_with(folder.path(), &files, stages, write, TILED, keys_of_run)
        .unwrap_or_else(|error| panic!("{stages}: {error:?}"));
    assert!(ran.count("tiles") >= 2 && ran.spilled > 0, "{} tiles", ran.count("tiles"));
    let written = Scan::read(&ran.output, usize::MAX);
    (ran, written)
}

/// Records in any order, and how often each is there.
fn counted(scan: &Scan) -> BTreeMap<&[u8], usize> {
    let mut all = BTreeMap::new();
    scan.records.chunks_exact(scan.schema.stride).for_each(|r| *all.entry(r).or_default() += 1);
    all
}

fn class(record: &[u8]) -> u8 {
    record[16]
}

/// The distinct positions of the records that `of` holds, in Morton order.
fn distinct(scan: &Scan, of: impl Fn(&[u8]) -> bool) -> Vec<Position> {
    let positions = scan.positions().into_iter().enumerate();
    let mut all: Vec<Position> =
        positions.filter(|(i, _)| of(scan.record(*i))).map(|(_, p)| p).collect();
    all.sort_unstable_by(morton_cmp);
    all.dedup();
    all
}

/// The `k` nearest of `all` (distinct, in Morton order) to `p` other than itself, ties by Morton
/// order; in Morton order.
fn nearest(all: &[Position], p: Position, k: usize) -> Vec<Position> {
    let others = all.iter().enumerate().filter(|(_, q)| **q != p);
    let mut others: Vec<(u128, usize)> = others.map(|(rank, &q)| (distance2(p, q), rank)).collect();
    others.select_nth_unstable(k - 1);
    let mut ranks: Vec<usize> = others[..k].iter().map(|&(_, rank)| rank).collect();
    ranks.sort_unstable();
    ranks.into_iter().map(|rank| all[rank]).collect()
}

#[test]
fn passes_are_the_pipeline_run_again_on_what_it_wrote() {
    let scan = landscape(5_000);
    for (normals, cells) in [
        ("", "side = 2.2"),
        ("neighbors = 7", "side = 3.1\nsplit = \"octant\"\nmax_angle = 0.3"),
        ("orient = \"up\"", "side = 1.7\nmeasure = \"cone\"\nmax_angle = 0.5"),
    ] {
        let with =
            |passes: &str| stages(&[("normals", normals), ("cells", cells), ("median", passes)]);
        let mut by_file = scan.clone();
        for passes in 1..=3 {
            let before = by_file.points();
            let folder = tempfile::tempdir().unwrap();
            let files = by_file.write_split(folder.path(), 1, &mut Random(0));
            let ran = run(folder.path(), &files, &with(""), "las", TILED).unwrap();
            by_file = Scan::read(&ran.output, usize::MAX);
            assert!(by_file.points() < before && by_file.points() > 200, "{}", by_file.points());
            let text = with(&format!("passes = {passes}"));
            let (ran, at_once) = reduced(&scan, &text, "las", "");
            assert!(at_once.records == by_file.records, "{passes} passes of\n{text}");
            assert_eq!(ran.report.result.passes.len(), passes);
            let last = &ran.report.result.passes[passes - 1];
            assert_eq!(
                (last.before, last.after),
                (
                    if passes == 1 {
                        scan.points() as u64 - withheld(&scan)
                    } else {
                        before as u64
                    },
                    by_file.points() as u64,
                )
            );
        }
    }
}

fn withheld(scan: &Scan) -> u64 {
    let records = scan.records.chunks_exact(scan.schema.stride);
    records.filter(|record| record[15] & 4 != 0).count() as u64
}

/// Whether each of the `chosen` positions is an outlier of mean distance among `seen`; None if that
/// is too near to tell.
fn statistical(
    seen: &[Position],
    chosen: &[Position],
    k: usize,
    multiplier: f64,
) -> BTreeMap<Position, Option<bool>> {
    let figure = |p: &Position| {
        let far = nearest(seen, *p, k).into_iter().map(|q| (distance2(*p, q) as f64).sqrt());
        far.sum::<f64>() / k as f64
    };
    let figures: Vec<f64> = chosen.iter().map(figure).collect();
    let n = figures.len() as f64;
    let mean = figures.iter().sum::<f64>() / n;
    let sigma = (figures.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / n).sqrt();
    let threshold = mean + multiplier * sigma;
    let tell = |f: &f64| ((f - threshold).abs() > 1e-3).then_some(*f > threshold);
    chosen.iter().zip(&figures).map(|(p, f)| (*p, tell(f))).collect()
}

/// Asserts that what is left of `scan` is what is not `removed`, wherever that can be told.
fn assert_left(
    scan: &Scan,
    left: &Scan,
    removed: impl Fn(Position, &[u8]) -> Option<bool>,
    what: &str,
) {
    let written = counted(left);
    let mut expected: BTreeMap<&[u8], (usize, usize)> = BTreeMap::new();
    let (mut gone, mut untold) = (0, 0);
    for (i, p) in scan.positions().into_iter().enumerate() {
        let record = scan.record(i);
        let (least, most) = expected.entry(record).or_default();
        match removed(p, record) {
            Some(true) => gone += 1,
            Some(false) => (*least, *most) = (*least + 1, *most + 1),
            None => (untold, *most) = (untold + 1, *most + 1),
        }
    }
    assert!(gone > 5 && untold < 10, "{what}: {gone} removed, {untold} too near to tell");
    for (record, (least, most)) in &expected {
        let there = written.get(record).copied().unwrap_or(0);
        assert!((*least..=*most).contains(&there), "{what}: {record:?} {there} of {least}");
    }
    assert!(written.keys().all(|record| expected.contains_key(record)), "{what}");
}

#[test]
fn outliers_of_a_tiled_run_are_those_of_brute_force() {
    let scan = landscape(4_000);
    let all = distinct(&scan, |_| true);
    let ground = distinct(&scan, |record| class(record) == 2);
    assert!(ground.len() > 500 && ground.len() + 500 < all.len());
    let keep = "withheld = \"keep\"";
    for (k, multiplier) in [(10, 1.0), (3, 0.5), (25, 0.2)] {
        let keys = format!("neighbors = {k}\nmultiplier = {multiplier}\n");
        let cases = [
            ("", &all, &all),
            ("classes = [2]\nsees = \"selected\"", &ground, &ground),
            ("classes = [2]\nsees = \"all\"", &all, &ground),
        ];
        for (limits, seen, chosen) in cases {
            let expected = statistical(seen, chosen, k, multiplier);
            let stage = stages(&[("outliers", &format!("{keys}{limits}"))]);
            let (ran, left) = reduced(&scan, &stage, "laz", keep);
            let removed = |p, record: &[u8]| match limits.is_empty() || class(record) == 2 {
                true => expected[&p],
                false => Some(false),
            };
            assert_left(&scan, &left, removed, &stage);
            assert_eq!(ran.report.result.ledger.kept, left.points() as u64);
            assert!(ran.count("unproven") > 0, "{stage}");
        }
    }
}

#[test]
fn radius_outliers_of_a_tiled_run_are_those_of_brute_force() {
    let scan = landscape(4_000);
    let all = distinct(&scan, |_| true);
    let ground = distinct(&scan, |record| class(record) == 2);
    // In lattice steps of a millimetre; the scan is on a grid of 6 cm, so that some are just there.
    for (radius, least) in [(1200u64, 6), (900, 4)] {
        let keys = format!(
            "method = \"radius\"\nradius = {}\nmin_neighbors = {least}\n",
            radius as f64 / 1000.0
        );
        let within = u128::from(radius * radius);
        let (mut at_it, cases) = (
            0,
            [
                ("", &all),
                ("classes = [2]\nsees = \"selected\"", &ground),
                ("classes = [2]\nsees = \"all\"", &all),
            ],
        );
        for (limits, seen) in cases {
            let mut few = BTreeSet::new();
            for p in &all {
                let near = seen.iter().filter(|q| *q != p).map(|q| distance2(*p, *q));
                at_it += near.clone().filter(|d2| *d2 == within).count();
                if near.filter(|d2| *d2 <= within).count() < least {
                    few.insert(*p);
                }
            }
            let stage = stages(&[("outliers", &format!("{keys}{limits}"))]);
            let (_, left) = reduced(&scan, &stage, "las", "withheld = \"keep\"");
            let removed = |p, record: &[u8]| {
                Some((limits.is_empty() || class(record) == 2) && few.contains(&p))
            };
            assert_left(&scan, &left, removed, &stage);
        }
        assert!(at_it > 10, "{at_it} pairs at exactly the radius");
    }
}

#[test]
fn normals_are_those_of_the_neighbors_that_a_stage_sees_to_the_bit() {
    let scan = landscape(2_500);
    let is_chosen = |record: &[u8]| matches!(class(record), 2 | 6) && record[15] & 8 == 0;
    let alive = |record: &[u8]| record[15] & 4 == 0;
    let chosen = distinct(&scan, |record| is_chosen(record) && alive(record));
    let present = distinct(&scan, alive);
    let all = distinct(&scan, |_| true);
    assert!(chosen.len() + 100 < present.len() && present.len() < all.len());
    let limits = "classes = [2, 6]\nwithout = [\"overlap\"]\n";
    for (sees, run, seen) in [
        ("selected", "drop", &chosen),
        ("all", "drop", &present),
        ("all", "ignore", &present),
        ("all", "keep", &all),
    ] {
        for (k, method, name) in [(9, Method::Varady, "varady"), (16, Method::Pca, "pca")] {
            let keys = format!("neighbors = {k}\nmethod = \"{name}\"\nsees = \"{sees}\"\n{limits}");
            let stage = stages(&[("normals", &keys)]);
            let (_, written) = reduced(
                &scan,
                &stage,
                &format!("laz\n{NORMALS}"),
                &format!("withheld = \"{run}\""),
            );
            let at = names::NORMAL.map(|name| written.schema.find(name).unwrap());
            let mut estimator = Estimator::new(method);
            let of = |record: &[u8]| is_chosen(record) && (run == "keep" || alive(record));
            let chosen: BTreeSet<Position> = distinct(&scan, of).into_iter().collect();
            let mut expected: BTreeMap<Position, [f32; 3]> = BTreeMap::new();
            let (mut with, mut without) = (0, 0);
            for (i, p) in written.positions().into_iter().enumerate() {
                let normal = at
                    .map(|axis| axis.get(written.record(i), written.schema.endian).as_f64() as f32);
                let expected = *expected.entry(p).or_insert_with(|| {
                    if !chosen.contains(&p) {
                        return [f32::NAN; 3];
                    }
                    let offsets: Vec<Position> = nearest(seen, p, k)
                        .iter()
                        .map(|q| std::array::from_fn(|axis| q[axis] - p[axis]))
                        .collect();
                    match estimator.estimate(&offsets).0 {
                        Estimate::Normal(normal) => normal,
                        Estimate::None => [f32::NAN; 3],
                    }
                });
                let bits = |n: [f32; 3]| n.map(f32::to_bits);
                assert_eq!(bits(normal), bits(expected), "record {i} at {p:?} of\n{stage}");
                *(if normal[0].is_nan() { &mut without } else { &mut with }) += 1;
            }
            assert!(with > 800 && without > 100, "{with} with, {without} without a normal");
        }
    }
}

fn decided(ran: &Ran, name: &str) -> f64 {
    let of = ran.report.result.decisions.iter().find(|decision| decision.name == name);
    of.and_then(|decision| decision.value.as_f64()).unwrap_or_else(|| panic!("no {name} is told"))
}

#[test]
fn a_target_is_met_exactly_and_its_angle_leaves_the_same_points() {
    let scan = Scan::synthetic(Scene::Als, 6_000, 8);
    let mut without_ties = 0;
    for (keep, records) in [("10%", 600), ("1%", 60), ("57%", 3420), ("2345", 2345), ("700", 700)] {
        for (side, split) in [("\"auto\"", "voronoi"), ("17.3", "voronoi")] {
            let cells = |limit: &str| {
                let side = format!("side = {side}\nsplit = \"{split}\"\n{limit}");
                stages(&[("normals", ""), ("cells", &side), ("median", "")])
            };
            let keep = if keep.ends_with('%') {
                format!("keep = {keep:?}")
            } else {
                format!("keep = {keep}")
            };
            let (ran, left) = reduced(&scan, &cells(&keep), "las", "");
            assert_eq!((ran.report.result.ledger.kept, left.points()), (records, records as usize));
            if side == "\"auto\"" {
                continue;
            }
            let angle = format!("max_angle = {:?}", decided(&ran, "max_angle"));
            let (plain, of_angle) = reduced(&scan, &cells(&angle), "las", "");
            let kept = plain.report.result.ledger.kept;
            // Divisions of exactly this range are not made, some of them were.
            assert!(kept <= records && records - kept < 60, "{kept} of {records}");
            if kept == records {
                assert!(left.records == of_angle.records, "{keep}");
                without_ties += 1;
            }
        }
    }
    assert!(without_ties >= 3, "{without_ties} of 5");
}

#[test]
fn a_target_within_many_ties_is_met_exactly() {
    // A stair: a few different normals, and ranges that hundreds of divisions share.
    let mut scan = Scan::synthetic(Scene::Als, 4_000, 3);
    for (i, record) in scan.records.chunks_exact_mut(scan.schema.stride).enumerate() {
        let (x, y) = ((i % 64) as i32, (i / 64) as i32);
        let z = x / 5 % 2;
        for (axis, v) in [x, y, z].into_iter().enumerate() {
            record[4 * axis..4 * axis + 4].copy_from_slice(&(v * 400).to_le_bytes());
        }
    }
    let scan = scan.with_classes_and_flags(1);
    let with = |keys: &str| {
        let keys = format!("side = 1.7\n{keys}");
        let all = stages(&[("normals", "neighbors = 8"), ("cells", &keys), ("median", "")]);
        reduced(&scan, &all, "las", "withheld = \"keep\"")
    };
    let (fewest, most) = (with("max_angle = 3.1").1.points(), with("max_angle = 0.0").1.points());
    assert!(fewest + 500 < most, "{fewest} to {most}");
    let mut tied = 0;
    for step in 0..8 {
        let target = fewest + 1 + (most - fewest - 2) * step / 7;
        let (ran, left) = with(&format!("keep = {target}"));
        assert_eq!(left.points(), target);
        let angle = decided(&ran, "max_angle");
        let (of_angle, _) = with(&format!("max_angle = {angle:?}"));
        tied += usize::from((of_angle.report.result.ledger.kept as usize) < target);
    }
    assert!(tied >= 4, "{tied} of 8 targets end within ties");
}
