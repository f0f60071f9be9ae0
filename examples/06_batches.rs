//! Reach for this when you want the points themselves: read any source batch by batch, in bounded
//! memory, and look at a field by its name. Here, the classes of a computed airborne scan.
//!
//! `cargo run --example 06_batches -- 5000000`

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use std::collections::BTreeMap;
use std::error::Error;

use pointmill::point::{PointBatch, names};
use pointmill::stage::OpenSource;
use pointmill::synth::{Scene, Synthetic};

fn main() -> Result<(), Box<dyn Error>> {
    let points = std::env::args().nth(1).map_or(Ok(200_000), |n| n.parse())?;
    let scan =
        Synthetic { scene: Scene::Als, points, seed: 0, noise: None, ..Synthetic::default() };
    // Opening reads headers (here: none), no point.
    let source = scan.open()?;
    let schema = source.schema().clone();
    let class = schema.find(names::CLASSIFICATION).ok_or("the scan has no classes")?;

    // One batch serves for the whole scan. Parts are independent: threads could share them out.
    let mut batch = PointBatch::new(schema.clone(), 8192);
    let mut classes = BTreeMap::new();
    for index in 0..source.parts() {
        let mut part = source.part(index)?;
        loop {
            part.read(&mut batch)?;
            if batch.is_empty() {
                break;
            }
            for record in batch.iter() {
                let class = class.get(record, schema.endian).as_f64() as u8;
                *classes.entry(class).or_insert(0u64) += 1;
            }
        }
    }

    for (class, count) in &classes {
        println!("class {class}: {count} points");
    }
    Ok(())
}
