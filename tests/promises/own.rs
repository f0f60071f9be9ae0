//! The stages that pointmill has, each by some of its keys.

use std::collections::BTreeMap;

use pointmill::Registry;
use pointmill::ops::normals::Normals;
use pointmill::ops::{
    Assign, Cells, Crop, Drop, Filter, Grid, Median, Outliers, Sample, Stats, Tap, Transformation,
};
use pointmill::stage::StageKind;
use pointmill::testing::{Conduct, Conformance, Promise};
use serde_json::{Value, json};

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
                check::<Outliers>(json!({ "neighbors": 4, "deviations": 1.0 })),
                check::<Outliers>(json!({ "method": "radius", "radius": 1.5, "min_neighbors": 3 })),
            ],
        ),
        (
            "normals",
            vec![check::<Normals>(json!({ "neighbors": 6 })), check::<Normals>(json!({}))],
        ),
        (
            "cells",
            vec![
                check::<Cells>(json!({ "side": 2.0 })).after(normals()).before(Median::default()),
                check::<Cells>(json!({})).after(normals()).before(Median::default()),
            ],
        ),
        ("median", vec![check::<Median>(json!({})).after(normals()).after(cells())]),
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

fn assert_kept(kind: &str, number: usize, check: Conformance) {
    let begin = std::time::Instant::now();
    let conduct = check.runs(RUNS).check().unwrap_or_else(|b| panic!("{kind} {number}: {b}"));
    println!("{kind} {number} {:?} {conduct}\n", begin.elapsed());
    assert_asked(&conduct);
}

/// It was asked what it was to be asked.
fn assert_asked(conduct: &Conduct) {
    assert!(conduct.refused <= conduct.scans / 2, "{conduct}");
    for promise in [Promise::Answers, Promise::Time, Promise::Split, Promise::Tiles] {
        assert!(conduct.answers.get(&promise).is_some_and(|count| *count > 3), "{conduct}");
    }
    for promise in [Promise::Threads, Promise::Budget, Promise::Stops, Promise::Memory] {
        assert!(conduct.answers.get(&promise).is_some_and(|count| *count > 0), "{conduct}");
    }
    assert!(conduct.memory.is_some(), "{conduct}");
}

#[test]
fn every_stage_of_ours_keeps_its_promises() {
    let mut checks = checks();
    for (kind, _) in Registry::builtin().kinds() {
        let own = checks.remove(kind).unwrap_or_else(|| panic!("`{kind}` is not checked"));
        for (number, check) in own.into_iter().enumerate() {
            assert_kept(kind, number, check);
        }
    }
    assert!(checks.is_empty(), "checks of no stage: {:?}", checks.keys());
}
