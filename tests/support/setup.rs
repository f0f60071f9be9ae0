//! Runs of the pipelines that users copy, in this process, with other files and settings.

use std::path::{Path, PathBuf};

use pointmill::{Done, Graph, Overrides, Quiet, Registry, Result, Set};
use serde_json::{Value, json};

/// The pipelines that users copy.
pub const REDUCE: &str = include_str!("../../pipelines/paper.toml");
pub const CONVERT: &str = include_str!("../../pipelines/convert.toml");

/// How a run of a test is set up: values in the place of the pipeline's, memory and threads.
#[derive(Clone)]
pub struct Setup {
    pub sets: Vec<(&'static str, Value)>,
    pub threads: usize,
    pub memory: u64,
}

impl Setup {
    /// Two threads, a GiB.
    pub fn new(sets: &[(&'static str, Value)]) -> Setup {
        Setup { sets: sets.to_vec(), threads: 2, memory: 1 << 30 }
    }

    pub fn threads(self, threads: usize) -> Setup {
        Setup { threads, ..self }
    }

    pub fn memory(self, memory: u64) -> Setup {
        Setup { memory, ..self }
    }
}

/// Runs `text` with other files: parse, plan, run.
pub fn run(text: &str, inputs: &[PathBuf], output: &Path, setup: &Setup) -> Result<Done> {
    // Outputs do not say how they were made: where the files lie is to play no part.
    let files = [
        ("read.path", json!(inputs)),
        ("write.path", json!(output)),
        ("run.provenance", json!(false)),
    ];
    let set = |(address, value): &(&str, Value)| Set::argument("test", address, value.clone());
    let sets: Vec<Set> = files.iter().chain(&setup.sets).map(set).collect();
    let pipeline = Graph::parse_with(text, "test.toml", &Registry::builtin(), &sets)?;
    let overrides = Overrides {
        memory: Some(setup.memory),
        threads: std::num::NonZeroUsize::new(setup.threads),
        ..Overrides::default()
    };
    pipeline.plan(&overrides)?.run(&Quiet)
}

/// A run of `pipelines/paper.toml`.
pub fn reduce(inputs: &[PathBuf], output: &Path, setup: &Setup) -> Result<Done> {
    run(REDUCE, inputs, output, setup)
}

/// A run of `pipelines/convert.toml`.
pub fn convert(inputs: &[PathBuf], output: &Path, setup: &Setup) -> Result<Done> {
    run(CONVERT, inputs, output, setup)
}
