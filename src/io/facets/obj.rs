//! Writes OBJ: a line for each vertex, then one for each triangle.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::CHUNK_POINTS;
use crate::point::PointBatch;
use crate::stage::{ChunkSize, Encode, EncodeTriangles, Encoded, Sink, SinkSummary, Triangle};
use crate::{Error, Result};

/// Bytes of the longest line of a vertex.
const LINE: usize = 3 * 26 + 3;

/// An OBJ file that grows.
pub(crate) struct ObjSink {
    file: File,
    path: PathBuf,
    /// What is taken off each place.
    offset: [f64; 3],
    points: u64,
    bytes: u64,
}

impl ObjSink {
    /// Chunks of such a file.
    pub const CHUNK: ChunkSize =
        ChunkSize { points: CHUNK_POINTS, bytes: (CHUNK_POINTS * LINE) as u64 };

    /// Creates the file at `staged`, whose places are less `offset`, and of which `comments` say
    /// something.
    ///
    /// # Errors
    ///
    /// A file that the system refuses to create or to write.
    pub fn create(staged: &Path, offset: [f64; 3], comments: &[String]) -> Result<ObjSink> {
        let mut text = "# made by pointmill\n".to_owned();
        for comment in comments {
            text += &format!("# {}\n", comment.replace(['\n', '\r'], " "));
        }
        let mut file = File::create(staged).map_err(|e| Error::io(staged, "create", e))?;
        let failed = |e| Error::io(staged, "write its first lines", e);
        file.write_all(text.as_bytes()).map_err(failed)?;
        let (path, bytes) = (staged.to_owned(), text.len() as u64);
        Ok(ObjSink { file, path, offset, points: 0, bytes })
    }
}

impl Sink for ObjSink {
    fn chunk_points(&self) -> usize {
        CHUNK_POINTS
    }

    fn chunk_bytes(&self) -> u64 {
        ObjSink::CHUNK.bytes
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        Arc::new(VertexLines { offset: self.offset })
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        self.file.write_all(&chunk.bytes).map_err(|e| Error::io(&self.path, "write", e))?;
        self.points += chunk.points;
        self.bytes += chunk.bytes.len() as u64;
        Ok(())
    }

    fn triangles(&mut self) -> Result<Arc<dyn EncodeTriangles>> {
        Ok(Arc::new(FaceLines))
    }

    fn finish(self: Box<Self>) -> Result<SinkSummary> {
        self.file.sync_all().map_err(|e| Error::io(&self.path, "flush", e))?;
        Ok(SinkSummary::new(self.points, self.bytes))
    }
}

/// Prints places, each number as the shortest text that reads back equal, or with nine decimals
/// where something is taken off it: a difference has the noise of binary fractions.
struct VertexLines {
    offset: [f64; 3],
}

impl VertexLines {
    fn shown(&self, place: [f64; 3], axis: usize) -> String {
        let (v, offset) = (place[axis], self.offset[axis]);
        if offset == 0.0 {
            return v.to_string();
        }
        let text = format!("{:.9}", v - offset);
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    }
}

impl Encode for VertexLines {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let schema = batch.schema();
        let missing = || Error::internal("records without coordinates came to a mesh");
        let axes = schema.coordinates().ok_or_else(missing)?;
        let mut bytes = Vec::with_capacity(batch.len() * LINE);
        for record in batch.iter() {
            let place = axes.map(|axis| axis.world(record, schema.endian));
            let [x, y, z] = [0, 1, 2].map(|axis| self.shown(place, axis));
            let failed = |e| Error::internal("a number has no text").because(e);
            writeln!(bytes, "v {x} {y} {z}").map_err(failed)?;
        }
        Ok(Encoded::new(bytes, batch.len() as u64))
    }
}

/// Prints triangles by the numbers of their corners, which OBJ counts from 1.
struct FaceLines;

impl EncodeTriangles for FaceLines {
    fn encode(&self, triangles: &[Triangle]) -> Result<Encoded> {
        let mut bytes = Vec::new();
        for triangle in triangles {
            let [a, b, c] = triangle.corners.map(|number| number + 1);
            let failed = |e| Error::internal("a number has no text").because(e);
            writeln!(bytes, "f {a} {b} {c}").map_err(failed)?;
        }
        Ok(Encoded { bytes, triangles: triangles.len() as u64, ..Encoded::default() })
    }
}
