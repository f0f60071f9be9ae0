//! Reach for this when a program goes on from what a run says of itself: how many points went where
//! and why, how far the removed ones lie from what stands for them, and where it is worst.
//!
//! `cargo run --example 02_report`

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use pointmill::graph::RunSettings;
use pointmill::ops::normals::Normals;
use pointmill::ops::{Cells, Median, Stats};
use pointmill::synth::{Scene, Synthetic};
use pointmill::{Graph, Overrides, Quiet};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("report.json");
    let settings = RunSettings { report: Some(file.clone()), ..RunSettings::default() };
    let done = Graph::builder()
        .settings(settings)
        .source(Synthetic {
            scene: Scene::Als,
            points: 100_000,
            seed: 0,
            noise: None,
            ..Synthetic::default()
        })
        .stage(Stats { dimensions: vec!["Z".into(), "Intensity".into()], by_class: false })
        .stage(Normals::default())
        .stage(Cells::default())
        .stage(Median::default())
        .write(folder.path().join("reduced.laz"))
        .build()?
        .plan(&Overrides::default())?
        .run(&Quiet)?;

    // In the program: what was decided, a function of the points alone.
    let result = &done.report.result;
    for removed in &result.ledger.removed {
        println!("{:>7} {} by {}", removed.records, removed.reason, removed.stage);
    }
    let totals = result.totals.ok_or("tiles were milled")?;
    let deviation = totals.deviation.ok_or("points were removed")?;
    println!(
        "95 % of them lie within {:.3} m, the worst {:.3} m off",
        deviation.p95, deviation.max
    );
    println!("at {:?}", deviation.at);
    let (name, z) = &result.stats[0].dimensions[0];
    println!("{name} is {:?} on average", z.mean);

    // In the file: the same, and a line for each tile.
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(&file)?)?;
    let tiles = report["result"]["tiles"].as_array().ok_or("a report has tiles")?;
    let rms = |tile: &serde_json::Value| tile["plane"]["after"]["rms"].as_f64();
    let flattest = tiles.iter().filter_map(rms).fold(f64::INFINITY, f64::min);
    println!("{} tiles, the flattest with an RMS of {flattest:.4} m", tiles.len());
    assert_eq!(tiles.len() as u64, totals.tiles);
    Ok(())
}
