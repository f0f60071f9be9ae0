//! Scans are looked at as they stream by: what a stretch of records comes to is found by all
//! threads, and taken in the order of the records.

use std::path::Path;
use std::sync::Arc;

use crate::Result;
use crate::engine::Watch;
use crate::graph::{Graph, Overrides, RunSettings};
use crate::point::{Metadata, PointBatch, Schema};
use crate::stage::{
    ChunkSize, CreateSink, Encode, Encoded, OpenSource, Order, Role, Sink, SinkSummary,
};

/// Records that are looked at together.
const STRETCH: usize = 8192;

/// Looks at the records of a scan.
pub trait RecordLook: Send + Sync {
    /// Writes down what a stretch of records comes to; called by several threads at once.
    fn look(&self, batch: &PointBatch, found: &mut Vec<u8>) -> Result<()>;

    /// Takes what a stretch came to: all stretches in their order, one at a time.
    fn take(&self, found: &[u8]) -> Result<()>;
}

/// Has all records of a scan looked at.
pub fn look_at(
    open: Box<dyn OpenSource>,
    look: Arc<dyn RecordLook>,
    run: &RunSettings,
    watch: &dyn Watch,
) -> Result<()> {
    let mut graph = Graph::new(run.clone());
    let source = graph.add("read", Role::Source(open), &[]);
    graph.add("compare", Role::Sink(Box::new(LookedAt(look))), &[source]);
    graph.plan(&Overrides::default())?.run(watch)?;
    Ok(())
}

/// The end of a pipeline whose records are looked at.
struct LookedAt(Arc<dyn RecordLook>);

impl LookedAt {
    /// Of records of `stride` bytes: what a look comes to has no more than these, a key, a place
    /// and a few numbers for each.
    fn stretch(stride: usize) -> ChunkSize {
        ChunkSize { points: STRETCH, bytes: (STRETCH * (stride + 64)) as u64 }
    }
}

impl CreateSink for LookedAt {
    fn path(&self) -> &Path {
        Path::new("compare")
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

    fn chunk(&self, schema: &Arc<Schema>, _: &Metadata) -> Result<ChunkSize> {
        Ok(LookedAt::stretch(schema.stride))
    }

    fn create(
        &self,
        _: &Path,
        schema: &Arc<Schema>,
        _: &Metadata,
        _: bool,
    ) -> Result<Box<dyn Sink>> {
        let chunk = LookedAt::stretch(schema.stride);
        Ok(Box::new(LookSink { look: self.0.clone(), chunk, points: 0 }))
    }
}

/// Hands on what stretches come to.
struct LookSink {
    look: Arc<dyn RecordLook>,
    chunk: ChunkSize,
    points: u64,
}

impl Sink for LookSink {
    fn chunk_points(&self) -> usize {
        self.chunk.points
    }

    fn chunk_bytes(&self) -> u64 {
        self.chunk.bytes
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        Arc::new(LookEncode(self.look.clone()))
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        self.points += chunk.points;
        self.look.take(&chunk.bytes)
    }

    fn finish(self: Box<Self>) -> Result<SinkSummary> {
        Ok(SinkSummary::new(self.points, 0))
    }
}

/// Looks at stretches.
struct LookEncode(Arc<dyn RecordLook>);

impl Encode for LookEncode {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let mut found = Vec::new();
        self.0.look(batch, &mut found)?;
        Ok(Encoded::new(found, batch.len() as u64))
    }
}
