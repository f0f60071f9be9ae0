//! Writes vertices to a PLY file.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::colors::{Depth, Recoloring, WrittenColors, note};
use super::encode::{CHUNK_POINTS, FULL, PlyOptions, VertexPlan, WIDE};
use super::faces::FaceEncoder;
use super::header::Encoding;
use super::headings::Headings;
use super::names::RECORDS;
use super::noted;
use super::source::PlyNative;
use crate::point::{Metadata, RunNote, Schema};
use crate::stage::{ChunkSize, Colors, Encode, EncodeTriangles, Encoded, Sink, SinkSummary};
use crate::{Error, Result};

/// Bytes carried at once.
const CARRY: usize = 1 << 18;

/// Creates a PLY file at `staged` for records of `schema`. Records of another format are converted
/// to the properties of [`ply_schema`](super::vertex::ply_schema).
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
pub(super) fn plan(
    options: &PlyOptions,
    schema: &Schema,
    metadata: &Metadata,
) -> Result<VertexPlan> {
    VertexPlan::new(options, schema, native_of(schema, metadata).as_deref())
}

/// Writes a PLY file; the header has its final length from the beginning.
struct PlySink {
    file: File,
    path: PathBuf,
    plan: Arc<VertexPlan>,
    header: Headings,
    /// The header with colours of as many bits as the file does not have, where they can have 8 or
    /// 16.
    other: Option<Headings>,
    /// True if the file has colours of 16 bits.
    wide: bool,
    /// What the appended colours are.
    depth: Depth,
    rest: Option<Arc<PlyNative>>,
    /// How it was made.
    note: Option<Arc<RunNote>>,
    notes: Vec<String>,
    points: u64,
    triangles: u64,
    bytes: u64,
}

impl PlySink {
    fn create(
        staged: &Path,
        options: &PlyOptions,
        schema: &Schema,
        metadata: &Metadata,
    ) -> Result<PlySink> {
        let native = native_of(schema, metadata);
        let plan = VertexPlan::new(options, schema, native.as_deref())?;
        let (rest, mut notes) = carried(options, &plan, native.as_ref());
        let note = metadata.note.clone().filter(|note| note.draft().len() <= noted::LONGEST);
        if metadata.note.is_some() && note.is_none() {
            notes.push("how it was made is too long for a header and not in it".to_owned());
        }
        let draft = note.as_ref().map_or(String::new(), |note| noted::lines(note.draft()));
        let headings = |vertex: &Schema| {
            let (native, rest) = (native.as_deref(), rest.as_deref());
            let mut headings = Headings::of(vertex, plan.encoding, metadata, native, rest);
            headings.note.clone_from(&draft);
            headings.has_faces = options.triangles;
            headings
        };
        let full = headings(&plan.full.vertex);
        let (header, other) = match &plan.narrow {
            Some(narrow) => (headings(narrow.vertex()), Some(full)),
            None => (full, None),
        };
        let mut file = File::create(staged).map_err(|e| Error::io(staged, "create", e))?;
        let text = header.text(0, 0);
        let failed = |e| Error::io(staged, "write the header", e);
        file.write_all(text.as_bytes()).map_err(failed)?;
        let mut sink = PlySink {
            file,
            path: staged.to_owned(),
            plan: Arc::new(plan),
            header,
            wide: other.is_none(),
            other,
            depth: Depth::default(),
            rest,
            note,
            notes,
            points: 0,
            triangles: 0,
            bytes: text.len() as u64,
        };
        if let Some(rest) = sink.carries() {
            sink.carry(&rest, 0)?;
        }
        Ok(sink)
    }

    /// Makes the colours of a chunk and those of the file so far have as many bits.
    fn fit_colors(&mut self, chunk: &mut Encoded) -> Result<()> {
        let plan = self.plan.clone();
        let Some(narrow) = &plan.narrow else { return Ok(()) };
        let WrittenColors { depth, wide } = WrittenColors::from_code(chunk.form);
        let before = self.depth;
        self.depth = before.join(depth);
        if narrow.asked == Colors::Eight {
            return Ok(());
        }
        if !self.depth.is_narrow() {
            let known = if self.depth == Depth::Full { FULL } else { WIDE };
            plan.widened.store(known, Ordering::Relaxed);
            if !self.wide {
                self.rewrite(plan.widening(before))?;
            }
        }
        if self.wide
            && !wide
            && let Some(widening) = plan.widening(depth)
        {
            let mut widened = Vec::new();
            widening.append(&chunk.bytes, &mut widened)?;
            chunk.bytes = widened;
        }
        Ok(())
    }

    /// Writes the file anew with colours of as many bits as it does not have now.
    fn rewrite(&mut self, recoloring: Option<Recoloring<'_>>) -> Result<()> {
        let (Some(other), Some(recoloring)) = (&mut self.other, recoloring) else {
            return Ok(());
        };
        let path = self.path.with_extension("colors");
        let failed = |e| Error::io(&self.path, "write its colours anew", e);
        let mut file = File::create(&path).map_err(failed)?;
        file.write_all(other.text(0, 0).as_bytes()).map_err(failed)?;
        let written = File::open(&self.path).map_err(failed)?;
        let (mut at, end) = (self.header.text(0, 0).len() as u64, self.bytes);
        let mut bytes = other.text(0, 0).len() as u64;
        let (mut buffer, mut anew) = (vec![0; CARRY.max(self.plan.vertex_bytes())], Vec::new());
        while at < end {
            let piece = (end - at).min(buffer.len() as u64) as usize;
            written.read_exact_at(&mut buffer[..piece], at).map_err(failed)?;
            anew.clear();
            match recoloring.append(&buffer[..piece], &mut anew)? {
                0 => return Err(Error::internal("a vertex is longer than it can be")),
                taken => at += taken as u64,
            }
            file.write_all(&anew).map_err(failed)?;
            bytes += anew.len() as u64;
        }
        std::fs::rename(&path, &self.path).map_err(failed)?;
        std::mem::swap(&mut self.header, other);
        (self.file, self.bytes, self.wide) = (file, bytes, !self.wide);
        Ok(())
    }

    /// Gives the file colours of 8 bits, if it has those of 16 and they need not be.
    fn narrow(&mut self) -> Result<()> {
        let plan = self.plan.clone();
        let is_mixed = self.wide && self.depth == Depth::Mixed;
        if is_mixed { self.rewrite(plan.narrowing()) } else { Ok(()) }
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
fn native_of(schema: &Schema, metadata: &Metadata) -> Option<Arc<PlyNative>> {
    let native = metadata.native.clone().filter(|_| schema.layout == RECORDS)?;
    native.downcast::<PlyNative>().ok()
}

/// The input's other elements, if they can be carried, or a note that they are not.
fn carried(
    options: &PlyOptions,
    plan: &VertexPlan,
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
        CHUNK_POINTS
    }

    fn chunk_bytes(&self) -> u64 {
        self.plan.chunk().bytes
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        self.plan.clone()
    }

    fn append(&mut self, mut chunk: Encoded) -> Result<()> {
        let is_of_points = chunk.points > 0;
        if is_of_points {
            self.fit_colors(&mut chunk)?;
        }
        let what = if is_of_points { "write vertices" } else { "write faces" };
        self.file.write_all(&chunk.bytes).map_err(|e| Error::io(&self.path, what, e))?;
        self.points += chunk.points;
        self.triangles += chunk.triangles;
        self.bytes += chunk.bytes.len() as u64;
        if is_of_points && self.plan.encoding != Encoding::Ascii {
            self.plan.spare.put(chunk.bytes);
        }
        Ok(())
    }

    fn triangles(&mut self) -> Result<Arc<dyn EncodeTriangles>> {
        // What stands behind the vertices cannot be rewritten with them.
        self.narrow()?;
        Ok(Arc::new(FaceEncoder(self.plan.encoding)))
    }

    fn finish(mut self: Box<Self>) -> Result<SinkSummary> {
        if !self.header.has_faces {
            self.narrow()?;
        }
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
        if let Some(note) = &self.note {
            self.header.note = noted::lines(note.text()?);
        }
        let text = self.header.text(self.points, self.triangles);
        let failed = |e| Error::io(&self.path, "write the header", e);
        self.file.seek(SeekFrom::Start(0)).map_err(failed)?;
        self.file.write_all(text.as_bytes()).map_err(failed)?;
        self.file.sync_all().map_err(|e| Error::io(&self.path, "flush", e))?;
        if let Some(narrow) = &self.plan.narrow {
            self.notes.extend(note(narrow.asked, self.depth));
        }
        let (points, bytes, notes) = (self.points, self.bytes, self.notes);
        Ok(SinkSummary { points, bytes, notes })
    }
}
