//! The stages that pointmill has, each by some of its keys.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use pointmill::ops::normals::Normals;
use pointmill::ops::{
    Assign, Cells, Crop, Cut, Drop, Filter, Fourier, GaussianImage, Graded, Grid, Median,
    Orientation, Outliers, Sample, Scanline, Smooth, Stats, Tap, Transformation, Triangles,
    Wavelet,
};
use pointmill::point::Column;
use pointmill::report::Tally;
use pointmill::stage::{Needs, Role, RoleName, StageKind, StagePlace, TileOp};
use pointmill::testing::{Conduct, Conformance, Promise};
use pointmill::tile::Tile;
use pointmill::{Registry, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// Gives positions the ranks that a reduction may have left.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
struct Ranks {}

const RANK: Column<f64> = Column::new("KeepRank", &[]);

impl TileOp for Ranks {
    fn needs(&self) -> Needs {
        Needs::none().writes(&RANK)
    }

    fn run(&self, tile: &mut Tile, _: &mut Tally) -> Result<()> {
        let mut ranks = tile.columns.take(&RANK)?;
        for (rank, [x, y, z]) in ranks.iter_mut().zip(&tile.positions) {
            *rank = (7 * x + 3 * y + z).rem_euclid(5) as f64 * 200.0;
        }
        tile.columns.put(ranks);
        Ok(())
    }
}

impl StageKind for Ranks {
    const KIND: &'static str = "ranks";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Gives positions ranks.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::TileOp(Box::new(self)))
    }
}

/// A file of where a sensor was, for the time of the tests.
fn trajectory() -> PathBuf {
    let path = std::env::temp_dir().join(format!("pointmill-flight-{}.csv", std::process::id()));
    std::fs::write(&path, "time,x,y,z\n-1e9,-9,0,30\n0.5,1,1,2\n1e9,40,7,-3\n").unwrap();
    path
}

/// Scans that each stage is checked on.
const RUNS: usize = 10;

fn of<K: StageKind>(keys: Value) -> K {
    serde_json::from_value(keys).unwrap()
}

fn check<K: StageKind>(keys: Value) -> Conformance {
    Conformance::of(of::<K>(keys))
}

/// The checks of each kind. Those that are none between a source and a sink have none.
fn checks() -> BTreeMap<&'static str, Vec<Conformance>> {
    let normals = || of::<Normals>(json!({ "neighbors": 6 }));
    let cells = || of::<Cells>(json!({ "side": 2.0, "max_angle": 0.4 }));
    BTreeMap::from([
        ("read", vec![]),
        ("synth", vec![]),
        ("merge", vec![]),
        ("write", vec![]),
        ("discard", vec![]),
        ("mesh", vec![]),
        ("filter", vec![check::<Filter>(json!({ "where": "Intensity > 6 and X > 0.1" }))]),
        ("drop", vec![check::<Drop>(json!({ "classes": [2, 7] }))]),
        ("crop", vec![check::<Crop>(json!({ "box": [0, 0, 0, 2, 3, 1] }))]),
        ("transform", vec![check::<Transformation>(json!({ "translate": [1, 2, 3] }))]),
        ("assign", vec![check::<Assign>(json!({ "set": "UserData = Intensity + 1" }))]),
        ("stats", vec![check::<Stats>(json!({ "dimensions": ["Z", "Intensity"] }))]),
        ("tap", vec![check::<Tap>(json!({}))]),
        (
            "outliers",
            vec![
                check::<Outliers>(json!({ "neighbors": 4, "multiplier": 1.0 })),
                check::<Outliers>(json!({ "method": "radius", "radius": 1.5, "min_neighbors": 3 })),
            ],
        ),
        (
            "smooth",
            vec![
                check::<Smooth>(json!({ "neighbors": 6 })),
                check::<Smooth>(json!({
                    "neighbors": 9, "pick": "median", "within": 3.0, "max_distance": 0.5,
                })),
            ],
        ),
        (
            "normals",
            vec![
                check::<Normals>(json!({ "neighbors": 6 })),
                check::<Normals>(json!({})),
                check::<Normals>(json!({ "neighbors": 8, "method": "delaunay" })),
                check::<Normals>(json!({ "neighbors": 8, "cocircular": "in" })),
                check::<Normals>(json!({
                    "neighbors": 12, "method": "cubic", "within": 3.0,
                    "curvature": true, "residual": true,
                })),
            ],
        ),
        (
            "cells",
            vec![
                check::<Cells>(json!({ "side": 2.0 })).after(normals()).before(Median::default()),
                check::<Cells>(json!({})).after(normals()).before(Median::default()),
                check::<Cells>(json!({ "side": 4.0, "split": "dirichlet", "seeds": 5 }))
                    .after(normals())
                    .before(Median::default()),
            ],
        ),
        (
            "orient",
            vec![
                check::<Orientation>(json!({ "by": "propagation", "neighbors": 4 }))
                    .after(normals()),
                check::<Orientation>(json!({ "by": "propagation" }))
                    .after(normals())
                    .before(cells())
                    .before(Median::default()),
                check::<Orientation>(json!({ "by": "scan-angle" })).after(normals()),
                check::<Orientation>(json!({ "by": "trajectory", "file": trajectory() }))
                    .after(normals()),
            ],
        ),
        (
            "gaussian-image",
            vec![
                check::<GaussianImage>(json!({ "side": 2.0, "parts": 3 }))
                    .after(normals())
                    .before(Median::default()),
                check::<GaussianImage>(json!({}))
                    .after(of::<Normals>(json!({ "neighbors": 6, "orient": "up" })))
                    .before(Median::default()),
            ],
        ),
        (
            "triangles",
            vec![
                check::<Triangles>(json!({ "keep": "30%" })),
                check::<Triangles>(json!({ "keep": 40, "axis": "x" })),
            ],
        ),
        (
            "wavelet",
            vec![
                check::<Wavelet>(json!({ "keep": "20%", "pixels": 16 })),
                check::<Wavelet>(json!({
                    "keep": 30, "pixels": 64, "axis": "x", "moves": false
                })),
            ],
        ),
        (
            "fourier",
            vec![
                check::<Fourier>(json!({ "keep": "20%", "pixels": 16, "axis": "y" })),
                check::<Fourier>(json!({ "keep": 30, "pixels": 64, "moves": false })),
            ],
        ),
        (
            "scanline",
            vec![
                check::<Scanline>(json!({ "max_distance": 0.3 })),
                check::<Scanline>(json!({
                    "max_distance": 2.0, "max_angle": "40deg", "gap": 1.5,
                    "lines": ["source", "channel"],
                })),
            ],
        ),
        (
            "cut",
            vec![
                check::<Cut>(json!({ "keep": "30%" })).after(Ranks {}),
                check::<Cut>(json!({ "spacing": 0.5 })).after(Ranks {}),
            ],
        ),
        (
            "median",
            vec![
                check::<Median>(json!({})).after(normals()).after(cells()),
                check::<Median>(json!({ "pick": "center" })).after(normals()).after(cells()),
                check::<Median>(json!({ "pick": "centroid" })).after(normals()).after(cells()),
            ],
        ),
        (
            "graded",
            vec![
                check::<Graded>(json!({ "keep": "20%" })),
                check::<Graded>(json!({ "keep": "auto" })),
                check::<Graded>(json!({
                    "keep": "10%", "borders": true, "weight": "Z > 0 ? 3 : 1"
                })),
                check::<Graded>(json!({ "tolerance": 0.3, "max_spacing": 2.0, "ranks": true })),
            ],
        ),
        (
            "grid",
            vec![check::<Grid>(json!({ "side": 2.0 })), check::<Grid>(json!({ "side": 2.048 }))],
        ),
        (
            "sample",
            vec![
                check::<Sample>(json!({ "distance": 1.5 })),
                check::<Sample>(json!({ "every": 3 })).streams(),
                check::<Sample>(json!({ "fraction": 0.4 })).streams(),
            ],
        ),
    ])
}

/// What is wrong with a stage; nothing if it keeps its promises and was asked all of them.
fn wrong(kind: &str, number: usize, check: Conformance) -> Option<String> {
    match check.runs(RUNS).check() {
        Ok(conduct) => {
            println!("{kind} {number}: {conduct}\n");
            (!is_asked(&conduct)).then(|| format!("{kind} {number} was hardly asked: {conduct}"))
        }
        Err(broken) => Some(format!("{kind} {number}: {broken}")),
    }
}

/// True if it was asked what can be asked of every stage, and more than once.
fn is_asked(conduct: &Conduct) -> bool {
    use Promise::{Answers, Budget, Ledger, Memory, Split, Stops, Threads, Tiles, Time};
    let often = |promise| conduct.answers.get(promise).is_some_and(|count| *count > 4);
    conduct.refused <= conduct.scans / 2
        && [Answers, Time, Ledger, Split, Tiles, Threads, Budget, Stops].iter().all(often)
        && conduct.answers.get(&Memory) == Some(&1)
        && conduct.memory.is_some()
}

/// Checks stages of these kinds.
fn assert_kept(kinds: &[&str]) {
    let mut checks = checks();
    let mut broken = Vec::new();
    for kind in kinds {
        let own = checks.remove(kind).unwrap().into_iter().enumerate();
        broken.extend(own.filter_map(|(number, check)| wrong(kind, number, check)));
    }
    assert!(broken.is_empty(), "{}", broken.join("\n\n"));
}

const STREAM: [&str; 7] = ["assign", "crop", "drop", "filter", "stats", "tap", "transform"];
const SELECT: [&str; 8] =
    ["fourier", "grid", "outliers", "sample", "scanline", "smooth", "triangles", "wavelet"];
const REDUCE: [&str; 7] =
    ["cells", "cut", "gaussian-image", "graded", "median", "normals", "orient"];
const ENDS: [&str; 6] = ["discard", "merge", "mesh", "read", "synth", "write"];

#[test]
fn every_stage_of_ours_is_checked() {
    let registry = Registry::builtin();
    let all: BTreeSet<&str> = registry.kinds().map(|(kind, _)| kind).collect();
    let lists = [&STREAM[..], &SELECT, &REDUCE, &ENDS].concat();
    assert_eq!(all, lists.into_iter().collect());
    for (kind, checks) in checks() {
        assert_eq!(checks.is_empty(), ENDS.contains(&kind), "{kind}");
    }
}

#[test]
fn stages_that_stream_keep_their_promises() {
    assert_kept(&STREAM);
}

#[test]
fn stages_that_select_keep_their_promises() {
    assert_kept(&SELECT);
}

#[test]
fn stages_that_reduce_keep_their_promises() {
    assert_kept(&REDUCE);
}
