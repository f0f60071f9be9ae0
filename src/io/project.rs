//! A sink of one record layout behind records of another.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::convert::{Projection, TYPES};
use crate::point::{PointBatch, Schema, Spare};
use crate::report::{Grouped, Short};
use crate::stage::{ChunkSize, Encode, Encoded, Extent, Sink, SinkSummary};
use crate::{Error, Result};

/// Projects every record before `inner` takes it, and tells at the end what that rounded.
pub struct Projected {
    inner: Box<dyn Sink>,
    encoder: Arc<ProjectingEncoder>,
    rounded: (u64, f64),
    /// What values are rounded to.
    rounded_to: &'static str,
}

struct ProjectingEncoder {
    path: PathBuf,
    projection: Projection,
    to: Arc<Schema>,
    inner: Arc<dyn Encode>,
    spare: Spare<PointBatch>,
}

impl Projected {
    /// Records go through `projection` and, as records of `to`, into `inner`.
    /// `path` is the output's, to be named where a value does not fit.
    pub fn new(inner: Box<dyn Sink>, projection: Projection, to: Arc<Schema>, path: &Path) -> Self {
        let path = path.to_owned();
        let rounded_to = projection.rounded_to();
        let (spare, inner_encoder) = (Spare::default(), inner.encoder());
        let encoder = ProjectingEncoder { path, projection, to, inner: inner_encoder, spare };
        Projected { inner, encoder: Arc::new(encoder), rounded: (0, 0.0), rounded_to }
    }

    /// The chunks of such a sink around one of the chunks `inner`, which takes records of `to`.
    pub fn chunk(inner: ChunkSize, to: &Schema) -> ChunkSize {
        // The projected records, and those that are spare.
        ChunkSize { bytes: inner.bytes + 2 * (inner.points * to.stride) as u64, ..inner }
    }
}

impl Encode for ProjectingEncoder {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let make = || PointBatch::new(self.to.clone(), batch.len());
        let mut projected = self.spare.take(make);
        if projected.capacity() < batch.len() {
            projected = make();
        }
        let records = projected.refill(batch.len());
        let rounding = self.projection.project_into(batch.records(), records);
        let rounding = rounding.map_err(|error| error.at(&self.path))?;
        projected.columns.clone_from(&batch.columns);
        let mut encoded = self.inner.encode(&projected)?;
        encoded.rounded = Some((rounding.points, rounding.largest));
        self.spare.put(projected);
        Ok(encoded)
    }
}

impl Sink for Projected {
    fn chunk_points(&self) -> usize {
        self.inner.chunk_points()
    }

    fn chunk_bytes(&self) -> u64 {
        let (points, bytes) = (self.inner.chunk_points(), self.inner.chunk_bytes());
        Projected::chunk(ChunkSize { points, bytes }, &self.encoder.to).bytes
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        self.encoder.clone()
    }

    fn arrange(&mut self, extent: &Extent) -> Result<()> {
        self.inner.arrange(extent)
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        let (points, largest) = chunk.rounded.ok_or_else(|| {
            Error::internal("a chunk came to a projecting sink from another encoder")
        })?;
        self.rounded = (self.rounded.0 + points, self.rounded.1.max(largest));
        self.inner.append(chunk)
    }

    fn finish(self: Box<Self>) -> Result<SinkSummary> {
        let mut summary = self.inner.finish()?;
        summary.notes.extend(rounded(self.rounded, self.rounded_to));
        Ok(summary)
    }
}

/// Tells of so many points that values were rounded `to` something, by so much at most.
pub(super) fn rounded((points, largest): (u64, f64), to: &str) -> Option<String> {
    let of = if to.starts_with(TYPES) { "values" } else { "the coordinates" };
    let points = match points {
        0 => return None,
        1 => "1 point".to_owned(),
        _ => format!("{} points", Grouped(points)),
    };
    Some(format!("{of} of {points} were rounded to {to}, by at most {}", Short(largest)))
}
