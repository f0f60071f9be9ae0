//! What the engine runs: a pipeline whose stages fit each other, its inputs and the memory.
//!
//! It is made by the plan and says everything that a run depends on, so the engine asks neither the
//! pipeline's text nor its graph. A run consumes it: stages settle, and could not be run twice from
//! their beginning.

use super::beside::Beside;
use super::demands::Demands;
use super::pass::{Branch, Pass, PassFilter, StageOp};
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
    /// Stages that stream behind the decode.
    pub filters: Vec<PassFilter>,
    pub passes: Vec<Pass>,
    pub branches: Vec<Branch>,
    pub sinks: Vec<Box<dyn CreateSink>>,
    /// For each sink, those of the inputs if it is a folder; else none.
    pub each: Vec<Vec<Box<dyn CreateSink>>>,
    /// What is to be copied beside outputs.
    pub beside: Vec<Beside>,
    /// See [`ranks`].
    pub ranks: Vec<u32>,
    /// For each sink, the stages that stream above it, behind the decode.
    pub changed_by: Vec<Vec<usize>>,
    /// For each sink, the first branch that it is on.
    pub branch_of: Vec<usize>,
    /// For each sink, whether it gets the order of the inputs.
    pub in_input_order: Vec<bool>,
    pub tagger: Tagger,
    /// True if the run needs tiles: for its stages, or to sort.
    pub mills: bool,
    /// Where points are; None for a stream that does not ask.
    pub lattice: Option<Lattice>,
    pub demands: Demands,
    /// What the user should know before the run.
    pub warnings: Vec<String>,
}

impl Task {
    /// The files of a sink, one for each input where it is a folder.
    pub fn files(&self, sink: usize) -> &[Box<dyn CreateSink>] {
        match self.each.get(sink) {
            Some(each) if !each.is_empty() => each,
            _ => &self.sinks[sink..=sink],
        }
    }
}
