//! Reach for this first: a scan, reduced to the points that matter, in a program of yours. With
//! `.read("scan.laz")` in the place of the made-up scan it is one of your own.
//!
//! `cargo run --example 01_reduce`

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use pointmill::ops::normals::Normals;
use pointmill::ops::{Cells, Median};
use pointmill::synth::{Scene, Synthetic};
use pointmill::{Graph, Overrides, Quiet};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let scan = Synthetic {
        scene: Scene::Part,
        points: 100_000,
        seed: 0,
        noise: None,
        ..Synthetic::default()
    };
    let stages = Graph::builder().source(scan).stage(Normals::default()).stage(Cells::default());
    let graph = stages.stage(Median::default()).write(folder.path().join("reduced.laz")).build()?;
    let done = graph.plan(&Overrides::default())?.run(&Quiet)?;
    print!("{done}");
    let ledger = done.report.result.ledger;
    assert!(ledger.read == 100_000 && ledger.kept < ledger.read / 4);
    Ok(())
}
