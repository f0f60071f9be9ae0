//! The report as a document: `result`, the same bytes for every configuration, and `run`.

use std::collections::BTreeMap;
use std::io::{self, BufRead, Write};
use std::path::Path;

use serde::Serialize;

use super::figures::{ClassFigures, DeviationBin, PassFigures, Totals};
use super::ledger::Ledger;
use super::machine::Machine;
use super::stats::StatsFigures;
use super::verdict::AcceptVerdict;
use crate::budget::Holders;

/// What a run says it did.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// The same for every configuration of the run; of a pipeline with several branches that of the
    /// first.
    pub result: Outcome,
    /// The same of each branch but the first: what a run of it alone would have come to.
    pub further: Vec<Outcome>,
    /// What is free to differ.
    pub run: RunFigures,
}

/// What was decided, removed and measured: a function of the points and the pipeline alone. The
/// report tiles belong to it, but are not held: there may be millions.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Outcome {
    /// The pipeline's stages with all their settings, defaults filled in.
    pub pipeline: serde_json::Value,
    /// Where all decisions are made; None if the pipeline streams and asks for no lattice.
    pub lattice: Option<LatticeFigures>,
    /// read = kept + removed.
    pub ledger: Ledger,
    /// What stages settled by themselves.
    pub decisions: Vec<Decision>,
    /// Counts by name.
    pub counts: BTreeMap<String, u64>,
    /// What stages counted of the points that came by, in alphabetical order of their names.
    pub stats: Vec<StatsFigures>,
    /// The passes over the scan, in order; none if the pipeline streams.
    pub passes: Vec<PassFigures>,
    /// Side of the report tiles in world units; None if the pipeline streams, which has no tiles.
    pub tile_side: Option<f64>,
    /// Figures of the whole scan; None likewise.
    pub totals: Option<Totals>,
    /// How far removed records are from the surface of what stands for them, in ascending order;
    /// empty where nothing was measured.
    pub deviations: Vec<DeviationBin>,
    /// Records by class, in ascending order; empty if they have none.
    pub classes: Vec<ClassFigures>,
    /// What the rules of the pipeline come to; None if it has none.
    pub accept: Option<AcceptVerdict>,
}

/// The lattice of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LatticeFigures {
    /// World units of one step.
    pub step: f64,
    /// World coordinates of position 0.
    pub shift: [f64; 3],
}

/// Something that a stage settled by itself.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Decision {
    /// Kind of the stage.
    pub stage: String,
    /// What was settled.
    pub name: String,
    /// To what.
    pub value: serde_json::Value,
}

/// How the run went.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct RunFigures {
    /// Version of pointmill.
    pub version: String,
    /// Files read, in order.
    pub inputs: Vec<FileFigures>,
    /// Files written.
    pub outputs: Vec<FileFigures>,
    /// Where it ran.
    pub machine: Machine,
    /// Worker threads.
    pub threads: usize,
    /// The memory budget.
    pub memory_bytes: u64,
    /// The most that was leased of it at once.
    pub leased_bytes: u64,
    /// Who held it then.
    pub memory_holders: Holders,
    /// Peak resident memory of the process (VmHWM); None where the system does not tell.
    pub peak_memory_bytes: Option<u64>,
    /// Bytes spilled to disk.
    pub spill_bytes: u64,
    /// Wall-clock seconds in all.
    pub seconds: f64,
    /// CPU seconds of all threads, user and system; None where the system does not tell.
    pub cpu_seconds: Option<f64>,
    /// Wall-clock seconds by phase, in the order of the run.
    pub phases: Vec<Phase>,
    /// CPU seconds by phase, for predictions; not written.
    pub(crate) cpu_by_phase: Vec<(&'static str, f64)>,
    /// Counts that depend on how the work was cut up (tiles, rim positions, …).
    pub work: BTreeMap<String, u64>,
    /// What the user was warned of.
    pub warnings: Vec<String>,
    /// Points of damaged inputs that were not read; not written where there are none.
    pub lost: Vec<LostPoints>,
    /// How the points came to the coordinate reference system that they are in; not written where
    /// they are in that of the inputs.
    pub reprojection: Option<Reprojection>,
}

/// How points came from one coordinate reference system to another.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Reprojection {
    /// The system of the inputs, as EPSG codes.
    pub from: String,
    /// That of the points, likewise.
    pub to: String,
    /// Name of the operation between the datums of the two; None where they have one datum.
    pub operation: Option<String>,
    /// Its EPSG code, where it has one.
    pub code: Option<u32>,
    /// How accurate it is said to be, in metres; 0 between systems on one datum; None where nothing
    /// says.
    pub accuracy: Option<f64>,
    /// A better one, which is not known here: how accurate it is, and what it takes.
    pub better: Option<String>,
}

/// Points of a damaged input that are lost.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct LostPoints {
    /// The file.
    pub path: String,
    /// The byte from which on they are not read.
    pub byte: u64,
    /// How many.
    pub points: u64,
    /// Why.
    pub why: String,
}

/// A file and the records in it.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct FileFigures {
    /// Path as given.
    pub path: String,
    /// Records.
    pub points: u64,
    /// Length; None where it is not known.
    pub bytes: Option<u64>,
    /// Its SHA-256 in hexadecimal digits; None where the run takes no hashes.
    pub sha256: Option<String>,
}

impl FileFigures {
    /// Those of a file: its path as it is, since the document's writer escapes it.
    pub(crate) fn of(path: &Path, points: u64, bytes: Option<u64>) -> Self {
        FileFigures { path: path.display().to_string(), points, bytes, sha256: None }
    }
}

/// A phase of the run.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Phase {
    /// What was done.
    pub name: String,
    /// Wall-clock seconds.
    pub seconds: f64,
}

impl Report {
    /// Writes the report as one JSON object, `result` first; with several branches `result` is that
    /// of the first, and `further` a list of those of the others. `tiles` has the lines of
    /// [`TileFigures::write_line`](super::TileFigures::write_line) of each branch, in order: of one
    /// in Morton order. They are copied through a small buffer, however many they are.
    ///
    /// # Errors
    ///
    /// Those of `out` and `tiles`, a branch without tiles, and [`io::ErrorKind::InvalidData`] if
    /// there are not as many tiles as the totals say.
    pub(crate) fn write<T: BufRead>(
        &self,
        out: &mut impl Write,
        tiles: impl IntoIterator<Item = T>,
    ) -> io::Result<()> {
        let mut tiles = tiles.into_iter();
        let missing = || io::Error::new(io::ErrorKind::InvalidData, "a branch without tiles");
        let mut next = || tiles.next().ok_or_else(missing);
        out.write_all(b"{\n\"result\": ")?;
        self.result.write(out, &mut next()?)?;
        for (n, result) in self.further.iter().enumerate() {
            out.write_all(if n == 0 { b",\n\"further\": [\n" } else { b",\n" })?;
            result.write(out, &mut next()?)?;
        }
        if !self.further.is_empty() {
            out.write_all(b"\n]")?;
        }
        out.write_all(b",\n\"run\": ")?;
        self.run.write(out)?;
        out.write_all(b"\n}\n")
    }
}

impl Outcome {
    /// Writes `result` alone, as in [`Report::write`].
    ///
    /// # Errors
    ///
    /// As [`Report::write`].
    fn write(&self, out: &mut impl Write, tiles: &mut impl BufRead) -> io::Result<()> {
        let mut object = Object::open(out)?;
        object.entry("pipeline", &self.pipeline)?;
        object.entry("lattice", &self.lattice)?;
        object.entry("ledger", &self.ledger)?;
        object.entry("decisions", &self.decisions)?;
        object.entry("counts", &self.counts)?;
        if !self.stats.is_empty() {
            object.entry("stats", &self.stats)?;
        }
        object.entry("accept", &self.accept)?;
        object.entry("passes", &self.passes)?;
        object.entry("totals", &self.totals)?;
        object.entry("deviations", &self.deviations)?;
        object.entry("classes", &self.classes)?;
        object.entry("tile_side", &self.tile_side)?;
        object.key("tiles")?;
        let copied = copy_lines(object.out, tiles)?;
        let expected = self.totals.map_or(0, |t| t.tiles);
        if copied != expected {
            return Err(io::Error::new(
                io::ErrorKind::InvalidData,
                format!("{copied} report tiles instead of {expected}"),
            ));
        }
        object.close()
    }
}

/// The bytes of `result` in the file of a report; None if it is not one.
pub fn result_bytes(report: &[u8]) -> Option<&[u8]> {
    // JSON text holds no line break within a string, so the lines that open what follows are
    // unmistakable.
    const BEHIND: [&[u8]; 2] = [b",\n\"run\": ", b",\n\"further\": "];
    let rest = report.strip_prefix(b"{\n\"result\": ")?;
    let ends = BEHIND.iter().filter_map(|key| rest.windows(key.len()).position(|w| w == *key));
    let end = ends.min()?;
    rest.get(..end)
}

/// Holders of memory that a report lists.
const HOLDERS: usize = 8;

impl RunFigures {
    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let mut object = Object::open(out)?;
        object.entry("version", &self.version)?;
        object.entry("inputs", &self.inputs)?;
        object.entry("outputs", &self.outputs)?;
        object.entry("machine", &self.machine)?;
        object.entry("threads", &self.threads)?;
        object.entry("memory_bytes", &self.memory_bytes)?;
        object.entry("leased_bytes", &self.leased_bytes)?;
        object.entry("memory_holders", &self.memory_holders.largest(HOLDERS))?;
        object.entry("peak_memory_bytes", &self.peak_memory_bytes)?;
        object.entry("spill_bytes", &self.spill_bytes)?;
        object.entry("seconds", &self.seconds)?;
        object.entry("cpu_seconds", &self.cpu_seconds)?;
        object.entry("phases", &self.phases)?;
        object.entry("work", &self.work)?;
        object.entry("warnings", &self.warnings)?;
        if !self.lost.is_empty() {
            object.entry("lost", &self.lost)?;
        }
        if let Some(reprojection) = &self.reprojection {
            object.entry("reprojection", reprojection)?;
        }
        object.close()
    }
}

/// A JSON object written one entry a line, in the order of the calls.
struct Object<'a, W> {
    out: &'a mut W,
    empty: bool,
}

impl<'a, W: Write> Object<'a, W> {
    fn open(out: &'a mut W) -> io::Result<Self> {
        out.write_all(b"{")?;
        Ok(Object { out, empty: true })
    }

    fn key(&mut self, key: &str) -> io::Result<()> {
        let before: &[u8] = if self.empty { b"\n" } else { b",\n" };
        self.empty = false;
        self.out.write_all(before)?;
        serde_json::to_writer(&mut *self.out, key)?;
        self.out.write_all(b": ")
    }

    fn entry(&mut self, key: &str, value: &impl Serialize) -> io::Result<()> {
        self.key(key)?;
        serde_json::to_writer(&mut *self.out, value)?;
        Ok(())
    }

    fn close(self) -> io::Result<()> {
        self.out.write_all(b"\n}")
    }
}

/// Writes lines of JSON as one array; returns how many there were.
fn copy_lines(out: &mut impl Write, lines: &mut impl BufRead) -> io::Result<u64> {
    out.write_all(b"[")?;
    let mut count = 0u64;
    let mut within = false;
    loop {
        let block = match lines.fill_buf() {
            Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
            block => block?,
        };
        if block.is_empty() {
            break;
        }
        let length = block.len();
        for piece in block.split_inclusive(|&b| b == b'\n') {
            let text = piece.strip_suffix(b"\n").unwrap_or(piece);
            if !within && !text.is_empty() {
                out.write_all(if count == 0 { b"\n" } else { b",\n" })?;
                count += 1;
            }
            out.write_all(text)?;
            // A line may go on in the next block.
            within = text.len() == piece.len();
        }
        lines.consume(length);
    }
    out.write_all(if count == 0 { b"]" } else { b"\n]" })?;
    Ok(count)
}

#[cfg(test)]
mod tests;
