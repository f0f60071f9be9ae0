//! The voxel grid that the report has beside `graded`: the figures that a grid of that side comes
//! to by all distances, for as many points as were kept.

use std::collections::BTreeMap;

use super::graded::{At, STEP, distinct, graded, off, scan};
use crate::support::random::Random;
use crate::support::runs::{Settings, run};
use crate::support::scan::Scan;
use pointmill::internals::morton_cmp;
use pointmill::report::BaselineFigures;
use pointmill::synth::Scene;
use serde_json::json;

/// Of each cube of `side` steps the position nearest to the centre, of equals the Morton-first.
fn grid(all: &[At], side: i64) -> Vec<At> {
    let mut cubes: BTreeMap<At, Vec<At>> = BTreeMap::new();
    all.iter().for_each(|p| cubes.entry(p.map(|v| v.div_euclid(side))).or_default().push(*p));
    let nearest = |(cube, mut members): (At, Vec<At>)| {
        members.sort_unstable_by(morton_cmp);
        let from_center = |p: &At| -> i64 {
            (0..3).map(|axis| (2 * (p[axis] - cube[axis] * side) - side).pow(2)).sum()
        };
        members.into_iter().min_by_key(from_center).unwrap()
    };
    cubes.into_iter().map(nearest).collect()
}

/// Compares the figures with those of the grid, by all distances; how many points that has.
fn compare(scan: &[At], baseline: &BaselineFigures, what: &str) -> usize {
    let side = (baseline.side / STEP).round() as i64;
    let points = grid(&distinct(scan), side);
    let within2 = (4.0 * side as f64).powi(2);
    let mut records: BTreeMap<At, usize> = BTreeMap::new();
    scan.iter().for_each(|p| *records.entry(*p).or_default() += 1);
    let mut all: Vec<f64> = Vec::new();
    for (p, copies) in records {
        let is_kept = points.contains(&p);
        let off = if is_kept { 0.0 } else { off(p, &points, within2) * STEP };
        all.extend(vec![off; copies - usize::from(is_kept)]);
    }
    all.sort_unstable_by(f64::total_cmp);
    assert_eq!(baseline.points, all.len() as u64, "{what}");
    let rms = (all.iter().map(|off| off * off).sum::<f64>() / all.len() as f64).sqrt();
    let is_near = (baseline.rms - rms).abs() <= 1e-6 * rms;
    assert!(is_near, "{what}: {} and by all distances {rms}", baseline.rms);
    for (told, percent) in [(baseline.p50, 50), (baseline.p95, 95), (baseline.p99, 99)] {
        let exact = all[(all.len() * percent).div_ceil(100) - 1];
        let is_near = exact * (1.0 - 1e-6) <= told && told <= exact * 1.01 + 1e-9;
        assert!(is_near, "{what}: {percent} % within {told}, and by all distances {exact}");
    }
    points.len()
}

#[test]
fn the_grid_beside_a_reduction_is_the_one_of_as_many_points_by_brute_force() {
    let (mut random, mut seen) = (Random(23), 0);
    let mut ratios = Vec::new();
    for n in 0..36 {
        let scan = scan(&mut random, [60, 700, 2500][n % 3]);
        let count = distinct(&scan).len();
        let share = [3, 10, 30, 60][n % 4];
        let keys = match n % 5 {
            0 => json!({ "keep": (count * share / 100).max(1), "ranks": true }),
            1 => json!({ "tolerance": 9.0 * STEP, "max_spacing": 500.0 * STEP }),
            2 => json!({ "keep": "auto" }),
            _ => json!({ "keep": (count * share / 100).max(1), "effort": "low" }),
        };
        let what = format!("{n}: {keys}");
        let left = graded(&scan, keys, (n % 2 > 0).then_some(1 + random.below(90)));
        let Some(baseline) = left.baseline else { continue };
        let points = compare(&scan, &baseline, &what);
        seen += 1;
        if left.kept.len() >= 50 {
            ratios.push(points as f64 / left.kept.len() as f64);
        }
    }
    assert!(seen > 25 && ratios.len() > 15, "{seen}, {ratios:?}");
    // Scans whose positions are on a coarse lattice have no grid of just any number.
    ratios.sort_unstable_by(f64::total_cmp);
    let middle = &ratios[ratios.len() / 10..ratios.len() * 9 / 10];
    assert!(middle.iter().all(|ratio| (0.9..1.1).contains(ratio)), "{ratios:?}");
}

/// Waves of 307,200 points.
fn waves() -> Vec<At> {
    let wave = |x: i64, y: i64| ((x as f64 / 9.0).sin() * (y as f64 / 7.0).cos() * 90.0) as i64;
    let at = |i: i64| [16 * (i % 640), 16 * (i / 640), wave(i % 640, i / 640) + i * i % 11];
    (0..640 * 480).map(at).collect()
}

#[test]
fn of_many_points_a_sample_is_measured_and_no_cut_into_tiles_shows() {
    let scan = waves();
    let beside = |keep: &str, tile_points: Option<usize>| {
        graded(&scan, json!({ "keep": keep, "effort": "low" }), tile_points).baseline.unwrap()
    };
    let whole = beside("4%", None);
    assert!((90_000..170_000).contains(&whole.points), "{whole:?}");
    assert_eq!(beside("4%", Some(2000)), whole);
    let points = grid(&scan, (whole.side / STEP).round() as i64).len() as f64;
    let ratio = points / (0.04 * scan.len() as f64);
    assert!((0.97..1.03).contains(&ratio), "{points} points");
    let fewer = beside("1%", None);
    assert!(fewer.rms > 1.5 * whole.rms && fewer.side > 1.7 * whole.side, "{whole:?} {fewer:?}");
}

#[test]
fn where_nothing_is_removed_there_is_no_grid() {
    let scan: Vec<At> = (0..400).map(|i| [i % 20 * 9, i / 20 * 9, i % 3]).collect();
    for keys in [json!({ "keep": 400 }), json!({ "keep": "100%" })] {
        let left = graded(&scan, keys.clone(), None);
        assert_eq!((left.kept.len(), left.baseline), (400, None), "{keys}");
    }
    assert_eq!(graded(&[[1, 2, 3]; 9], json!({ "keep": 1 }), None).baseline, None);
    assert_eq!(graded(&[], json!({ "keep": "5%" }), None).baseline, None);
}

#[test]
fn it_is_beside_what_the_stage_decides_about_and_what_stays_in_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.las");
    Scan::synthetic(Scene::Als, 20_000, 4).write(&input);
    let of = |stages: &str| {
        let inputs = std::slice::from_ref(&input);
        let ran = run(folder.path(), inputs, stages, "las", Settings::PLAIN).unwrap();
        let totals = ran.report.result.totals.unwrap();
        assert!(totals.points.after < totals.points.before && totals.deviation.is_some());
        totals.baseline
    };
    let graded = "[[stage]]\nkind = 'graded'\nkeep = '10%'\n";
    let (all, ground) = (of(graded).unwrap(), of(&format!("{graded}classes = [2]\n")).unwrap());
    assert!(ground.points > 10_000 && ground.points < all.points, "{ground:?} {all:?}");
    // Trees are worse than the ground.
    assert!(ground.rms < 0.7 * all.rms, "{ground:?} {all:?}");
    let behind = "[[stage]]\nkind = 'grid'\nside = 0.7\n";
    let thinned = of(&format!("{behind}{graded}")).unwrap();
    assert!(thinned.points < all.points && thinned.points > 2000, "{thinned:?}");
    assert_eq!(of(&format!("{graded}[[stage]]\nkind = 'grid'\nside = 9\n")), None, "fewer stay");
}
