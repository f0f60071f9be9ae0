//! Reach for this when points come from your program and go back to it: no file at either end. The
//! results are pulled, batch by batch, and the run waits meanwhile, so that the memory stays
//! bounded; columns that stages computed come along.
//!
//! `cargo run --example 05_memory`

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use std::sync::Arc;
use std::sync::mpsc::sync_channel;
use std::thread;

use pointmill::memory::{Batches, Records, channel, schema};
use pointmill::ops::normals::Normals;
use pointmill::ops::{Cells, Median};
use pointmill::point::{NORMAL, PointBatch, Scalar};
use pointmill::{Graph, Overrides, Quiet};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    from_a_vector()?;
    from_a_sensor()
}

/// A hemisphere of points that the program has, reduced, each with its normal.
fn from_a_vector() -> Result<(), Box<dyn std::error::Error>> {
    let point = |n: u32| {
        let (z, turn) = (f64::from(n) / 20_000.0, f64::from(n) * 2.399_963);
        let r = (1.0 - z * z).sqrt();
        [r * turn.cos(), r * turn.sin(), z]
    };
    let points: Vec<[f64; 3]> = (0..20_000).map(point).collect();
    let (sink, received) = channel(4, &["NormalZ"]);
    let graph = Graph::builder()
        .source(Records::of_positions(&points))
        .stage(Normals::default())
        .stage(Cells::default())
        .stage(Median::default())
        .sink(sink)
        .build()?;
    let mut pulled = graph.plan(&Overrides::default())?.pull(received, Quiet);
    let mut upright = 0;
    for batch in &mut pulled {
        let batch = batch?;
        let normals = batch.columns.get(&NORMAL)?;
        upright += normals.iter().filter(|normal| normal[2].abs() > 0.7).count();
    }
    let ledger = pulled.finish()?.report.result.ledger;
    println!("{} of {} points are left, {upright} of them flat", ledger.kept, ledger.read);
    assert!(ledger.kept < 10_000 && upright > 0);
    Ok(())
}

/// Points that another thread sends as they come, at most so many: it waits for the run.
fn from_a_sensor() -> Result<(), Box<dyn std::error::Error>> {
    let fields =
        [("X", Scalar::F64), ("Y", Scalar::F64), ("Z", Scalar::F64), ("Echo", Scalar::U16)];
    let schema = Arc::new(schema(&fields)?);
    let (sender, receiver) = sync_channel::<PointBatch>(2);
    let of_sensor = schema.clone();
    let sensor = thread::spawn(move || {
        for line in 0..100u32 {
            let mut batch = PointBatch::new(of_sensor.clone(), 500);
            for n in 0..500u32 {
                let p = [f64::from(n) * 0.1, f64::from(line), 0.0];
                let echo = (n % 7) as u16;
                let numbers = p.iter().flat_map(|v| v.to_ne_bytes());
                batch.extend(&numbers.chain(echo.to_ne_bytes()).collect::<Vec<u8>>());
            }
            if sender.send(batch).is_err() {
                return; // nobody takes them any more
            }
        }
    });
    let (sink, received) = channel(1, &[]);
    let graph = Graph::builder()
        .source(Batches::new(&schema, 1_000_000, receiver.into_iter().map(Ok))?)
        .keep(|record, schema| {
            schema.find("Echo").is_some_and(|f| f.world(record, schema.endian) == 3.0)
        })
        .sink(sink)
        .build()?;
    let mut pulled = graph.plan(&Overrides::default())?.pull(received, Quiet);
    let kept: usize = (&mut pulled).map(|batch| batch.map(|b| b.len())).sum::<Result<_, _>>()?;
    sensor.join().map_err(|_| "the sensor panicked")?;
    println!("{kept} of {} echoes", pulled.finish()?.report.result.ledger.read);
    assert_eq!(kept, 7100);
    Ok(())
}
