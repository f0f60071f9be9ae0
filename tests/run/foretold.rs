//! What a program asks a plan before it runs it.

#![allow(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use std::path::Path;

use pointmill::graph::RunSettings;
use pointmill::memory::{Batches, Records, channel};
use pointmill::ops::Tap;
use pointmill::point::PointBatch;
use pointmill::stage::OpenSource;
use pointmill::synth::{Scene, Synthetic};
use pointmill::{ErrorKind, Graph, GraphBuilder, Overrides, Plan, Quiet, Watch};

fn scan() -> Synthetic {
    Synthetic { scene: Scene::Als, points: 30_000, seed: 4, noise: None, ..Synthetic::default() }
}

fn planned(builder: GraphBuilder) -> Plan {
    builder.build().unwrap().plan(&Overrides::default()).unwrap()
}

#[test]
fn a_plan_runs_as_if_nobody_had_asked() {
    let folder = tempfile::tempdir().unwrap();
    let (scan_path, out) = (folder.path().join("scan.laz"), folder.path().join("out.laz"));
    planned(Graph::builder().source(scan()).write(&scan_path)).run(&Quiet).unwrap();
    let graph = |out: &Path| {
        // What the output says of its run is no part of what is foretold.
        let settings = RunSettings { provenance: Some(false), ..RunSettings::default() };
        let read = Graph::builder().settings(settings).read(scan_path.display().to_string());
        read.stage(Tap::default()).write(out)
    };
    let plan = planned(graph(&out));
    let foretold = plan.predict_by_trial(graph(&out).build().unwrap(), &Quiet).unwrap();
    assert!(!out.exists(), "a trial writes no output");
    assert_eq!(foretold.outputs[0].points, Some(30_000));
    // The counts of the header are compared with what was read once.
    let done = plan.run(&Quiet).unwrap();
    assert_eq!(done.report.result.ledger.kept, 30_000);
    assert_eq!(Some(std::fs::metadata(&out).unwrap().len()), foretold.outputs[0].bytes);
}

#[test]
fn points_that_come_once_are_left_for_the_run() {
    let once = || {
        let records = Records::of_positions(&[[0.0; 3], [1.0; 3]]);
        let schema = records.open().unwrap().schema().clone();
        let mut batch = PointBatch::new(schema.clone(), 2);
        batch.extend(&[0; 48]);
        Batches::new(&schema, 2, std::iter::once(Ok(batch))).unwrap()
    };
    let (sink, received) = channel(4, &[]);
    let plan = planned(Graph::builder().source(once()).sink(sink));
    let again = Graph::builder().source(once()).sink(channel(4, &[]).0).build().unwrap();
    let foretold = plan.predict_by_trial(again, &Quiet).unwrap();
    assert_eq!(foretold.trial, None);
    assert!(foretold.time_from.contains("gives its points once"), "{}", foretold.time_from);
    assert_eq!(plan.pull(received, Quiet).map(|batch| batch.unwrap().len()).sum::<usize>(), 2);
}

/// Asks to stop.
struct Stop;

impl Watch for Stop {
    fn phase(&self, _: &'static str, _: Option<u64>) {}
    fn advance(&self, _: u64) {}
    fn warn(&self, _: &str) {}
    fn cancelled(&self) -> bool {
        true
    }
}

#[test]
fn a_trial_into_a_channel_sends_nothing_and_can_be_stopped() {
    let graph = || {
        let (sink, received) = channel(1, &[]);
        (Graph::builder().source(scan()).stage(Tap::default()).sink(sink), received)
    };
    let plan = planned(graph().0);
    let (again, received) = graph();
    let foretold = plan.predict_by_trial(again.build().unwrap(), &Quiet).unwrap();
    assert_eq!((foretold.outputs[0].points, foretold.outputs[0].bytes), (Some(30_000), None));
    assert_eq!(received.count(), 0);
    let stopped = plan.predict_by_trial(graph().0.build().unwrap(), &Stop).unwrap_err();
    assert_eq!(stopped.kind(), ErrorKind::Interrupted);
}
