//! What a plan says of itself before it is run, for programs.

use std::path::{Path, PathBuf};

use super::fitted::Plan;

/// What a plan reads, writes and uses.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Outline {
    /// Files that are read.
    pub inputs: usize,
    /// Records in them by their headers.
    pub points: u64,
    /// Files that are written.
    pub outputs: Vec<PathBuf>,
    /// Where the report is written, if one is wanted.
    pub report: Option<PathBuf>,
    /// Threads that work at once.
    pub threads: usize,
    /// Bound of the peak memory.
    pub memory_bytes: u64,
    /// Folder for what does not fit in memory.
    pub scratch: PathBuf,
}

impl Plan {
    /// What the user should know before the plan is run. A run tells it too.
    pub fn warnings(&self) -> Vec<String> {
        self.task.source.warnings().into_iter().chain(self.task.warnings.clone()).collect()
    }

    /// The sign of the unit that lengths of the scan are in, where it says that.
    pub fn unit(&self) -> Option<&'static str> {
        self.task.source.metadata().units.sign()
    }

    /// What the plan reads, writes and uses.
    pub fn outline(&self) -> Outline {
        let outputs: Vec<PathBuf> =
            self.task.sinks.iter().map(|sink| sink.path().to_owned()).collect();
        let beside = outputs.first().and_then(|output| output.parent());
        let beside = beside.filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        Outline {
            inputs: self.task.source.inputs().len(),
            points: self.task.source.points(),
            report: self.task.settings.report.clone(),
            threads: self.task.threads,
            memory_bytes: self.task.demands.limit,
            scratch: self.task.settings.scratch.clone().unwrap_or_else(|| beside.to_owned()),
            outputs,
        }
    }
}
