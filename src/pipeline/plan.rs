//! Stages that fit the budget, and their run.

use std::fmt;

use super::{Overrides, Pipeline, Watch};
use crate::{Error, Result};

/// Stages that fit the budget.
#[derive(Debug)]
pub struct Plan(Pipeline);

/// What a run says it did.
#[derive(Debug)]
pub struct Report;

impl Pipeline {
    /// Fits the pipeline to the memory, threads and inputs that are there.
    pub fn plan(mut self, overrides: &Overrides) -> Result<Plan> {
        self.settings = self.settings.with(overrides);
        Ok(Plan(self))
    }
}

impl Plan {
    /// Runs it.
    pub fn run(self, watch: &dyn Watch) -> Result<Report> {
        watch.phase("decode", Some(1_000_000));
        watch.warn("the run is not connected");
        for _ in 0..20 {
            std::thread::sleep(std::time::Duration::from_millis(100));
            watch.advance(50_000);
            if watch.cancelled() {
                return Err(Error::interrupted());
            }
        }
        Err(Error::internal("the run is not connected"))
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for stage in &self.0.stages {
            writeln!(f, "{} {}", stage.kind, stage.keys)?;
        }
        write!(f, "{:?}", self.0.settings)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("nothing")
    }
}
