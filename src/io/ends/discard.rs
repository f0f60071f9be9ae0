//! The end of pipelines that write nothing.

use std::path::Path;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::point::{Metadata, PointBatch, Schema};
use crate::stage::{
    ChunkSize, CreateSink, Encode, Encoded, Order, Role, RoleName, Sink, SinkSummary, StageKind,
    StagePlace,
};

/// Ends a pipeline or a branch of which nothing is to be written: its points are counted, and what
/// is wanted stands in the report, such as what `stats` found.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Discard {}

impl StageKind for Discard {
    const KIND: &'static str = "discard";
    const ROLE: RoleName = RoleName::Sink;
    const ABOUT: &'static str = "Ends a pipeline that writes nothing.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::Sink(Box::new(self)))
    }
}

/// Records that are counted at once.
const CHUNK: usize = 8192;

impl CreateSink for Discard {
    fn path(&self) -> &Path {
        Path::new("discard")
    }

    fn is_file(&self) -> bool {
        false
    }

    fn order(&self) -> Order {
        Order::Auto
    }

    fn carries(&self, _: &Schema) -> bool {
        true
    }

    fn chunk(&self, _: &Arc<Schema>, _: &Metadata) -> Result<ChunkSize> {
        Ok(ChunkSize { points: CHUNK, bytes: 0 })
    }

    fn create(&self, _: &Path, _: &Arc<Schema>, _: &Metadata, _: bool) -> Result<Box<dyn Sink>> {
        Ok(Box::new(CountedSink::new(ChunkSize { points: CHUNK, bytes: 0 })))
    }
}

/// Counts records and writes nothing.
pub(crate) struct CountedSink {
    chunk: ChunkSize,
    points: u64,
}

impl CountedSink {
    /// For records in chunks of this size.
    pub(crate) fn new(chunk: ChunkSize) -> Self {
        CountedSink { chunk, points: 0 }
    }
}

impl Sink for CountedSink {
    fn chunk_points(&self) -> usize {
        self.chunk.points
    }

    fn chunk_bytes(&self) -> u64 {
        self.chunk.bytes
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        Arc::new(NothingEncoded)
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        self.points += chunk.points;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<SinkSummary> {
        Ok(SinkSummary::new(self.points, 0))
    }
}

/// Encodes records as nothing.
struct NothingEncoded;

impl Encode for NothingEncoded {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        Ok(Encoded::new(Vec::new(), batch.len() as u64))
    }
}
