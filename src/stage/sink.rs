//! Where records go: what a stage says of its outputs, and how records are encoded and written.

use serde::{Deserialize, Serialize};

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::source::{Input, Source};
use super::split::{OutputSplit, SplitKey};
use super::triangles::{Triangle, Triangulation};
use super::walk::PointWalk;
use crate::geom::lattice::Lattice;
use crate::point::{Bounds, Metadata, PointBatch, Position, Schema, Units};
use crate::{Error, Result};

/// Where records go. A sink writes below the path it is given; the run puts the finished file in
/// its final place.
pub trait Sink: Send {
    /// Records that one [`Encode::encode`] takes; only the last may have fewer.
    fn chunk_points(&self) -> usize;

    /// Bytes that encoding one chunk holds, output included.
    fn chunk_bytes(&self) -> u64;

    /// The encoder, shared by all threads.
    fn encoder(&self) -> Arc<dyn Encode>;

    /// Told once, before the first chunk, where its points are, if its records come in
    /// [canonical order](Order::Canonical); one of several files only where it
    /// [arranges](CreateSink::arranged) them.
    ///
    /// # Errors
    ///
    /// Where the format has no place for them.
    fn arrange(&mut self, _extent: &Extent) -> Result<()> {
        Ok(())
    }

    /// Writes one chunk; called in canonical order, from one thread at a time.
    ///
    /// # Errors
    ///
    /// What the system refuses to write; the output is given up then.
    fn append(&mut self, chunk: Encoded) -> Result<()>;

    /// Called once, behind the last chunk of points, where the output
    /// [connects](CreateSink::triangulation) them: what encodes triangles, shared by all threads.
    /// Their chunks are appended as those of points are, in an order that the points alone decide.
    ///
    /// # Errors
    ///
    /// An output that holds no triangles, and what the system refuses to write.
    fn triangles(&mut self) -> Result<Arc<dyn EncodeTriangles>> {
        Err(Error::internal("triangles are for an output that holds none"))
    }

    /// Writes what depends on all points (header counts, chunk table) and flushes to disk.
    ///
    /// # Errors
    ///
    /// As [`append`](Sink::append), and counts that the format cannot hold.
    fn finish(self: Box<Self>) -> Result<SinkSummary>;
}

/// Where the points of a scan are, for outputs that arrange them in space.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Extent {
    /// The lattice: records come in Morton order of their positions on it.
    pub lattice: Lattice,
    /// The box of the positions of all points that were read, or of those of the file where it is
    /// one of several; empty if there are none.
    pub bounds: Bounds,
}

impl Extent {
    /// Points on `lattice` within `bounds`.
    pub fn new(lattice: Lattice, bounds: Bounds) -> Self {
        Extent { lattice, bounds }
    }
}

/// The part of a sink that runs on several threads at once.
pub trait Encode: Send + Sync {
    /// Encodes up to `chunk_points` records of the source's schema.
    ///
    /// # Errors
    ///
    /// A record that the format cannot hold; no chunk behind it is written.
    fn encode(&self, batch: &PointBatch) -> Result<Encoded>;
}

/// The part of a sink that writes triangles and runs on several threads at once.
pub trait EncodeTriangles: Send + Sync {
    /// Encodes triangles.
    ///
    /// # Errors
    ///
    /// A corner that the format cannot refer to.
    fn encode(&self, triangles: &[Triangle]) -> Result<Encoded>;
}

/// An encoded chunk and the figures that a header needs.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Encoded {
    /// The bytes to append.
    pub bytes: Vec<u8>,
    /// Points in them.
    pub points: u64,
    /// Triangles in them.
    pub triangles: u64,
    /// Smallest stored X, Y, Z (formats with integer coordinates).
    pub lo: [i64; 3],
    /// Largest stored X, Y, Z.
    pub hi: [i64; 3],
    /// Points by return number, 1 to 15 (formats that count them).
    pub returns: [u64; 15],
    /// Points that a conversion rounded, and by how much at most, in world units.
    pub rounded: Option<(u64, f64)>,
    /// Positions of the records on the lattice (outputs that arrange their points).
    pub places: Vec<Position>,
    /// In which of its forms a format wrote the chunk; 0 where it has one.
    pub form: u8,
}

impl Encoded {
    /// A chunk of `points` records whose bytes these are; other figures are as if nobody asked.
    pub fn new(bytes: Vec<u8>, points: u64) -> Self {
        Encoded { bytes, points, ..Encoded::default() }
    }
}

/// What a sink says when it is done.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SinkSummary {
    /// Points written.
    pub points: u64,
    /// Bytes of the finished file.
    pub bytes: u64,
    /// Things the user should know (rounding of a conversion, for example).
    pub notes: Vec<String>,
}

impl SinkSummary {
    /// So many points in a file of so many bytes, and nothing to note.
    pub fn new(points: u64, bytes: u64) -> Self {
        SinkSummary { points, bytes, notes: Vec::new() }
    }
}

/// How much a sink encodes at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChunkSize {
    /// See [`Sink::chunk_points`].
    pub points: usize,
    /// See [`Sink::chunk_bytes`].
    pub bytes: u64,
}

impl ChunkSize {
    /// The same where the records of a chunk are held once more, each in `stride` bytes.
    pub fn and_records(self, stride: usize) -> Self {
        let records = (self.points as u64).saturating_mul(stride as u64);
        ChunkSize { bytes: self.bytes.saturating_add(records), ..self }
    }
}

/// Creates a sink once the source's schema is known.
pub trait CreateSink: Send + Sync {
    /// The final path of the output; the folder where there is one output for each input.
    fn path(&self) -> &Path;

    /// What the name of its file ends with, behind a dot: with it the format is known.
    fn extension(&self) -> Option<&OsStr> {
        self.path().extension()
    }

    /// False if it writes no file: then [`path`](CreateSink::path) is what reports and messages
    /// call it, and it is created with an empty path.
    fn is_file(&self) -> bool {
        true
    }

    /// True if each input gets an output of its own, in the folder [`path`](CreateSink::path).
    fn is_folder(&self) -> bool {
        false
    }

    /// The sinks of the `inputs`, in their order, if each input gets an output of its own: this one
    /// then is not created, and its [`chunk`](CreateSink::chunk) is as large as any of theirs. They
    /// are created one after the other, each with
    /// [`Source::metadata_of`](super::Source::metadata_of) its input, and an input of which no
    /// record is kept gets its output too.
    ///
    /// That none replaces an input is the plan's to check. Makes nothing: the folder is made by the
    /// run.
    ///
    /// # Errors
    ///
    /// Two outputs that would have one name.
    fn each_input(&self, _inputs: &[Input]) -> Result<Option<Vec<Box<dyn CreateSink>>>> {
        Ok(None)
    }

    /// True if the output is split: its [`path`](CreateSink::path) is the pattern of the names of
    /// its files, and their folder is made by the run.
    fn is_split(&self) -> bool {
        false
    }

    /// Into which files records of `schema` are split, if they are, where coordinates have these
    /// units: this sink then is not created, but those [of its files](CreateSink::of_split), each
    /// when its records are known.
    ///
    /// # Errors
    ///
    /// A side in a unit of its own where that of the scan is not known, and a dimension that the
    /// records lack.
    fn split(&self, _schema: &Schema, _units: &Units) -> Result<Option<OutputSplit>> {
        Ok(None)
    }

    /// The sink of one file of a split.
    ///
    /// # Errors
    ///
    /// If the output is not split.
    fn of_split(&self, _key: SplitKey, _split: &OutputSplit) -> Result<Box<dyn CreateSink>> {
        Err(Error::internal("an output that is one file is not split").at(self.path()))
    }

    /// True if a file of its split could have this path.
    fn may_name(&self, _path: &Path) -> bool {
        false
    }

    /// How its points are connected, if it writes them as a mesh. Such an output has the canonical
    /// [order](CreateSink::order).
    ///
    /// # Errors
    ///
    /// A length in a unit of its own where that of the scan is not known.
    fn triangulation(&self, _units: &Units) -> Result<Option<Triangulation>> {
        Ok(None)
    }

    /// The same sink, where some of what it was asked for depends on the points: with what it found
    /// of them. Called once, before anything else that is told of the records.
    ///
    /// # Errors
    ///
    /// What cannot be found, and what reading the points fails with.
    fn settled(&self, _ahead: &PointsAhead<'_>) -> Result<Option<Box<dyn CreateSink>>> {
        Ok(None)
    }

    /// The order in which records are wanted.
    fn order(&self) -> Order;

    /// True if records that come in canonical order may be ordered by time within a chunk, because
    /// the output is smaller then.
    fn likes_time(&self) -> bool {
        false
    }

    /// Given if its points are arranged in space, for which its sink is told where they are
    /// ([`Sink::arrange`]): the bytes that it holds for that, besides its chunks, while it is open.
    /// Such an output has the canonical [order](CreateSink::order), and its chunks have
    /// [places](Encoded::places).
    ///
    /// # Errors
    ///
    /// A `lattice` whose steps are not of one length in the unit of the coordinates, and as
    /// [`chunk`](CreateSink::chunk).
    fn arranged(
        &self,
        _lattice: &Lattice,
        _schema: &Arc<Schema>,
        _metadata: &Metadata,
    ) -> Result<Option<u64>> {
        Ok(None)
    }

    /// True if its records still refer to the file beside the input ([`Input::beside`]), so that a
    /// copy is to be beside the output.
    fn wants_beside(&self) -> bool {
        false
    }

    /// The dimensions that it writes of those that stages compute, such as `NormalX`. What they are
    /// comes with [`Metadata::computed`], and their values with [`PointBatch::columns`].
    fn computed(&self) -> &[String] {
        &[]
    }

    /// The dimensions of its records that it does not look at.
    fn unread(&self) -> &[String] {
        &[]
    }

    /// The chunks of the output that [`create`](CreateSink::create) would open, for a plan of the
    /// memory.
    ///
    /// # Errors
    ///
    /// Where [`create`](CreateSink::create) would refuse the schema.
    fn chunk(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<ChunkSize>;

    /// True if it writes records of `schema` byte for byte as they come, but for what stages
    /// computed and is written behind them.
    fn carries(&self, _schema: &Schema) -> bool {
        false
    }

    /// Bytes that each record takes on the disk at least while the output is written, and those
    /// that it may take besides, where a format writes a file anew; 0 where only the encoded
    /// records tell.
    ///
    /// # Errors
    ///
    /// As [`chunk`](CreateSink::chunk).
    fn disk_bytes(&self, _schema: &Arc<Schema>, _metadata: &Metadata) -> Result<[u64; 2]> {
        Ok([0; 2])
    }

    /// What the output will not hold though the input has it, and nobody was asked; for a plan.
    fn warnings(&self, _schema: &Schema, _metadata: &Metadata) -> Vec<String> {
        Vec::new()
    }

    /// Fails on a record that the output cannot hold, for a plan that looks at some before it
    /// begins.
    ///
    /// # Errors
    ///
    /// A record that the output cannot hold.
    fn check(&self, _metadata: &Metadata, _records: &PointBatch) -> Result<()> {
        Ok(())
    }

    /// True if [`check`](CreateSink::check) may fail for records of `schema`.
    fn checks(&self, _schema: &Schema) -> bool {
        false
    }

    /// Opens what was written, at the `staged` paths, to be looked at: for a report with pictures.
    /// None where nobody can.
    ///
    /// # Errors
    ///
    /// Files that cannot be read.
    fn reopen(&self, _staged: &[PathBuf]) -> Result<Option<Box<dyn Source>>> {
        Ok(None)
    }

    /// Checks that the format holds every dimension (or that the user dropped it) and opens the
    /// output at `staged`, a path beside the final one. With `whole`, every record of the source
    /// will come, in its order: what refers to records by number stays true.
    ///
    /// # Errors
    ///
    /// Dimensions that the format cannot hold and the user did not drop, and an output that the
    /// system refuses.
    fn create(
        &self,
        staged: &Path,
        schema: &Arc<Schema>,
        metadata: &Metadata,
        whole: bool,
    ) -> Result<Box<dyn Sink>>;
}

/// The points that will come to a sink, for one that looks at them before the run.
pub struct PointsAhead<'a> {
    /// Where they are read.
    pub source: &'a dyn Source,
    /// How they may be looked through.
    pub walk: PointWalk<'a>,
    /// The kind of a stage that moves them on their way to the sink, if one does.
    pub moved_by: Option<&'a str>,
}

/// Order of an output's records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Order {
    /// Canonical where the pipeline has tile stages, input order where it streams.
    #[default]
    Auto,
    /// Morton order of the lattice, then record bytes.
    Canonical,
    /// The order of the inputs: by file, as they are given, then by record. For one output of all
    /// inputs, or pipelines that stream.
    Input,
}
