//! What conditions and assignments cost: nanoseconds of CPU for a point and a term.
//!
//! `cargo bench --bench expressions` applies each to a hundred million airborne points, 8,192 of
//! which are in memory; `cargo bench --bench expressions -- 1000000` to another number. A term is a
//! name or a constant with its operator: `Z > 100` is one, `Z > 100 and Intensity < 7` are two.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints and may fail")]

use std::hint::black_box;

use pointmill::internals::cpu_seconds;
use pointmill::ops::{Assign, Filter};
use pointmill::point::PointBatch;
use pointmill::report::Tally;
use pointmill::stage::{OpenSource, Role, StageKind, StagePlace, Transform};
use pointmill::synth::{Scene, Synthetic};

/// Points of a batch: what a run has.
const BATCH: usize = 8192;

/// Conditions that hold for every point, so that none goes, with their terms.
const CONDITIONS: [(&str, usize); 7] = [
    ("Classification != 9", 1),
    ("Intensity >= 0 and Classification < 99", 2),
    ("Z > -1e6 and Z < 1e6 and X > 0 and Y > 0 and Intensity >= 0", 5),
    ("Classification in [2, 5, 6] or Classification not in [2, 5, 6]", 2),
    ("ReturnNumber <= NumberOfReturns", 1),
    ("(Z - 100) / 2 + Intensity * 0.5 > -1e9", 4),
    ("sqrt(X * X + Y * Y) > 0", 4),
];

const ASSIGNMENTS: [(&str, usize); 2] =
    [("Intensity = Intensity / 2", 2), ("Classification = 7", 1)];

fn transform<K: StageKind>(keys: serde_json::Value) -> Box<dyn Transform> {
    let stage: K = serde_json::from_value(keys).unwrap();
    match stage.build(&StagePlace::new("bench", 1)).unwrap() {
        Role::Transform(transform) => transform,
        _ => unreachable!("these stages stream"),
    }
}

fn main() {
    let given = std::env::args().skip(1).find_map(|word| word.parse().ok());
    let points: usize = given.unwrap_or(100_000_000);
    let scan = Synthetic {
        scene: Scene::Als,
        points: BATCH as u64,
        seed: 1,
        noise: None,
        ..Synthetic::default()
    };
    let source = scan.open().unwrap();
    let mut batch = PointBatch::new(source.schema().clone(), BATCH);
    source.part(0).unwrap().read(&mut batch).unwrap();
    println!("ns a point, and a term");
    let conditions = CONDITIONS.map(|(text, terms)| {
        (text, terms, transform::<Filter>(serde_json::json!({ "where": text })))
    });
    let assignments = ASSIGNMENTS.map(|(text, terms)| {
        (text, terms, transform::<Assign>(serde_json::json!({ "set": text })))
    });
    for (text, terms, stage) in conditions.into_iter().chain(assignments) {
        stage.check(batch.schema()).unwrap();
        let (rounds, begin) = (points.div_ceil(BATCH), cpu_seconds());
        for _ in 0..rounds {
            stage.apply(black_box(&mut batch), &mut Tally::default()).unwrap();
        }
        let each = (cpu_seconds() - begin) * 1e9 / (rounds * BATCH) as f64;
        assert_eq!(batch.len(), BATCH, "`{text}` removes none");
        println!("{each:6.2} {:6.2}  {text}", each / terms as f64);
    }
}
