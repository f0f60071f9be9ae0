//! Writes binary STL: triangles with their normals and corners.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::CHUNK_POINTS;
use crate::point::PointBatch;
use crate::report::{Grouped, Short};
use crate::stage::{ChunkSize, Encode, EncodeTriangles, Encoded, Sink, SinkSummary, Triangle};
use crate::{Error, Result};

/// Bytes of the header, whose text must not begin with "solid", and of the count behind it.
const HEADER: usize = 80;
/// Bytes of a triangle: four vectors of 32-bit floats and 16 bits that mean nothing.
const TRIANGLE: usize = 4 * 3 * 4 + 2;

/// What is taken off places, and by how much 32-bit floats may then move them on an axis.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SinglePlaces {
    pub offset: [f64; 3],
    pub most: f64,
}

impl SinglePlaces {
    /// By how much a place is moved.
    ///
    /// # Errors
    ///
    /// If that is too much.
    pub fn rounding(&self, place: [f64; 3]) -> Result<f64> {
        let axis = |axis: usize| {
            let exact = place[axis] - self.offset[axis];
            (f64::from(exact as f32) - exact).abs()
        };
        let by = axis(0).max(axis(1)).max(axis(2));
        if by <= self.most {
            return Ok(by);
        }
        let round = place.map(|v| (v / 1000.0).floor() * 1000.0);
        let told = format!(
            "STL holds places as 32-bit floats, which would move the point at {place:?} by {}",
            Short(by)
        );
        let help = format!("take something off all places: `mesh.offset = {round:?}`");
        Err(Error::pipeline(told).help(help))
    }
}

/// An STL file that grows.
pub(crate) struct StlSink {
    file: File,
    path: PathBuf,
    places: SinglePlaces,
    points: u64,
    triangles: u64,
    rounded: f64,
}

impl StlSink {
    /// Chunks of such a file: nothing is written of points.
    pub const CHUNK: ChunkSize = ChunkSize { points: CHUNK_POINTS, bytes: 0 };

    /// Creates the file at `staged`, with such places.
    ///
    /// # Errors
    ///
    /// A file that the system refuses to create or to write.
    pub fn create(staged: &Path, places: SinglePlaces) -> Result<StlSink> {
        let mut header = [b' '; HEADER + size_of::<u32>()];
        let made = b"made by pointmill";
        header[..made.len()].copy_from_slice(made);
        let mut file = File::create(staged).map_err(|e| Error::io(staged, "create", e))?;
        file.write_all(&header).map_err(|e| Error::io(staged, "write the header", e))?;
        let path = staged.to_owned();
        Ok(StlSink { file, path, places, points: 0, triangles: 0, rounded: 0.0 })
    }
}

impl Sink for StlSink {
    fn chunk_points(&self) -> usize {
        CHUNK_POINTS
    }

    fn chunk_bytes(&self) -> u64 {
        StlSink::CHUNK.bytes
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        Arc::new(NoVertices)
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        self.file.write_all(&chunk.bytes).map_err(|e| Error::io(&self.path, "write", e))?;
        self.points += chunk.points;
        self.triangles += chunk.triangles;
        self.rounded = self.rounded.max(chunk.rounded.map_or(0.0, |(_, by)| by));
        Ok(())
    }

    fn triangles(&mut self) -> Result<Arc<dyn EncodeTriangles>> {
        Ok(Arc::new(FacetEncoder(self.places)))
    }

    fn finish(mut self: Box<Self>) -> Result<SinkSummary> {
        let count = u32::try_from(self.triangles).map_err(|_| {
            let (triangles, most) = (Grouped(self.triangles), Grouped(u64::from(u32::MAX)));
            let told = format!("an STL file has up to {most} triangles, and these are {triangles}");
            Error::pipeline(told).help("reduce the points further, or write PLY")
        })?;
        let failed = |e| Error::io(&self.path, "write the header", e);
        self.file.seek(SeekFrom::Start(HEADER as u64)).map_err(failed)?;
        self.file.write_all(&count.to_le_bytes()).map_err(failed)?;
        self.file.sync_all().map_err(|e| Error::io(&self.path, "flush", e))?;
        let bytes = (HEADER + size_of::<u32>()) as u64 + self.triangles * TRIANGLE as u64;
        let mut summary = SinkSummary::new(self.points, bytes);
        if self.rounded > 0.0 {
            let by = Short(self.rounded);
            summary.notes.push(format!("places were rounded to 32-bit floats, by at most {by}"));
        }
        Ok(summary)
    }
}

/// Counts points.
struct NoVertices;

impl Encode for NoVertices {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        Ok(Encoded::new(Vec::new(), batch.len() as u64))
    }
}

struct FacetEncoder(SinglePlaces);

impl EncodeTriangles for FacetEncoder {
    fn encode(&self, triangles: &[Triangle]) -> Result<Encoded> {
        let mut bytes = Vec::with_capacity(triangles.len() * TRIANGLE);
        let mut rounded = 0f64;
        for Triangle { places, .. } in triangles {
            let [a, b, c] = places.map(|place| [0, 1, 2].map(|n| place[n] - self.0.offset[n]));
            let across = normal(a, b, c);
            for vector in [across, a, b, c] {
                vector.into_iter().for_each(|v| bytes.extend((v as f32).to_le_bytes()));
            }
            bytes.extend([0; 2]);
            for place in places {
                rounded = rounded.max(self.0.rounding(*place)?);
            }
        }
        let (rounded, triangles) = (Some((0, rounded)), triangles.len() as u64);
        Ok(Encoded { bytes, triangles, rounded, ..Encoded::default() })
    }
}

/// The unit normal of a triangle, by the right hand.
fn normal(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> [f64; 3] {
    let to = |p: [f64; 3]| [p[0] - a[0], p[1] - a[1], p[2] - a[2]];
    let (u, v) = (to(b), to(c));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    n.map(|v| if length > 0.0 { v / length } else { 0.0 })
}
