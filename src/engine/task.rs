//! What the engine runs: a pipeline whose stages fit each other, its inputs and the memory.
//!
//! It is made by the plan and says everything that a run depends on, so the engine asks neither the
//! pipeline's text nor its graph. A run changes none of it. The tile stages are not in it, since
//! they settle by what they see of the scan: those the run takes for itself.

use std::ops::RangeInclusive;
use std::sync::{Arc, OnceLock};

use super::beside::Beside;
use super::pass::{Branch, Pass, StreamOp};
use super::provenance::Provenance;
use super::shares::{Demands, Shares};
use super::tagger::Tagger;
use crate::geom::lattice::Lattice;
use crate::geom::simd::Simd;
use crate::graph::{Nonfinite, RunSettings, RunTraits, SpillSetting};
use crate::point::{ComputedDimension, Metadata, Schema, names};
use crate::report::AcceptTable;
use crate::stage::{CreateSink, OutputSplit, Source, Triangulation};

/// The schemas of records on their way through the stages that stream in the decode.
pub(crate) struct Schemas {
    /// For each stage, that of the records that it leaves.
    pub left_by: Vec<Arc<Schema>>,
    /// That of all records behind the decode.
    pub last: Arc<Schema>,
}

/// The lengths of a stage that were given in a unit of their own: key and text.
pub(crate) type GivenLengths = Vec<(&'static str, String)>;

/// What the outputs of a run may take, which is known when they are there.
pub(crate) struct WantedSize {
    /// Bytes of all files.
    pub bytes: RangeInclusive<u64>,
    /// Records and bytes of outputs that took others, and were not given their names.
    pub unfit: OnceLock<(u64, u64)>,
}

/// A run that can begin.
pub(crate) struct Task {
    pub settings: RunSettings,
    /// What the result must be to be accepted, in the unit of the scan.
    pub accept: AcceptTable,
    pub traits: RunTraits,
    pub threads: usize,
    pub simd: Simd,
    pub source: Box<dyn Source>,
    pub source_kind: String,
    pub transforms: Vec<StreamOp>,
    /// The schemas of the records that each of these gets, and last of those that they leave.
    pub schemas: Schemas,
    /// Stages that stream behind the decode.
    pub filters: Vec<StreamOp>,
    pub passes: Vec<Pass>,
    pub branches: Vec<Branch>,
    pub sinks: Vec<Box<dyn CreateSink>>,
    /// For each sink, those of the inputs if it is a folder; else none.
    pub each: Vec<Vec<Box<dyn CreateSink>>>,
    /// For each tile stage, the lengths that were converted to the unit of the scan.
    pub given: Vec<GivenLengths>,
    /// For each sink, into which files it is split.
    pub splits: Vec<Option<OutputSplit>>,
    /// For each sink, how its points are connected, if they are.
    pub meshes: Vec<Option<Triangulation>>,
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
    /// For each sink, the computed dimensions that it writes.
    pub computed: Vec<Vec<ComputedDimension>>,
    pub tagger: Tagger,
    /// True if the run needs tiles: for its stages, or to sort.
    pub mills: bool,
    /// Where points are; None for a stream that does not ask.
    pub lattice: Option<Lattice>,
    pub demands: Demands,
    /// What outputs say of the run.
    pub provenance: Provenance,
    /// What the user should know before the run.
    pub warnings: Vec<String>,
    /// None where outputs of any size are right.
    pub wanted: Option<WantedSize>,
}

impl Task {
    /// What every record holds behind the decode.
    pub fn schema(&self) -> &Arc<Schema> {
        &self.schemas.last
    }

    /// What an input says, for its own output or for that of all.
    pub fn said(&self, metadata: Metadata) -> Metadata {
        // Stages may move points and leave the form of their records as it is.
        let moved = *self.schemas.last != **self.source.schema()
            || self.transforms.iter().any(|stage| stage.moves());
        Metadata { moved: moved || metadata.moved, ..metadata }
    }

    /// What the source says, for a sink whose records go through the stages `pipeline`.
    pub fn metadata(&self, sink: usize, pipeline: Option<Arc<str>>) -> Metadata {
        let computed = self.computed[sink].clone();
        Metadata { pipeline, computed, ..self.said(self.source.metadata().clone()) }
    }

    /// The files of a sink, one for each input where it is a folder.
    pub fn files(&self, sink: usize) -> &[Box<dyn CreateSink>] {
        match self.each.get(sink) {
            Some(each) if !each.is_empty() => each,
            _ => &self.sinks[sink..=sink],
        }
    }

    /// True if a sink is split.
    pub fn is_split(&self, sink: usize) -> bool {
        self.splits[sink].is_some()
    }

    /// The stages on the branch of a sink, as outputs name them.
    pub fn pipeline(&self, sink: usize) -> Arc<str> {
        self.branches[self.branch_of[sink]].stages.to_string().into()
    }

    /// True if points without a place because a coordinate is no number are removed.
    pub fn drops_nonfinite(&self) -> bool {
        self.settings.nonfinite == Nonfinite::Drop
    }

    /// Positions of a tile, if they are given.
    pub fn tile_points(&self) -> Option<usize> {
        self.settings.tile_points.map(usize::from)
    }

    /// Bytes of points that stay in memory.
    pub fn kept_in_memory(&self, shares: &Shares) -> u64 {
        match self.settings.spill {
            SpillSetting::Auto => shares.kept_in_memory,
            SpillSetting::Always => 0,
        }
    }

    /// The dimensions that nobody looks at: no sink, and neither what counts classes and tells
    /// records apart by class and flags. What a transform looks at is not known for sure.
    pub fn unread(&self) -> Vec<String> {
        const LOOKED_AT: [&str; 5] = [
            names::CLASSIFICATION,
            names::SYNTHETIC,
            names::KEY_POINT,
            names::WITHHELD,
            names::OVERLAP,
        ];
        let Some((first, others)) = self.sinks.split_first() else { return Vec::new() };
        let by_all = |name: &&String| others.iter().all(|sink| sink.unread().contains(*name));
        let mut unread: Vec<String> = first.unread().iter().filter(by_all).cloned().collect();
        let columns = || self.passes.iter().flat_map(|pass| &pass.dimensions);
        let is_column = |name: &str| columns().any(|column| column.name() == name);
        let is_read = |name: &str| self.streams() || LOOKED_AT.contains(&name) || is_column(name);
        unread.retain(|name| !is_read(name));
        unread
    }

    /// True if it has stages that stream.
    pub fn streams(&self) -> bool {
        !self.transforms.is_empty() || !self.filters.is_empty()
    }
}
