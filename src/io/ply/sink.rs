//! Writes vertices to a PLY file.

use std::io::Write;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::Arc;

use super::faces::FaceEncoder;
use super::headings::Headings;
use super::names::{FORM, RECORDS};
use super::source::PlyNative;
use crate::io::rows::Encoding;
use crate::io::rows::file::{Heading, RowFile};
use crate::io::rows::noted::NotedLines;
use crate::io::rows::plan::{RowOptions, RowPlan};
use crate::io::rows::schema::{RowShape, row_schema};
use crate::point::{ComputedDimension, Endian, Metadata, Schema};
use crate::stage::{
    ChunkSize, Colors, Encode, EncodeTriangles, Encoded, Retyped, Sink, SinkSummary, WriteKeys,
};
use crate::{Error, Result};

/// Bytes carried at once.
const CARRY: usize = 1 << 18;

/// How a PLY output is written.
#[derive(Debug, Clone, Default)]
pub struct PlyOptions {
    /// Text or binary; that of the input where it is PLY, else little-endian, when not said.
    pub encoding: Option<Encoding>,
    /// Writes these dimensions that stages computed, normals as `nx`, `ny` and `nz`: in place where
    /// the input has them as floating-point numbers, else behind the other properties.
    pub computed: Vec<ComputedDimension>,
    /// Dimensions that are left out.
    pub drop: Vec<String>,
    /// Types that properties have in the output, by their dimensions' names there.
    pub types: Vec<Retyped>,
    /// How many bits the colours of LAS records have; as for [`Colors::Auto`] when not said. From
    /// PLY to PLY they stay as they are, and saying it is an error.
    pub colors: Option<Colors>,
    /// Carries the other elements (faces) of a single binary input whose encoding is kept. To be
    /// set only where no vertex is removed, added or moved: it fails on a count that differs.
    pub carry_rest: bool,
    /// Has triangles behind the vertices.
    pub triangles: bool,
}

/// Creates a PLY file at `staged` for records of `schema`. Records of another format are converted
/// to the properties of [`ply_schema`].
///
/// # Errors
///
/// A dimension that cannot be written, a name in `drop` that is none, and a file that cannot be
/// created.
pub fn create(
    staged: &Path,
    options: &PlyOptions,
    schema: &Schema,
    metadata: &Metadata,
) -> Result<Box<dyn Sink>> {
    Ok(Box::new(PlySink::create(staged, options, schema, metadata)?))
}

/// The vertex that holds what a record of `schema` holds, as `rows/schema.rs` says.
pub fn ply_schema(schema: &Schema) -> Schema {
    row_schema(schema, &FORM)
}

/// The chunks of the sink that [`create`] would open, and what it would refuse.
///
/// # Errors
///
/// As [`create`], but for the file.
pub fn chunk(options: &PlyOptions, schema: &Schema, metadata: &Metadata) -> Result<ChunkSize> {
    Ok(plan(options, schema, metadata)?.chunk())
}

/// How the records of the sink that [`create`] would open are written. Fails on what it would
/// refuse of `schema` and `options`.
pub(super) fn plan(options: &PlyOptions, schema: &Schema, metadata: &Metadata) -> Result<RowPlan> {
    row_plan(options, schema, native_of(schema, metadata).as_deref())
}

fn row_plan(options: &PlyOptions, schema: &Schema, native: Option<&PlyNative>) -> Result<RowPlan> {
    let encoding = options.encoding.or(native.map(|n| n.encoding)).unwrap_or({
        match (schema.layout, schema.endian) {
            (RECORDS, Endian::Big) => Encoding::BinaryBigEndian,
            _ => Encoding::BinaryLittleEndian,
        }
    });
    let keys = WriteKeys {
        drop: options.drop.clone(),
        types: options.types.clone(),
        colors: options.colors,
        ..WriteKeys::default()
    };
    RowPlan::new(&RowOptions::of(&keys, encoding, &options.computed), FORM, schema)
}

/// Writes a PLY file: rows and what stands around them.
struct PlySink {
    rows: RowFile<Headings>,
    rest: Option<Arc<PlyNative>>,
}

impl Heading for Headings {
    fn text(&self, rows: u64) -> Vec<u8> {
        Headings::text(self, rows).into_bytes()
    }

    fn settle(&mut self) -> Result<()> {
        self.note.settle()
    }
}

impl PlySink {
    fn create(
        staged: &Path,
        options: &PlyOptions,
        schema: &Schema,
        metadata: &Metadata,
    ) -> Result<PlySink> {
        let native = native_of(schema, metadata);
        let plan = row_plan(options, schema, native.as_deref())?;
        let encoding = plan.encoding;
        let (rest, notes) = carried(options, &plan, native.as_ref());
        let (note, left_out) = NotedLines::of(metadata, "comment ");
        let heading = |shape: &RowShape| {
            let (native, rest) = (native.as_deref(), rest.as_deref());
            let mut headings = Headings::of(&shape.row, encoding, metadata, native, rest);
            headings.note = note.clone();
            headings.has_faces = options.triangles;
            headings
        };
        let mut rows = RowFile::create(staged, plan, heading)?;
        rows.notes.extend(notes.into_iter().chain(left_out));
        let mut sink = PlySink { rows, rest };
        if let Some(rest) = sink.carries() {
            sink.carry(&rest, 0)?;
        }
        Ok(sink)
    }

    fn carries(&self) -> Option<Arc<PlyNative>> {
        self.rest.clone().filter(|native| native.rest.is_some())
    }

    /// Copies the elements before (0) or behind (1) the vertices of the input.
    fn carry(&mut self, native: &PlyNative, which: usize) -> Result<()> {
        let Some(rest) = &native.rest else { return Ok(()) };
        let (mut at, end) = (rest.cuts[2 * which], rest.cuts[2 * which + 1]);
        let from = rest.origin.reopen()?;
        let mut buffer = vec![0; CARRY];
        while at < end {
            let piece = &mut buffer[..(end - at).min(CARRY as u64) as usize];
            from.read_exact_at(piece, at).map_err(|e| {
                Error::io(rest.origin.path(), "read its other elements", e).at_byte(at)
            })?;
            let rows = &mut self.rows;
            let written = rows.file.write_all(piece);
            written.map_err(|e| Error::io(&rows.path, "write the other elements", e))?;
            at += piece.len() as u64;
            rows.bytes += piece.len() as u64;
        }
        rest.origin.unchanged()
    }
}

/// What PLY inputs of such records say of themselves.
fn native_of(schema: &Schema, metadata: &Metadata) -> Option<Arc<PlyNative>> {
    let native = metadata.native.clone().filter(|_| schema.layout == RECORDS)?;
    native.downcast::<PlyNative>().ok()
}

/// The input's other elements, if they can be carried, or a note that they are not.
fn carried(
    options: &PlyOptions,
    plan: &RowPlan,
    native: Option<&Arc<PlyNative>>,
) -> (Option<Arc<PlyNative>>, Vec<String>) {
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

impl Sink for PlySink {
    fn chunk_points(&self) -> usize {
        self.rows.chunk_points()
    }

    fn chunk_bytes(&self) -> u64 {
        self.rows.chunk_bytes()
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        self.rows.encoder()
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        if chunk.points > 0 {
            return self.rows.append(chunk);
        }
        let rows = &mut self.rows;
        let written = rows.file.write_all(&chunk.bytes);
        written.map_err(|e| Error::io(&rows.path, "write faces", e))?;
        rows.header.faces += chunk.triangles;
        rows.bytes += chunk.bytes.len() as u64;
        Ok(())
    }

    fn triangles(&mut self) -> Result<Arc<dyn EncodeTriangles>> {
        // What stands behind the vertices cannot be rewritten with them.
        self.rows.narrow()?;
        Ok(Arc::new(FaceEncoder(self.rows.plan.encoding)))
    }

    fn finish(mut self: Box<Self>) -> Result<SinkSummary> {
        let points = self.rows.points;
        if !self.rows.header.has_faces {
            self.rows.narrow()?;
        }
        if let Some(native) = self.carries() {
            let expected = native.rest.as_ref().map_or(0, |rest| rest.points);
            if expected != points {
                return Err(Error::internal(format!(
                    "faces are carried for {expected} vertices, but {points} were written"
                )));
            }
            self.carry(&native, 1)?;
        }
        self.rows.finish()
    }
}
