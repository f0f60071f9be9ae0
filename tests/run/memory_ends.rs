//! Points from a program's memory and back: the same points as through files, as few of them in
//! memory as the channel holds, and an end whenever the program wants it.

#![allow(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use pointmill::graph::RunSettings;
use pointmill::memory::{Batches, Received, Records, channel, schema};
use pointmill::ops::normals::Normals;
use pointmill::ops::{Grid, Pick};
use pointmill::point::{NORMAL, PointBatch, Scalar, Schema};
use pointmill::quantity::Length;
use pointmill::stage::{OpenSource, Role};
use pointmill::{ErrorKind, Graph, Overrides, Plan, Quiet, Result};

use crate::support::case::Case;
use crate::support::random::Random;

fn positions(count: usize) -> Vec<[f64; 3]> {
    let mut random = Random(3);
    (0..count)
        .map(|_| {
            let [x, y] = [(); 2].map(|()| (random.unit() * 4096.0).round() / 1024.0);
            [x, y, (x * 256.0).round() / 1024.0]
        })
        .collect()
}

fn grid() -> Role {
    Role::TileOp(Box::new(Grid::new(Length::of(0.25).unwrap(), Pick::Center)))
}

/// A plan from `source` through `stages` into a channel of `bound` batches with `columns`.
fn plan(
    source: impl OpenSource + 'static,
    stages: Vec<Role>,
    bound: usize,
    columns: &[&str],
) -> Result<(Plan, Received)> {
    let (sink, received) = channel(bound, columns);
    let settings = RunSettings { lattice: Some(2f64.powi(-10)), ..RunSettings::default() };
    let mut graph = Graph::new(settings);
    let mut last = graph.add("points", Role::Source(Box::new(source)), &[]);
    for stage in stages {
        last = graph.add("stage", stage, &[last]);
    }
    graph.add("channel", Role::Sink(Box::new(sink)), &[last]);
    Ok((graph.plan(&Overrides::default())?, received))
}

fn coordinates(batch: &PointBatch) -> Vec<[u64; 3]> {
    let axes = batch.schema().coordinates().unwrap();
    batch.iter().map(|r| axes.map(|d| d.world(r, batch.schema().endian).to_bits())).collect()
}

#[test]
fn what_goes_through_memory_is_what_goes_through_files() {
    let points = positions(30_000);
    let case = Case::new();
    case.ply(&points.iter().map(|p| (*p, 0)).collect::<Vec<_>>());
    case.run("lattice = 0.0009765625\n", "[[stage]]\nkind = 'grid'\nside = 0.25\n", "").unwrap();
    let by_files: Vec<[u64; 3]> =
        case.written().into_iter().map(|(p, _)| p.map(f64::to_bits)).collect();
    let (plan, received) = plan(Records::of_positions(&points), vec![grid()], 1, &[]).unwrap();
    let mut pulled = plan.pull(received, Quiet);
    let mut by_memory = Vec::new();
    for batch in &mut pulled {
        by_memory.extend(coordinates(&batch.unwrap()));
    }
    assert_eq!(by_memory, by_files, "in canonical order, too");
    let done = pulled.finish().unwrap();
    assert_eq!(done.report.result.ledger.kept as usize, by_memory.len());
    assert_eq!(done.report.run.outputs[0].path, "channel");
}

#[test]
fn columns_come_beside_the_records_that_they_are_of() {
    let points = positions(3000);
    let normals = Role::TileOp(Box::new(Normals::default()));
    let (plan, received) =
        plan(Records::of_positions(&points), vec![normals], 2, &["NormalZ"]).unwrap();
    let mut pulled = plan.pull(received, Quiet);
    let mut count = 0;
    for batch in &mut pulled {
        let batch = batch.unwrap();
        let normals = batch.columns.get(&NORMAL).unwrap();
        assert_eq!(normals.len(), batch.len());
        let slope = 1.0 / 17f32.sqrt();
        let close = |n: &&[f32; 3]| (n[0].abs() - slope).abs() < 0.05;
        count += normals.iter().filter(close).count();
    }
    assert!(count > 2700, "{count} lie on the slope");
    assert_eq!(pulled.finish().unwrap().report.result.ledger.kept, 3000);
}

/// Batches of 1000 points that count how many were asked for.
fn counted(
    of: u64,
    asked: &Arc<AtomicU64>,
) -> (Arc<Schema>, impl Iterator<Item = Result<PointBatch>> + use<>) {
    let fields = [("X", Scalar::F64), ("Y", Scalar::F64), ("Z", Scalar::F64)];
    let schema = Arc::new(schema(&fields).unwrap());
    let (of_batch, asked) = (schema.clone(), asked.clone());
    let batches = (0..of).map(move |n| {
        asked.fetch_add(1, Ordering::SeqCst);
        let mut batch = PointBatch::new(of_batch.clone(), 1000);
        for i in 0..1000 {
            let p = [(n * 1000 + i) as f64, 0.5, -1.0];
            batch.extend(p.map(f64::to_ne_bytes).as_flattened());
        }
        Ok(batch)
    });
    (schema, batches)
}

#[test]
fn a_run_waits_for_the_program_and_ends_with_it() {
    let asked = Arc::new(AtomicU64::new(0));
    let (schema, batches) = counted(20_000, &asked);
    let source = Batches::new(&schema, 20_000_000, batches).unwrap();
    let (plan, received) = plan(source, Vec::new(), 1, &[]).unwrap();
    assert_eq!(asked.load(Ordering::SeqCst), 0, "nothing is asked for before the run");
    let mut pulled = plan.pull(received, Quiet);
    let first = pulled.next().unwrap().unwrap();
    assert_eq!(first.len(), 1 << 14);
    std::thread::sleep(std::time::Duration::from_millis(300));
    let ahead = asked.load(Ordering::SeqCst);
    assert!(ahead < 2000, "{ahead} of 20,000 batches were asked for while one was taken");
    drop(pulled);
    assert!(asked.load(Ordering::SeqCst) < 2000, "dropping it stops the run");
}

#[test]
fn batches_come_once_and_are_as_many_as_was_said() {
    let asked = Arc::new(AtomicU64::new(0));
    let (schema, batches) = counted(5, &asked);
    let (short, received) =
        plan(Batches::new(&schema, 4000, batches).unwrap(), vec![grid()], 1, &[]).unwrap();
    let told: Vec<_> = short.pull(received, Quiet).collect();
    let [Err(error)] = &told[..] else { panic!("{told:?}") };
    assert!(error.to_string().contains("was to give 4000 points at most"), "{error}");
    let (schema, batches) = counted(5, &asked);
    let source = Batches::new(&schema, 5000, batches).unwrap();
    let open = source.open().unwrap();
    assert_eq!(open.parts(), 1);
    assert!(open.part(0).is_ok() && open.part(0).is_err());
    // An error of the iterator ends the run, which tells it.
    let failing = std::iter::once(Err(pointmill::Error::pipeline("the sensor is off")));
    let (plan, received) =
        plan(Batches::new(&schema, 9, failing).unwrap(), Vec::new(), 1, &[]).unwrap();
    let pulled = plan.pull(received, Quiet);
    assert_eq!(pulled.finish().unwrap_err().to_string(), "the sensor is off");
    // And records need a place, and whole records.
    assert!(pointmill::memory::schema(&[("X", Scalar::F64)]).is_err());
    assert!(Records::new((*schema).clone(), vec![0; 25]).is_err());
}

#[test]
fn two_runs_go_side_by_side_each_within_its_budget() {
    let points = positions(20_000);
    let run = |memory: u64| {
        let (sink, received) = channel(1, &[]);
        let settings = RunSettings { memory: Some(memory), ..RunSettings::default() };
        let mut graph = Graph::new(settings);
        let source = Records::of_positions(&points);
        let source = graph.add("points", Role::Source(Box::new(source)), &[]);
        let grid = graph.add("grid", grid(), &[source]);
        graph.add("channel", Role::Sink(Box::new(sink)), &[grid]);
        graph.plan(&Overrides::default()).unwrap().pull(received, Quiet)
    };
    let (mut one, mut other) = (run(800 << 20), run(1000 << 20));
    let mut sets = [BTreeSet::new(), BTreeSet::new()];
    loop {
        let next = [one.next(), other.next()];
        if next.iter().all(Option::is_none) {
            break;
        }
        for (set, batch) in sets.iter_mut().zip(next) {
            batch.into_iter().for_each(|batch| set.extend(coordinates(&batch.unwrap())));
        }
    }
    assert!(!sets[0].is_empty() && sets[0] == sets[1]);
    let budgets = [one, other].map(|run| run.finish().unwrap().report.run.memory_bytes);
    assert_eq!(budgets, [800 << 20, 1000 << 20]);
}

#[test]
fn a_receiver_that_is_gone_interrupts_the_run() {
    let (plan, received) =
        plan(Records::of_positions(&positions(100)), Vec::new(), 1, &[]).unwrap();
    drop(received);
    assert_eq!(plan.run(&Quiet).unwrap_err().kind(), ErrorKind::Interrupted);
}
