//! What the phases of a run come to, whichever there were.
//!
//! A stream and a mill end in the same figures, so that there is one way to account for a run and
//! one kind of report. A run with several branches has counts for each, as if it had been the only
//! one, and counts of all for what was done once.

use std::path::PathBuf;

use super::survey::Measured;
use crate::report::{ClassFigures, Decision, PassFigures, Tally};
use crate::stage::SinkSummary;

/// What a stream or a mill came to.
pub(crate) struct Finished {
    pub read: u64,
    /// For each file of each sink, the records that it was given, and what it says.
    pub written: Vec<Vec<(u64, SinkSummary)>>,
    /// For each sink the paths of these files, if it is split.
    pub split: Vec<Vec<PathBuf>>,
    /// Counts of all branches together.
    pub tally: Tally,
    /// What each branch came to.
    pub branches: Vec<FinishedBranch>,
}

/// What a branch came to.
pub(crate) struct FinishedBranch {
    pub kept: u64,
    /// What the decode and the passes on the branch counted.
    pub tally: Tally,
    pub decisions: Vec<Decision>,
    pub classes: Vec<ClassFigures>,
    pub passes: Vec<PassFigures>,
    pub measured: Option<Measured>,
}
