//! Records of several files read as one, back in the form that one of them has.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::native::Native;
use super::read::Shift;
use crate::io::steps::whole_steps;
use crate::point::{Metadata, PointBatch, Schema, names};
use crate::stage::{ChunkSize, Encode, Encoded, Extent, Sink, SinkSummary};
use crate::{Error, Result};

/// The form that records of `schema` have in the file that `metadata` is of: where its offset is
/// another, its schema and how far stored coordinates move to it. None if they are in it already,
/// come from no LAS file, or were moved by stages.
///
/// # Errors
///
/// An offset that is not whole steps away: the file was not among those read together.
pub fn own_form(schema: &Schema, metadata: &Metadata) -> Result<Option<(Arc<Schema>, Shift)>> {
    let native = metadata.native.as_ref().and_then(|native| native.downcast_ref::<Native>());
    let Some(native) = native.filter(|native| native.fits(schema) && !metadata.moved) else {
        return Ok(None);
    };
    let (mut own, mut shift) = (schema.clone(), Shift::default());
    let offset = native.header.offset();
    for (axis, name) in names::XYZ.into_iter().enumerate() {
        let Some(dimension) = own.dimensions.iter_mut().find(|d| d.name == name) else { continue };
        let steps = whole_steps(offset[axis], dimension.origin, dimension.scale);
        shift.0[axis] = steps.ok_or_else(|| {
            Error::internal(format!(
                "offsets {} and {} were read together and are not whole steps apart",
                offset[axis], dimension.origin
            ))
        })?;
        dimension.origin = offset[axis];
    }
    Ok((own != *schema).then(|| (Arc::new(own), shift)))
}

/// A sink of one file's records behind records of several: moves the stored coordinates of each
/// back by whole steps, so that it is the input's byte for byte.
pub struct Shifted {
    inner: Box<dyn Sink>,
    encoder: Arc<ShiftingEncoder>,
}

struct ShiftingEncoder {
    /// For errors.
    path: PathBuf,
    shift: Shift,
    to: Arc<Schema>,
    inner: Arc<dyn Encode>,
}

impl Shifted {
    /// Records move by `shift` and go, as records of `to`, into `inner`, which writes `path`.
    pub fn new(path: &Path, inner: Box<dyn Sink>, (to, shift): (Arc<Schema>, Shift)) -> Self {
        let path = path.to_owned();
        let encoder = ShiftingEncoder { path, shift, to, inner: inner.encoder() };
        Shifted { inner, encoder: Arc::new(encoder) }
    }
}

impl ShiftingEncoder {
    /// Names the first of `records` that cannot move.
    fn overflow(&self, batch: &PointBatch) -> Error {
        let lost = batch.iter().find(|r| !self.shift.apply(&mut r.to_vec(), self.to.stride));
        let stored = lost.and_then(<[u8]>::first_chunk::<12>).map(|record| {
            record.as_chunks::<4>().0.iter().map(|b| i32::from_le_bytes(*b)).collect::<Vec<_>>()
        });
        Error::data(
            &self.path,
            format!(
                "the record of stored coordinates {:?} cannot move by {:?} steps to the offset of \
                 its input: it is none of its records",
                stored.unwrap_or_default(),
                self.shift.0
            ),
        )
    }
}

impl Encode for ShiftingEncoder {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let mut own = PointBatch::new(self.to.clone(), batch.len());
        own.extend(batch.records());
        own.source = batch.source;
        own.columns.clone_from(&batch.columns);
        if !self.shift.apply(own.records_mut(), self.to.stride) {
            return Err(self.overflow(batch));
        }
        self.inner.encode(&own)
    }
}

impl Sink for Shifted {
    fn chunk_points(&self) -> usize {
        self.inner.chunk_points()
    }

    fn chunk_bytes(&self) -> u64 {
        let (points, bytes) = (self.inner.chunk_points(), self.inner.chunk_bytes());
        ChunkSize { points, bytes }.and_records(self.encoder.to.stride).bytes
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        self.encoder.clone()
    }

    fn arrange(&mut self, extent: &Extent) -> Result<()> {
        self.inner.arrange(extent)
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        self.inner.append(chunk)
    }

    fn finish(self: Box<Self>) -> Result<SinkSummary> {
        self.inner.finish()
    }
}
