//! Writing COPC 1.0: the points of LAZ in the chunks of an octree.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::hierarchy::{Hierarchy, NodeChunk, ROOT, extended};
use super::names::{HIERARCHY, INFO, INFO_AT, INFO_BYTES, POINT_FORMATS, TIME, USER};
use super::octree::{HELD_PIECES, LEAF_POINTS, Octree, RootCube, rank};
use super::overflow::Overflow;
use super::packing::{CopcEncoder, HELD_NODES, PackedNode, Packing};
use crate::geom::lattice::Lattice;
use crate::io::las::encode::{ComputedFields, LasEncoder};
use crate::io::las::format::format_of;
use crate::io::las::laz::{CHUNK_POINTS, Compression};
use crate::io::las::sink::{LasForm, LasOptions, LasSink, record_length};
use crate::io::las::vlr::{EVLR_HEAD, Vlr};
use crate::point::{Bounds, Dimension, Endian, Metadata, Scalar, Schema, Value, names};
use crate::stage::{ChunkSize, Encode, Encoded, Extent, Sink, SinkSummary};
use crate::{Error, Result};

/// Opens a COPC output at `staged` for records of `schema`, which are of point format 6, 7 or 8.
///
/// # Errors
///
/// As the sink of LAZ, and another point format.
pub fn create(
    staged: &Path,
    options: &LasOptions,
    schema: &Arc<Schema>,
    metadata: &Metadata,
) -> Result<Box<dyn Sink>> {
    let (encoder, laszip) = encoder(options, schema)?;
    let stride = encoder.packing.stride();
    let kept = encoder.records.computed.place_of(schema, names::KEEP_RANK);
    let info = Vlr::new(USER, INFO, "COPC info VLR", vec![0; INFO_BYTES]);
    let form = LasForm { encoder: encoder.records.clone(), laszip: Some(laszip), copc: Some(info) };
    let inner = LasSink::open(staged, schema, metadata, form)?;
    Ok(Box::new(CopcSink {
        inner,
        encoder: Arc::new(encoder),
        path: staged.to_owned(),
        stride,
        kept: kept.filter(|kept| kept.scalar == Scalar::U16),
        scale: schema.coordinates().map_or([1.0; 3], |axes| axes.map(|axis| axis.scale)),
        ground: None,
        hierarchy: Hierarchy::default(),
        times: [f64::INFINITY, f64::NEG_INFINITY],
    }))
}

/// The chunks of the sink that [`create`] would open.
pub fn chunk(options: &LasOptions, schema: &Schema) -> Result<ChunkSize> {
    let encoder = encoder(options, schema)?.0;
    Ok(ChunkSize { points: CHUNK_POINTS as usize, bytes: chunk_bytes(&encoder) })
}

/// Bytes that such a sink holds besides its chunks.
pub fn arranging_bytes(options: &LasOptions, schema: &Schema) -> Result<u64> {
    let stride = encoder(options, schema)?.0.packing.stride();
    Ok(((HELD_PIECES + HELD_NODES) * LEAF_POINTS * stride) as u64)
}

fn chunk_bytes(encoder: &CopcEncoder) -> u64 {
    encoder.records.chunk_bytes() + encoder.packing.bytes(LEAF_POINTS)
}

fn encoder(options: &LasOptions, schema: &Schema) -> Result<(CopcEncoder, Vlr)> {
    let format = format_of(schema).filter(|format| POINT_FORMATS.contains(format));
    let format = format.ok_or_else(|| Error::internal("COPC has point formats 6, 7 and 8"))?;
    let computed = ComputedFields::of(schema, &options.computed);
    let (how, laszip) = Compression::write_varying(format, record_length(schema, &computed)?)?;
    let records = Arc::new(LasEncoder::new(format, schema, computed, None));
    Ok((CopcEncoder { records, packing: Arc::new(Packing::new(how)) }, laszip))
}

/// Where points are, as the octree needs it.
struct Ground {
    lattice: Lattice,
    root: RootCube,
    octree: Octree,
}

/// A COPC file being written.
struct CopcSink {
    inner: LasSink,
    encoder: Arc<CopcEncoder>,
    path: PathBuf,
    stride: usize,
    /// The rank that a reduction gave a record, where it has one.
    kept: Option<Dimension>,
    /// World units of a stored one.
    scale: [f64; 3],
    ground: Option<Ground>,
    hierarchy: Hierarchy,
    /// The smallest and the largest GPS time.
    times: [f64; 2],
}

impl CopcSink {
    /// The box of all points as they are written: those of other formats are rounded to steps of
    /// the scale, half of one up or down.
    fn written(&self, extent: &Extent) -> Bounds {
        let mut bounds = extent.bounds;
        for axis in 0..3 {
            let half = self.scale[axis].abs() / extent.lattice.step / 2.0;
            // On a lattice of the scale's own steps nothing is rounded.
            let more = if half < 0.75 { 0 } else { half.ceil() as i64 };
            bounds.lo[axis] = bounds.lo[axis].saturating_sub(more);
            bounds.hi[axis] = bounds.hi[axis].saturating_add(more);
        }
        bounds
    }

    /// Writes the chunks that are done and next.
    fn write_packed(&mut self) -> Result<()> {
        while let Some(PackedNode { key, points, chunk }) = self.encoder.packing.take() {
            let too_long = || Error::pipeline("a node of the octree takes more than 2 GiB");
            let bytes = i32::try_from(chunk.len()).map_err(|_| too_long())?;
            let start = if points > 0 { self.inner.put_chunk(&chunk, points)? } else { 0 };
            self.hierarchy.add(key, NodeChunk { start, bytes, points: points as i32 });
        }
        Ok(())
    }

    /// The record that says where the octree is, and where its pages are.
    fn info(&self, pages: u64, first_page: u64) -> Vec<u8> {
        let (center, half, spacing) = match &self.ground {
            Some(Ground { lattice, root, .. }) => {
                let half = 1i64 << (root.exponent - 1);
                let center = lattice.world(root.corner.map(|at| at + half));
                (center, half as f64 * lattice.step, root.spacing() as f64 * lattice.step)
            }
            None => ([0.0; 3], 1.0, 1.0 / 64.0),
        };
        let times = if self.times[0] <= self.times[1] { self.times } else { [0.0; 2] };
        let [x, y, z] = center;
        let mut info = Vec::with_capacity(INFO_BYTES);
        info.extend([x, y, z, half, spacing].iter().flat_map(|v| v.to_le_bytes()));
        info.extend([pages, first_page].iter().flat_map(|v| v.to_le_bytes()));
        info.extend(times.iter().flat_map(|v| v.to_le_bytes()));
        info.resize(INFO_BYTES, 0);
        info
    }
}

impl Sink for CopcSink {
    fn chunk_points(&self) -> usize {
        CHUNK_POINTS as usize
    }

    fn chunk_bytes(&self) -> u64 {
        chunk_bytes(&self.encoder)
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        self.encoder.clone()
    }

    fn arrange(&mut self, extent: &Extent) -> Result<()> {
        if !extent.bounds.is_empty() {
            let root = RootCube::around(&self.written(extent));
            let overflow = Overflow::at(&self.path.with_extension("nodes"));
            let octree = Octree::new(root, self.stride, overflow);
            self.ground = Some(Ground { lattice: extent.lattice.clone(), root, octree });
        }
        Ok(())
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        if chunk.points == 0 {
            return Ok(());
        }
        self.inner.count(&chunk)?;
        let untold = || Error::internal("records came before it was told where they are");
        let ground = self.ground.as_mut().ok_or_else(untold)?;
        if chunk.places.len() as u64 != chunk.points {
            return Err(untold());
        }
        for (record, &place) in chunk.bytes.chunks_exact(self.stride).zip(&chunk.places) {
            if !ground.octree.takes(place) {
                return Err(misplaced(ground.lattice.world(place)));
            }
            let kept = self.kept.as_ref().map(|kept| kept.get(record, Endian::Little));
            let kept = match kept {
                Some(Value::Unsigned(kept)) => Some(kept as u16),
                _ => None,
            };
            ground.octree.push(place, rank(kept, place), record)?;
            if let Some(bytes) = record.get(TIME..).and_then(<[u8]>::first_chunk) {
                let time = f64::from_le_bytes(*bytes);
                self.times = [self.times[0].min(time), self.times[1].max(time)];
            }
        }
        for node in ground.octree.ripe() {
            self.encoder.packing.add(node)?;
        }
        self.encoder.records.spare.put(chunk.bytes);
        self.write_packed()
    }

    fn finish(mut self: Box<Self>) -> Result<SinkSummary> {
        match self.ground.as_mut() {
            Some(ground) if !ground.octree.is_empty() => {
                ground.octree.finish()?;
                for node in ground.octree.ripe() {
                    self.encoder.packing.add(node)?;
                    self.write_packed()?;
                }
            }
            _ => self.hierarchy.add(ROOT, NodeChunk { start: 0, bytes: 0, points: 0 }),
        }
        while self.encoder.packing.work()? {
            self.write_packed()?;
        }
        let start = self.inner.end_points()? + EVLR_HEAD as u64;
        let (pages, first_page) = self.hierarchy.pages(start);
        let info = self.info(start, first_page);
        self.inner.rewrite(INFO_AT, &info)?;
        self.inner.close(&[extended(USER, HIERARCHY, "EPT Hierarchy", &pages)])
    }
}

/// The error of a point that is not where the scan had it.
fn misplaced([x, y, z]: [f64; 3]) -> Error {
    let told = format!(
        "stages moved the point that is at ({x}, {y}, {z}) out of its place in the octree, which \
         has points where the scan had them"
    );
    Error::pipeline(told).help("write LAZ, and convert that to COPC")
}
