//! A sink that is told of every record where it is on the lattice of the run: of the record as the
//! run has it, before another scale rounds its coordinates or it takes the form that it has in a
//! file of its own. By these positions the records come in order.

use std::sync::{Arc, OnceLock};

use crate::geom::lattice::Lattice;
use crate::point::{PointBatch, Position};
use crate::stage::{ChunkSize, Encode, Encoded, Extent, Sink, SinkSummary};
use crate::{Error, Result};

/// Adds positions to the chunks of `inner`.
pub struct PlacedSink {
    inner: Box<dyn Sink>,
    encoder: Arc<PlacingEncoder>,
}

struct PlacingEncoder {
    inner: Arc<dyn Encode>,
    lattice: OnceLock<Lattice>,
}

impl PlacedSink {
    /// Around `inner`, which takes the same records.
    pub fn new(inner: Box<dyn Sink>) -> Self {
        let encoder = PlacingEncoder { inner: inner.encoder(), lattice: OnceLock::new() };
        PlacedSink { inner, encoder: Arc::new(encoder) }
    }

    /// The chunks of such a sink around one of the chunks `inner`.
    pub fn chunk(inner: ChunkSize) -> ChunkSize {
        inner.and_records(size_of::<Position>())
    }
}

impl Encode for PlacingEncoder {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let untold = || Error::internal("records came before it was told where they are");
        let lattice = self.lattice.get().ok_or_else(untold)?;
        let mut places = Vec::with_capacity(batch.len());
        let mut lost = 0;
        let place = |_: usize, position| places.push(position);
        lattice.place(batch.schema(), batch.records(), place, |_, _| lost += 1);
        if lost > 0 {
            return Err(Error::pipeline(format!(
                "stages moved {lost} points to where there is none"
            ))
            .help("write LAZ, and convert that to COPC"));
        }
        Ok(Encoded { places, ..self.inner.encode(batch)? })
    }
}

impl Sink for PlacedSink {
    fn chunk_points(&self) -> usize {
        self.inner.chunk_points()
    }

    fn chunk_bytes(&self) -> u64 {
        let (points, bytes) = (self.inner.chunk_points(), self.inner.chunk_bytes());
        PlacedSink::chunk(ChunkSize { points, bytes }).bytes
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        self.encoder.clone()
    }

    fn arrange(&mut self, extent: &Extent) -> Result<()> {
        // Told once; who tells again has the same lattice.
        self.encoder.lattice.get_or_init(|| extent.lattice.clone());
        self.inner.arrange(extent)
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        self.inner.append(chunk)
    }

    fn finish(self: Box<Self>) -> Result<SinkSummary> {
        self.inner.finish()
    }
}
