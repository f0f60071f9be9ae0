//! Whole runs, of which the phases are compared with the list, and all that items came to with what
//! text brings back of it.

use std::num::NonZero;
use std::path::Path;
use std::sync::Mutex;

use serde_json::{Value, json};

use super::*;
use crate::engine::Watch;
use crate::graph::{Graph, Nonfinite, Overrides, RunSettings, SpillSetting};
use crate::host::{lock, written};
use crate::io::ends::{Read, Write};
use crate::io::las::{LAS, LAZ};
use crate::ops::normals::Normals;
use crate::ops::{Cells, Filter, Graded, Grid, Median};
use crate::stage::{Formats, Role, StageKind, StagePlace};
use crate::synth::Synth;

fn role<K: StageKind>(keys: Value) -> Role {
    let at = StagePlace::new("test", 1);
    let at = at.knowing(&Formats::default().with(LAS).with(LAZ));
    serde_json::from_value::<K>(keys).unwrap().build(&at).unwrap()
}

/// Remembers the phases that it is told of.
#[derive(Default)]
struct Told(Mutex<Vec<&'static str>>);

impl Watch for Told {
    fn phase(&self, name: &'static str, _total: Option<u64>) {
        lock(&self.0).push(name);
    }
    fn advance(&self, _points: u64) {}
    fn warn(&self, _message: &str) {}
}

fn graph() -> Graph {
    Graph::new(RunSettings {
        threads: NonZero::new(2),
        tile_points: NonZero::new(900),
        memory: Some(4 << 30),
        spill: SpillSetting::Always,
        nonfinite: Nonfinite::Drop,
        ..RunSettings::default()
    })
}

fn scan(seed: u64) -> Role {
    role::<Synth>(json!({ "scene": "als", "points": 9_000, "seed": seed }))
}

/// Runs the graph: its list of phases, and those that its report and its watcher have.
fn phases(graph: Graph) -> (Vec<RunPhase>, Vec<String>) {
    let plan = graph.plan(&Overrides::default()).unwrap();
    let (listed, told) = (plan.task.phases(), Told::default());
    let run = plan.run(&told).unwrap().report.run;
    let names: Vec<String> = run.phases.into_iter().map(|phase| phase.name).collect();
    assert_eq!(*lock(&told.0), names);
    (listed, names)
}

/// Runs the graph and compares the report with the list, of which `expected` is told.
fn has(graph: Graph, expected: &[&str]) -> Vec<RunPhase> {
    let (listed, names) = phases(graph);
    assert_eq!(names, expected);
    let told: Vec<&str> = listed.iter().filter_map(|phase| phase.name()).collect();
    assert_eq!(told, expected, "{listed:?}");
    assert_eq!(listed.last(), Some(&RunPhase::Publish));
    listed
}

/// Two files of a scan in a folder.
fn inputs(at: &Path) -> Role {
    for seed in [1, 2] {
        let mut graph = graph();
        graph.add("synth", scan(seed), &[]);
        let path = at.join(format!("{seed}.laz"));
        graph.add("write", role::<Write>(json!({ "path": path })), &[0]);
        has(graph, &["convert"]);
    }
    role::<Read>(json!({ "path": at }))
}

/// A chain into an output in canonical order, another in the input's, and a folder.
fn chain(at: &Path) -> Graph {
    let mut chain = graph();
    chain.add("read", inputs(&at.join("in")), &[]);
    chain.add("normals", role::<Normals>(json!({})), &[0]);
    chain.add("cells", role::<Cells>(json!({ "max_angle": "8deg" })), &[1]);
    chain.add("median", role::<Median>(json!({})), &[2]);
    chain.add("write", role::<Write>(json!({ "path": at.join("a.las") })), &[3]);
    let ranked = json!({ "path": at.join("b.las"), "order": "input" });
    chain.add("write", role::<Write>(ranked), &[3]);
    chain.add("write", role::<Write>(json!({ "folder": at.join("each") })), &[3]);
    chain
}

/// A stage that chooses in rounds.
fn rounds(at: &Path) -> Graph {
    let mut rounds = graph();
    rounds.add("synth", scan(4), &[]);
    rounds.add("graded", role::<Graded>(json!({ "keep": "10%", "effort": "low" })), &[0]);
    rounds.add("write", role::<Write>(json!({ "path": at.join("g.las") })), &[1]);
    rounds
}

/// A stage of two phases on one branch, a stage that streams behind tiles on another.
fn branches(at: &Path) -> Graph {
    let mut branches = graph();
    branches.add("synth", scan(3), &[]);
    branches.add("normals", role::<Normals>(json!({ "neighbors": "auto" })), &[0]);
    branches.add("cells", role::<Cells>(json!({ "keep": "10%" })), &[1]);
    branches.add("median", role::<Median>(json!({})), &[2]);
    branches.add("write", role::<Write>(json!({ "path": at.join("c.las") })), &[3]);
    branches.add("grid", role::<Grid>(json!({ "side": 2.0 })), &[0]);
    branches.add("filter", role::<Filter>(json!({ "keep_classes": [2, 5] })), &[5]);
    branches.add("write", role::<Write>(json!({ "path": at.join("d.laz") })), &[6]);
    branches
}

#[test]
fn a_report_has_the_phases_of_the_list_and_items_come_to_what_text_can_hold() {
    let at = tempfile::tempdir().unwrap();
    std::fs::create_dir(at.path().join("in")).unwrap();
    let listed = has(chain(at.path()), &["decode", "merge", "mill", "write", "write", "survey"]);
    let looks = [RunPhase::Look(0), RunPhase::Mill(0), RunPhase::Write(2), RunPhase::Write(1)];
    assert_eq!(listed[2..6], looks);
    has(rounds(at.path()), &["decode", "merge", "choose", "mill", "survey"]);
    let (listed, names) = phases(branches(at.path()));
    let named: Vec<&str> = listed.iter().filter_map(|phase| phase.name()).collect();
    assert_eq!(names, named);
    let count = |name: &str| named.iter().filter(|one| **one == name).count();
    assert_eq!((count("decode"), count("gather"), count("survey")), (1, 1, 2), "{named:?}");

    // Every tally of these runs was written down and read again on its way.
    let longest = written::longest();
    for (name, least) in [
        ("(u64, pointmill::report::tally::Tally)", 60),
        ("Merged", 1_000),
        ("Option<alloc::vec::Vec<u64>>", 20),
        ("TileTally", 60),
        ("SinkSummary", 20),
        ("Option<pointmill::report::baseline::Baseline>", 1_000),
        ("VoxelCounts", 20),
        ("MeasuredDeviations", 1_000),
        ("StoredStretch", 20),
        ("ScanSurvey", 1_000),
        ("Pair<pointmill::report::sums::Distances>", 60),
    ] {
        let texts = longest.iter().filter(|(of, _)| of.contains(name)).map(|(_, bytes)| *bytes);
        assert!(texts.max() >= Some(least), "{name}: {longest:?}");
    }
}
