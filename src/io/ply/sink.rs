//! Writes vertices to a PLY file.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::header::Encoding;
use super::headings::Headings;
use super::source::Native;
use super::{PlyOptions, text};
use crate::io::convert::{Projection, ply_schema};
use crate::point::names::NORMAL;
use crate::point::{Dimension, Layout, Metadata, PointBatch, Scalar, Schema, Spare, Value};
use crate::stage::{ChunkSize, Encode, Encoded, Sink, SinkSummary};
use crate::{Error, Result};

/// Records of one encoded chunk.
const CHUNK_POINTS: usize = 65_536;
/// Bytes carried at once.
const CARRY: usize = 1 << 18;

/// Writes a PLY file; the header has its final length from the beginning.
pub(super) struct PlySink {
    file: File,
    path: PathBuf,
    plan: Arc<Plan>,
    header: Headings,
    rest: Option<Arc<Native>>,
    notes: Vec<String>,
    points: u64,
    bytes: u64,
}

/// How a record becomes a vertex; shared by all threads.
struct Plan {
    encoding: Encoding,
    /// What a vertex holds; text is printed from its little-endian form.
    vertex: Schema,
    /// From the records to the vertices, where they differ.
    projection: Option<Projection>,
    /// The normals' fields, if they are written.
    normals: Option<[Dimension; 3]>,
    /// For the vertices of chunks; whoever has written them puts them back.
    spare: Spare<Vec<u8>>,
}

impl PlySink {
    pub fn create(
        staged: &Path,
        options: &PlyOptions,
        schema: &Schema,
        metadata: &Metadata,
    ) -> Result<PlySink> {
        let native = native_of(schema, metadata);
        let plan = Plan::new(options, schema, native.as_deref())?;
        let (rest, notes) = carried(options, &plan, native.as_ref());
        let header =
            Headings::of(&plan.vertex, plan.encoding, metadata, native.as_deref(), rest.as_deref());
        let mut file = File::create(staged).map_err(|e| Error::io(staged, "create", e))?;
        let text = header.text(0);
        let failed = |e| Error::io(staged, "write the header", e);
        file.write_all(text.as_bytes()).map_err(failed)?;
        let mut sink = PlySink {
            file,
            path: staged.to_owned(),
            plan: Arc::new(plan),
            header,
            rest,
            notes,
            points: 0,
            bytes: text.len() as u64,
        };
        if let Some(rest) = sink.carries() {
            sink.carry(&rest, 0)?;
        }
        Ok(sink)
    }

    /// The chunks of the sink that `create` would open.
    pub fn chunk(options: &PlyOptions, schema: &Schema, metadata: &Metadata) -> Result<ChunkSize> {
        let native = native_of(schema, metadata);
        Ok(Plan::new(options, schema, native.as_deref())?.chunk())
    }

    fn carries(&self) -> Option<Arc<Native>> {
        self.rest.clone().filter(|native| native.rest.is_some())
    }

    /// Copies the elements before (0) or behind (1) the vertices of the input.
    fn carry(&mut self, native: &Native, which: usize) -> Result<()> {
        let Some(rest) = &native.rest else { return Ok(()) };
        let (mut at, end) = (rest.cuts[2 * which], rest.cuts[2 * which + 1]);
        let from = rest.origin.reopen()?;
        let mut buffer = vec![0; CARRY];
        while at < end {
            let piece = &mut buffer[..(end - at).min(CARRY as u64) as usize];
            from.read_exact_at(piece, at).map_err(|e| {
                Error::io(rest.origin.path(), "read its other elements", e).at_byte(at)
            })?;
            self.file
                .write_all(piece)
                .map_err(|e| Error::io(&self.path, "write the other elements", e))?;
            at += piece.len() as u64;
            self.bytes += piece.len() as u64;
        }
        rest.origin.unchanged()
    }
}

/// What PLY inputs of such records say of themselves.
fn native_of(schema: &Schema, metadata: &Metadata) -> Option<Arc<Native>> {
    let native = metadata.native.clone().filter(|_| schema.layout == Layout::Ply)?;
    native.downcast::<Native>().ok()
}

/// The input's other elements, if they can be carried, or a note that they are not.
fn carried(
    options: &PlyOptions,
    plan: &Plan,
    native: Option<&Arc<Native>>,
) -> (Option<Arc<Native>>, Vec<String>) {
    let Some(native) = native.filter(|_| options.carry_rest) else { return (None, Vec::new()) };
    let Some(rest) = &native.rest else { return (None, Vec::new()) };
    let kept = native.encoding == plan.encoding;
    let elements: Vec<String> = rest
        .before
        .iter()
        .chain(&rest.after)
        .filter(|e| e.count > 0)
        .map(|e| format!("{} of `{}`", e.count, e.name))
        .collect();
    let note = |fate: &str| match elements.len() {
        0 => Vec::new(),
        _ => vec![format!("{} are {fate}", elements.join(", "))],
    };
    match kept {
        true => (Some(native.clone()), note("carried as they are")),
        false => (None, note("dropped: the encoding changes")),
    }
}

impl Plan {
    fn new(options: &PlyOptions, schema: &Schema, native: Option<&Native>) -> Result<Plan> {
        let encoding = options.encoding.or(native.map(|n| n.encoding)).unwrap_or({
            match (schema.layout, schema.endian) {
                (Layout::Ply, crate::point::Endian::Big) => Encoding::BinaryBigEndian,
                _ => Encoding::BinaryLittleEndian,
            }
        });
        let mut vertex = ply_schema(schema);
        vertex.endian = encoding.endian();
        vertex.dimensions.retain(|d| !options.drop.contains(&d.name));
        vertex.stride = 0;
        for dimension in &mut vertex.dimensions {
            dimension.offset = vertex.stride;
            vertex.stride += dimension.scalar.size();
        }
        // Made before the normals are added: the records need not have them.
        let mut projection = Projection::new(schema, &vertex, &options.drop)?;
        let mut normals = None;
        if options.normals {
            let added = add_normals(&mut vertex)?;
            projection.widen(vertex.stride);
            normals = Some(added);
        }
        let projection = (!projection.is_copy()).then_some(projection);
        Ok(Plan { encoding, vertex, projection, normals, spare: Spare::default() })
    }

    fn chunk(&self) -> ChunkSize {
        let bytes = (CHUNK_POINTS as u64).saturating_mul(self.bytes_per_point() as u64);
        ChunkSize { points: CHUNK_POINTS, bytes }
    }

    /// Bytes that encoding one record holds at most.
    fn bytes_per_point(&self) -> usize {
        let text: usize = match self.encoding {
            Encoding::Ascii => self.vertex.dimensions.iter().map(|d| text::longest(d.scalar)).sum(),
            _ => 0,
        };
        self.vertex.stride + text
    }

    fn put_normals(&self, normals: &[[f32; 3]], vertices: &mut [u8]) -> Result<()> {
        let Some(fields) = &self.normals else { return Ok(()) };
        for (vertex, normal) in vertices.chunks_exact_mut(self.vertex.stride).zip(normals) {
            for (field, value) in fields.iter().zip(normal) {
                if !field.put(vertex, self.vertex.endian, Value::Single(*value)) {
                    return Err(Error::internal("a floating-point field refused a normal"));
                }
            }
        }
        Ok(())
    }

    fn print(&self, vertices: &[u8]) -> Vec<u8> {
        let points = vertices.len() / self.vertex.stride;
        let mut text = Vec::with_capacity(points * (self.bytes_per_point() - self.vertex.stride));
        for vertex in vertices.chunks_exact(self.vertex.stride) {
            for dimension in &self.vertex.dimensions {
                text::print(dimension.get(vertex, self.vertex.endian), &mut text);
                text.push(b' ');
            }
            text.pop();
            text.push(b'\n');
        }
        text
    }
}

/// Adds the normals' fields that are not there; fails on those that hold whole numbers.
fn add_normals(vertex: &mut Schema) -> Result<[Dimension; 3]> {
    let mut field = |name: &str| -> Result<Dimension> {
        if let Some(found) = vertex.find(name) {
            if found.scalar.is_float() {
                return Ok(found.clone());
            }
            let message = format!("the input's {name} holds whole numbers: no normal fits");
            return Err(
                Error::pipeline(message).help(format!("`write.drop = [{name:?}]` leaves it out"))
            );
        }
        let added = Dimension::new(name, Scalar::F32, vertex.stride);
        vertex.stride += added.scalar.size();
        vertex.dimensions.push(added.clone());
        Ok(added)
    };
    Ok([field(NORMAL[0])?, field(NORMAL[1])?, field(NORMAL[2])?])
}

impl Encode for Plan {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let mut rounded = None;
        let mut vertices = self.spare.take(Vec::new);
        if let Some(projection) = &self.projection {
            vertices.resize(batch.len() * self.vertex.stride, 0);
            let rounding = projection.project_into(batch.records(), &mut vertices)?;
            rounded = (rounding.points > 0).then_some((rounding.points, rounding.largest));
        } else {
            vertices.clear();
            vertices.extend_from_slice(batch.records());
        }
        if self.normals.is_some() {
            let normals =
                batch.normals.as_ref().filter(|normals| normals.len() == batch.len()).ok_or_else(
                    || Error::internal("normals are to be written, none were computed"),
                )?;
            self.put_normals(normals, &mut vertices)?;
        }
        let bytes = match self.encoding {
            Encoding::Ascii => {
                let text = self.print(&vertices);
                self.spare.put(vertices);
                text
            }
            _ => vertices,
        };
        Ok(Encoded { bytes, points: batch.len() as u64, rounded, ..Encoded::default() })
    }
}

impl Sink for PlySink {
    fn chunk_points(&self) -> usize {
        CHUNK_POINTS
    }

    fn chunk_bytes(&self) -> u64 {
        self.plan.chunk().bytes
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        self.plan.clone()
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        self.file
            .write_all(&chunk.bytes)
            .map_err(|e| Error::io(&self.path, "write vertices", e))?;
        self.points += chunk.points;
        self.bytes += chunk.bytes.len() as u64;
        if self.plan.encoding != Encoding::Ascii {
            self.plan.spare.put(chunk.bytes);
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<SinkSummary> {
        if let Some(native) = self.carries() {
            let expected = native.rest.as_ref().map_or(0, |rest| rest.points);
            if expected != self.points {
                return Err(Error::internal(format!(
                    "faces are carried for {expected} vertices, but {} were written",
                    self.points
                )));
            }
            self.carry(&native, 1)?;
        }
        let failed = |e| Error::io(&self.path, "write the header", e);
        self.file.seek(SeekFrom::Start(0)).map_err(failed)?;
        self.file.write_all(self.header.text(self.points).as_bytes()).map_err(failed)?;
        self.file.sync_all().map_err(|e| Error::io(&self.path, "flush", e))?;
        let (points, bytes, notes) = (self.points, self.bytes, self.notes);
        Ok(SinkSummary { points, bytes, notes, beside: None })
    }
}
