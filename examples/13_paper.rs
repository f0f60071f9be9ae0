//! Reach for this when an experiment is to be made again with other figures: the tables of the paper
//! that the method comes from, squares projected on an object, reduced, with other random numbers in
//! each run. Prints points after and RMS before and after, mean and standard deviation.
//!
//! `cargo run --example 13_paper` makes three runs a row; `cargo run --example 13_paper -- 30` thirty.

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use std::error::Error;

use pointmill::io::Discard;
use pointmill::ops::normals::Normals;
use pointmill::ops::{Cells, Median};
use pointmill::quantity::{Angle, Setting};
use pointmill::synth::{Scene, Synthetic};
use pointmill::{Graph, Overrides, Quiet};

/// A row of the paper's tables: points, points after, RMS before and after.
type Printed = (u64, u32, &'static str);

/// Table I.
const RANDOM: [Printed; 3] =
    [(500, 430, "0.761 -> 0.521"), (2100, 1820, "0.896 -> 0.630"), (5500, 5012, "1.89 -> 0.932")];
/// Table III.
const UNIFORM: [Printed; 3] =
    [(500, 492, "0.855 -> 0.567"), (2100, 2062, "0.923 -> 0.698"), (5500, 5446, "1.982 -> 0.997")];

/// Points kept, RMS before and after.
fn reduced(scene: Scene, points: u64, seed: u64) -> Result<[f64; 3], Box<dyn Error>> {
    let mut cells = Cells::default();
    // The paper prints 0.1 and no unit; in degrees its counts come out.
    cells.max_angle = Some(Setting::Given(Angle::degrees(0.1).ok_or("an angle")?));
    let done = Graph::builder()
        .source(Synthetic { scene, points, seed, ..Synthetic::default() })
        .stage(Normals::default())
        .stage(cells)
        .stage(Median::default())
        .stage(Discard {})
        .build()?
        .plan(&Overrides::default())?
        .run(&Quiet)?;
    let result = &done.report.result;
    let plane = result.totals.ok_or("tiles were milled")?.scan_plane;
    let rms = |of: Option<pointmill::report::PlaneFigures>| of.map_or(0.0, |plane| plane.rms);
    Ok([result.ledger.kept as f64, rms(plane.before), rms(plane.after)])
}

fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (mean, (squares / (values.len() as f64 - 1.0).max(1.0)).sqrt())
}

fn main() -> Result<(), Box<dyn Error>> {
    let seeds: u64 = std::env::args().nth(1).map_or(Ok(3), |seeds| seeds.parse())?;
    let tables = [
        ("I, random squares", Scene::SquaresRandom, RANDOM),
        ("III, uniform squares", Scene::SquaresUniform, UNIFORM),
    ];
    for (name, scene, rows) in tables {
        println!("table {name}");
        for (points, kept, rms) in rows {
            let runs = (0..seeds).map(|seed| reduced(scene, points, seed));
            let runs = runs.collect::<Result<Vec<_>, _>>()?;
            let figure =
                |n: usize| mean_and_deviation(&runs.iter().map(|r| r[n]).collect::<Vec<_>>());
            let [after, before, behind] = [0, 1, 2].map(figure);
            println!(
                "{points:>5} points: {:.0} ± {:.0} stay, RMS {:.3} ± {:.3} -> {:.3} ± {:.3}; \
                 the paper has {kept}, {rms}",
                after.0, after.1, before.0, before.1, behind.0, behind.1
            );
            assert!(after.0 > 0.0 && after.0 <= points as f64);
        }
    }
    Ok(())
}
