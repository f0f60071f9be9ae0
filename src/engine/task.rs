//! What the engine runs: a pipeline whose stages fit each other, its inputs and the memory.

use super::beside::Beside;
use super::pass::{Pass, StageOp};
use super::shares::Demands;
use super::tagger::Tagger;
use crate::geom::lattice::Lattice;
use crate::geom::simd::Simd;
use crate::graph::RunSettings;
use crate::stage::{CreateSink, Source, Transform};

/// A run that can begin.
pub(crate) struct Task {
    pub settings: RunSettings,
    pub threads: usize,
    pub simd: Simd,
    pub source: Box<dyn Source>,
    pub source_kind: String,
    pub transforms: Vec<(String, Box<dyn Transform>)>,
    pub ops: Vec<StageOp>,
    pub passes: Vec<Pass>,
    pub sinks: Vec<Box<dyn CreateSink>>,
    /// For each sink, those of the inputs if it is a folder; else none.
    pub each: Vec<Vec<Box<dyn CreateSink>>>,
    /// What is to be copied beside outputs.
    pub beside: Vec<Beside>,
    /// See [`ranks`].
    pub ranks: Vec<u32>,
    /// A sink of what all stages leave.
    pub last_sink: usize,
    pub tagger: Tagger,
    /// True if the run needs tiles: for its stages, or to sort.
    pub mills: bool,
    /// Where points are; None for a stream that does not ask.
    pub lattice: Option<Lattice>,
    /// The stages as the report names them.
    pub stages: serde_json::Value,
    pub demands: Demands,
    /// What the user should know before the run.
    pub warnings: Vec<String>,
}
