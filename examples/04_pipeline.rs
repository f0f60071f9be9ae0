//! Reach for this when one chain of stages is not enough: two outputs of one read, stages that work
//! on some points and let the others pass, a predicate and a change of your own as closures. What
//! holds no closure prints as the pipeline file that would make it.
//!
//! `cargo run --example 04_pipeline`

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use pointmill::ops::{Drop, Grid, OutlierMethod, Outliers, Pick};
use pointmill::point::{Value, names};
use pointmill::quantity::Length;
use pointmill::stage::Needs;
use pointmill::synth::{Scene, Synth};
use pointmill::{Graph, Overrides, Quiet};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let out = |name: &str| folder.path().join(name);
    let length = |length: f64| Length::of(length).ok_or("a length above 0");
    let built = Graph::builder()
        .stage(Synth { scene: Scene::Als, points: 60_000, ..Synth::default() })
        .stage(Drop { classes: vec![7, 18], ..Drop::default() })
        .named("clean")
        // One branch: buildings and trees are thinned, the ground stays as it is.
        .stage(Grid::new(length(2.0)?, Pick::Center))
        .only("Classification != 2")
        .write(out("ground.laz"))
        // Another, from the same read: all of it, on a coarse grid.
        .from(["clean"])
        .stage(Outliers { method: OutlierMethod::Statistical, ..Outliers::default() })
        .stage(Grid::new(length(5.0)?, Pick::Center))
        .write(out("overview.ply"))
        .build()?;
    println!("{}", built.to_toml()?);
    let done = built.plan(&Overrides::default())?.run(&Quiet)?;
    let overview = &done.report.further[0].ledger;
    assert!(overview.kept < done.report.result.ledger.kept);

    // What no text can say, a closure can.
    let closures = Graph::builder()
        .read(out("ground.laz").display().to_string())
        .keep(|record, schema| {
            let field = |name| schema.find(name).map(|f| f.world(record, schema.endian));
            field("Z") > field(names::INTENSITY).map(|intensity| intensity / 1000.0)
        })
        .transform("mark", Needs::none().changes([names::USER_DATA]), |batch| {
            let schema = batch.schema().clone();
            if let Some(field) = schema.find(names::USER_DATA) {
                for record in batch.records_mut().chunks_exact_mut(schema.stride) {
                    let _ = field.put(record, schema.endian, Value::Unsigned(1));
                }
            }
            Ok(())
        })
        .write(out("marked.laz"))
        .build()?;
    let done = closures.plan(&Overrides::default())?.run(&Quiet)?;
    println!("{} points are marked", done.report.result.ledger.kept);
    assert!(closure_is_told(&out("marked.laz")));
    Ok(())
}

/// Graphs with closures run, and do not print as a text.
fn closure_is_told(path: &std::path::Path) -> bool {
    let graph = Graph::builder().read(path.display().to_string()).keep(|_, _| true);
    let graph = graph.write("never.laz").build();
    graph.is_ok_and(|graph| graph.to_toml().is_err())
}
