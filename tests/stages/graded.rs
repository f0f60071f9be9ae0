//! `graded` over whole scans: exact numbers, coverage, and tolerances that brute force confirms.

use std::collections::BTreeMap;

use crate::support::random::Random;
use pointmill::graph::RunSettings;
use pointmill::memory::{Records, channel};
use pointmill::ops::{Graded, KEEP_RANK};
use pointmill::report::BaselineFigures;
use pointmill::{Graph, Overrides, Quiet};
use serde_json::{Value, json};

/// Steps of the lattice that the scans are on: all coordinates are whole multiples.
pub const STEP: f64 = 1.0 / 1024.0;

/// A position in steps.
pub type At = [i64; 3];

/// What a run leaves: each kept position with its rank, and the report's figures.
pub struct Left {
    pub kept: BTreeMap<At, u16>,
    deviation: f64,
    counts: BTreeMap<String, u64>,
    spacing: Option<f64>,
    pub baseline: Option<BaselineFigures>,
}

pub fn graded(scan: &[At], keys: Value, tile_points: Option<usize>) -> Left {
    let stage: Graded = serde_json::from_value(keys).unwrap();
    let points: Vec<[f64; 3]> = scan.iter().map(|p| p.map(|v| v as f64 * STEP)).collect();
    let (sink, received) = channel(4, if stage.ranks { &["KeepRank"] } else { &[] });
    let graph = Graph::builder()
        .settings(RunSettings {
            lattice: Some(STEP),
            tile_points: tile_points.and_then(std::num::NonZeroUsize::new),
            ..RunSettings::default()
        })
        .source(Records::of_positions(&points))
        .stage(stage)
        .sink(sink)
        .build()
        .unwrap();
    let mut pulled = graph.plan(&Overrides::default()).unwrap().pull(received, Quiet);
    let mut kept = BTreeMap::new();
    for batch in &mut pulled {
        let batch = batch.unwrap();
        let schema = batch.schema();
        let axes = schema.coordinates().unwrap();
        let ranks = batch.columns.find(&KEEP_RANK);
        for (i, record) in batch.iter().enumerate() {
            let at = axes.map(|d| (d.world(record, schema.endian) / STEP).round() as i64);
            kept.insert(at, ranks.map_or(0, |ranks| ranks[i]));
        }
    }
    let result = pulled.finish().unwrap().report.result;
    let spacing = result.decisions.iter().find(|decision| decision.name == "spacing");
    let spacing = spacing.map(|spacing| spacing.value.as_f64().unwrap());
    let deviation = result.totals.and_then(|totals| totals.deviation).map_or(0.0, |d| d.max);
    let baseline = result.totals.and_then(|totals| totals.baseline);
    Left { kept, deviation, counts: result.counts, spacing, baseline }
}

/// A rough surface with a step in it, some points twice and, in some scans, everything on a grid.
pub fn scan(random: &mut Random, count: usize) -> Vec<At> {
    let side = 200 + random.below(4000) as i64;
    let grid = [1, 1, 40][random.below(3)];
    let mut scan: Vec<At> = (0..count)
        .map(|_| {
            let [x, y] = [(); 2].map(|()| random.below(side as usize) as i64 / grid * grid);
            let bend = (x * x / side + if y > side / 2 { side / 5 } else { 0 }) / grid * grid;
            [x, y, bend + random.below(1 + 30 / grid as usize) as i64]
        })
        .collect();
    scan.extend_from_within(..count / 10);
    scan
}

pub fn distinct(scan: &[At]) -> Vec<At> {
    let mut all = scan.to_vec();
    all.sort_unstable();
    all.dedup();
    all
}

fn squared(a: At, b: At) -> i64 {
    (0..3).map(|i| (a[i] - b[i]).pow(2)).sum()
}

/// How far `p` is from the surface, by all distances and a decomposition of a whole matrix.
pub fn off(p: At, surface: &[At], within2: f64) -> f64 {
    let mut near: Vec<i64> = surface.iter().map(|q| squared(*q, p)).collect();
    near.sort_unstable();
    let last = near.get(7).copied().unwrap_or(i64::MAX);
    let is_in = |q: &&At| squared(**q, p) <= last && squared(**q, p) as f64 <= within2;
    let asked: Vec<[f64; 3]> =
        surface.iter().filter(is_in).map(|q| [0, 1, 2].map(|i| (q[i] - p[i]) as f64)).collect();
    let nearest = (near[0] as f64).sqrt();
    if asked.len() < 5 {
        return nearest;
    }
    let n = asked.len() as f64;
    let mean = [0, 1, 2].map(|i| asked.iter().map(|q| q[i]).sum::<f64>() / n);
    let scatter = nalgebra::Matrix3::from_fn(|i, j| {
        asked.iter().map(|q| (q[i] - mean[i]) * (q[j] - mean[j])).sum::<f64>()
    });
    let eigen = scatter.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let [least, middle, most] = order.map(|i| eigen.eigenvalues[i]);
    // The two are told apart by roundings at the threshold alone, where both are within tolerance
    // or neither is compared.
    let normal = eigen.eigenvectors.column(order[0]);
    let to_plane = (0..3).map(|i| mean[i] * normal[i]).sum::<f64>().abs();
    match (middle - least) / most {
        gap if gap < 0.99e-4 => nearest,
        gap if gap > 1.01e-4 => to_plane,
        _ => f64::min(nearest, to_plane),
    }
}

#[test]
fn exactly_so_many_stay_and_none_is_farther_than_the_report_says() {
    let (mut random, mut covered) = (Random(11), 0);
    for n in 0..60 {
        let count = [1, 2, 9, 60, 700, 3000][n % 6];
        let scan = scan(&mut random, count);
        let all = distinct(&scan);
        let keep = 1 + random.below(all.len() + all.len() / 8 + 1);
        let effort = ["low", "normal"][n % 2];
        let left = graded(&scan, json!({ "keep": keep, "effort": effort, "seed": n }), None);
        assert_eq!(left.kept.len(), keep.min(all.len()), "{n}: {keep} of {}", all.len());
        assert!(left.kept.keys().all(|p| all.binary_search(p).is_ok()));
        let Some(most) = left.spacing.map(|spacing| spacing / STEP) else { continue };
        covered += 1;
        for p in &all {
            let nearest = left.kept.keys().map(|q| squared(*p, *q)).min().unwrap();
            assert!((nearest as f64).sqrt() <= most, "{n}: {p:?} is {nearest} from the nearest");
        }
    }
    assert!(covered > 30, "{covered}");
}

#[test]
fn a_tolerance_holds_in_a_thousand_small_scans() {
    let mut random = Random(5);
    let (mut exceptions, mut removed) = (0, 0);
    for n in 0..1000 {
        let count = 3 + random.below(250);
        let scan = scan(&mut random, count);
        let all = distinct(&scan);
        let tolerance = (2 + random.below(60)) as f64 * STEP;
        let spacing = (50 + random.below(900)) as f64 * STEP;
        let keys = json!({ "tolerance": tolerance, "max_spacing": spacing, "ranks": true });
        let left = graded(&scan, keys, (n % 3 > 0).then_some(1 + random.below(60)));
        let surface: Vec<At> =
            left.kept.iter().filter(|(_, rank)| **rank < u16::MAX).map(|(p, _)| *p).collect();
        let of_exceptions = (left.kept.len() - surface.len()) as u64;
        assert_eq!(left.counts.get("graded_exceptions"), Some(&of_exceptions), "{n}");
        exceptions += of_exceptions;
        let (within2, mut largest) = ((4.0 * spacing / STEP).powi(2), 0f64);
        for p in all.iter().filter(|p| !left.kept.contains_key(*p)) {
            let nearest = surface.iter().map(|q| squared(*p, *q)).min().unwrap();
            assert!((nearest as f64).sqrt() <= spacing / STEP, "{n}: {p:?}");
            let off = off(*p, &surface, within2) * STEP;
            assert!(off <= tolerance, "{n}: {p:?} is {off} off, and {tolerance} is allowed");
            largest = largest.max(off);
            removed += 1;
        }
        let told = left.deviation;
        assert!(told <= tolerance && told + 1e-9 >= largest * 0.999, "{n}: {told} {largest}");
    }
    assert!(exceptions > 100 && removed > 20_000, "{exceptions} of {removed}");
}

#[test]
fn a_number_and_a_tolerance_are_met_by_whichever_needs_fewer_points() {
    let scan = scan(&mut Random(2), 4000);
    let (tolerance, max_spacing) = (12.0 * STEP, 300.0 * STEP);
    let of = |keep: Option<usize>| {
        let mut keys = json!({ "tolerance": tolerance, "max_spacing": max_spacing });
        if let Some(keep) = keep {
            keys["keep"] = json!(keep);
        }
        graded(&scan, keys, None).kept
    };
    let needed = of(None);
    assert!(needed.len() > 20 && needed.len() < 3000, "{}", needed.len());
    assert_eq!(of(Some(needed.len())), needed);
    assert_eq!(of(Some(needed.len() + 500)), needed);
    let spacing = json!({ "keep": needed.len() - 1 });
    assert_eq!(of(Some(needed.len() - 1)).len(), needed.len() - 1, "{spacing}");
}

#[test]
fn points_of_low_ranks_are_the_reduction_to_fewer() {
    let scan = scan(&mut Random(8), 5000);
    let of = |keep: usize| graded(&scan, json!({ "keep": keep, "ranks": true }), None).kept;
    let (many, few) = (of(2000), of(300));
    let highest = *few.values().max().unwrap();
    assert!(highest > 3, "{highest}");
    for (p, rank) in &few {
        assert_eq!(many.get(p), Some(rank), "{p:?}");
    }
    let lower = many.iter().filter(|(_, rank)| **rank < highest);
    assert!(lower.clone().count() > 100 && lower.into_iter().all(|(p, _)| few.contains_key(p)));
}
