//! The roles a stage can play and what it tells the plan. Roles are closed, stages are open: an
//! embedding program adds its own by implementing one of these traits.

mod format;
mod kind;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::geom::lattice::Lattice;
use crate::point::{Bounds, Mark, Metadata, PointBatch, Schema, Units};
use crate::report::Tally;
use crate::store::Levels;
use crate::tile::Tile;
use crate::{Error, Result};

pub use format::{Colors, Format, FormatName, Formats, OutputEncoding, WriteKeys, foreign};
pub use kind::{StageKind, StagePlace};

/// Opens the inputs of a source: headers only, no point.
pub trait OpenSource: Send + Sync {
    /// Reads every header, checks that the inputs agree, and bounds what they claim by their length.
    fn open(&self) -> Result<Box<dyn Source>>;

    /// Files that it reads, so that no output is written over one of them.
    fn paths(&self) -> Vec<PathBuf> {
        Vec::new()
    }

    /// The family of formats of its files, if it is nothing but these files.
    fn family(&self) -> Option<&str> {
        None
    }

    /// This source and `other` as one, whose inputs come behind its own.
    ///
    /// # Errors
    ///
    /// If they cannot be read as one: as it is here, where nothing is known of the two.
    fn merged(&self, _other: &dyn OpenSource) -> Result<Box<dyn OpenSource>> {
        Err(Error::pipeline("this source cannot be merged with another"))
    }
}

/// Where records come from.
pub trait Source: Send + Sync {
    /// What every record holds.
    fn schema(&self) -> &Arc<Schema>;

    /// What outputs carry on besides points.
    fn metadata(&self) -> &Metadata;

    /// The files, in input order, as the report names them; empty when there are none.
    fn inputs(&self) -> Vec<Input> {
        Vec::new()
    }

    /// What the output of one of the [`inputs`](Source::inputs) alone carries on: its own header and
    /// records, where [`metadata`](Source::metadata) is what all have in common. Read again from the
    /// file, so that thousands of headers are not held; a file that changed since is an error.
    ///
    /// The records of a batch still are in the source's schema: a sink that is created with this
    /// brings them to what the input's own header says of them.
    fn metadata_of(&self, _input: usize) -> Result<Metadata> {
        Ok(self.metadata().clone())
    }

    /// How many points the headers claim, cut to what the files could hold at most.
    fn points(&self) -> u64;

    /// Bytes that reading one part holds besides the caller's batch (decoder state, read buffers).
    fn part_bytes(&self) -> u64;

    /// How many parts there are. Parts are independent and numbered in input order.
    fn parts(&self) -> usize;

    /// Opens part `index < parts()`.
    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>>;

    /// Opens a part of which nobody will look at the dimensions `unread`: their fields may hold
    /// anything, so that a source need not decode them. Coordinates are never among them.
    fn part_without(&self, index: usize, _unread: &[String]) -> Result<Box<dyn Part + '_>> {
        self.part(index)
    }

    /// Warnings for the user that opening or reading gave rise to (dropped faces, odd headers).
    fn warnings(&self) -> Vec<String> {
        Vec::new()
    }

    /// What headers say of points and is not so. Asked when every part was read to its end; of inputs
    /// that were not, nothing is known.
    fn contradictions(&self) -> Vec<Contradiction> {
        Vec::new()
    }
}

/// A file that a source reads.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Input {
    /// Its path, as given.
    pub path: PathBuf,
    /// Its points; a source that does not find as many while it reads fails.
    pub points: u64,
    /// A file that its records refer to, such as waveforms, and that is to be beside outputs, under
    /// their names with another extension: where it is, and that extension.
    pub beside: Option<(PathBuf, &'static str)>,
}

/// Something that the header of an input says of its points and that is not so.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Contradiction {
    /// The file.
    pub path: PathBuf,
    /// Byte of the header's field.
    pub byte: u64,
    /// What it says, and what was found.
    pub message: String,
    /// True if the points may be damaged, false if it must be the header that is wrong.
    pub is_damage: bool,
}

/// A stretch of a source's records, in input order.
pub trait Part: Send {
    /// Refills `batch` with up to its capacity of the next records and sets its source number; an
    /// empty batch is the end. After an error the part is not read again.
    fn read(&mut self, batch: &mut PointBatch) -> Result<()>;
}

/// Changes or removes points as they stream by; knows no neighbours.
pub trait Transform: Send + Sync {
    /// What it reads and writes.
    fn needs(&self) -> Needs;

    /// Refuses records of a schema that it cannot work on; called once, before any of them is read.
    fn check(&self, _schema: &Schema) -> Result<()> {
        Ok(())
    }

    /// What it was asked to do and has nothing to do of with records of a schema.
    fn warnings(&self, _schema: &Schema) -> Vec<String> {
        Vec::new()
    }

    /// What it was asked to do and did not, where it removed no point of a scan whose records are of a
    /// schema. It need not repeat its [`warnings`](Transform::warnings).
    fn idle(&self, _schema: &Schema) -> Vec<String> {
        Vec::new()
    }

    /// The keys that say what it removes, each with its stage, as in `filter.keep_classes`.
    fn removes_by(&self) -> Vec<&'static str> {
        Vec::new()
    }

    /// Called for every batch, from several threads at once. Points that it removes are entered in
    /// the ledger by the caller.
    fn apply(&self, batch: &mut PointBatch) -> Result<()>;
}

/// Computes on a tile and its neighbourhood; independent of other tiles and of any order.
pub trait TileOp: Send + Sync {
    /// What it needs; asked again after [`settle`](TileOp::settle).
    fn needs(&self) -> Needs;

    /// Called once, when the headers are read: lengths that were given with a unit of their own are
    /// converted to the scan's.
    fn convert(&mut self, _units: &Units) -> Result<()> {
        Ok(())
    }

    /// The lengths that it was given, in the scan's unit, each with its key as in `grid.side`; those
    /// that the lattice cannot hold are refused before the work.
    fn lengths(&self) -> Vec<(&'static str, f64)> {
        Vec::new()
    }

    /// Called once, after the decode and before the first tile, with what is known of the whole
    /// scan: the place to fix figures that depend on it.
    fn settle(&mut self, _scan: &ScanFacts) -> Result<()> {
        Ok(())
    }

    /// What the user should know of a stage that is settled: lengths that the lattice rounds. Keys are
    /// named with their stage, as in `` `grid.side = 0.15` ``.
    fn warnings(&self, _lattice: &Lattice) -> Vec<String> {
        Vec::new()
    }

    /// Called for every tile, from several threads at once.
    ///
    /// It decides for the positions that [`Tile::is_chosen`] holds; keys that every stage takes may
    /// limit it to some classes or flags. Others are there to be seen, if at all.
    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()>;

    /// What it decided by itself, for the report and for `plan`: name and value.
    fn decisions(&self) -> Vec<(String, serde_json::Value)> {
        Vec::new()
    }

    /// The side in lattice steps of what it decides together, if it wants to look at samples of the scan
    /// a few times as wide, after `settle` and before the first tile.
    fn sample_side(&self) -> Option<i64> {
        None
    }

    /// Called for each of a few hundred small cubes, spread evenly over the records, in order, after
    /// the stages above have run on it. What it returns goes to [`forecast`](TileOp::forecast).
    fn sample(&self, _tile: &mut Tile) -> Result<Vec<f64>> {
        Ok(Vec::new())
    }

    /// Says what is to be expected of the whole scan, a function of what the samples said, in order, and
    /// fixes what depends on it: the pass is cut into tiles afterwards, and [`needs`](TileOp::needs) is
    /// asked again. It may not need more bytes or neighbours than it said before.
    fn forecast(&mut self, _samples: &[Vec<f64>]) -> Forecast {
        Forecast::default()
    }
}

/// What a stage expects before it runs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Forecast {
    /// Figures for the report: name and value.
    pub decisions: Vec<(String, serde_json::Value)>,
    /// The values of its keys that it chose by them: key and value. They go into the report, too.
    pub chosen: Vec<(String, serde_json::Value)>,
    /// What the user should hear before the run.
    pub warning: Option<String>,
}

/// Decides by figures of the whole scan, in two phases: it gathers over all tiles, concludes, and
/// then runs as a [`TileOp`], on columns that the first phase left rather than on another search.
pub trait ScanOp: TileOp {
    /// What the first phase needs. Columns that it writes, and columns that stages above wrote and
    /// [`TileOp::needs`] reads, are kept for the second.
    fn gather_needs(&self) -> Needs;

    /// The first phase, called for every tile, from several threads at once. What it appends to
    /// `found` is stored in the order of the tiles, which is that of their positions; the sequence
    /// over all tiles must not depend on how they are cut, or only sums of it may be used.
    fn gather(&self, tile: &mut Tile, found: &mut Vec<[u64; 2]>, tally: &mut Tally) -> Result<()>;

    /// Called once, between the phases. Returns what the user is to be warned of.
    fn conclude(&mut self, found: &dyn Gathered) -> Result<Option<String>>;
}

/// What the tiles of a [`ScanOp`]'s first phase found, wherever it is stored.
pub trait Gathered {
    /// Calls `visit` with all of it, stretch after stretch in the order of the tiles; as often as one
    /// likes.
    fn each(&self, visit: &mut dyn FnMut(&[[u64; 2]]) -> Result<()>) -> Result<()>;

    /// Records that the stage decides about.
    fn records(&self) -> u64;
}

/// Where records go. A sink writes below the path it is given; the run puts the finished file in
/// its final place.
pub trait Sink: Send {
    /// Records that one [`Encode::encode`] takes; only the last may have fewer.
    fn chunk_points(&self) -> usize;

    /// Bytes that encoding one chunk holds, output included.
    fn chunk_bytes(&self) -> u64;

    /// The encoder, shared by all threads.
    fn encoder(&self) -> Arc<dyn Encode>;

    /// Writes one chunk; called in canonical order, from one thread at a time.
    fn append(&mut self, chunk: Encoded) -> Result<()>;

    /// Writes what depends on all points (header counts, chunk table) and flushes to disk.
    fn finish(self: Box<Self>) -> Result<SinkSummary>;
}

/// The part of a sink that runs on several threads at once.
pub trait Encode: Send + Sync {
    /// Encodes up to `chunk_points` records of the source's schema.
    fn encode(&self, batch: &PointBatch) -> Result<Encoded>;
}

/// An encoded chunk and the figures that a header needs.
#[derive(Debug, Clone, Default)]
pub struct Encoded {
    /// The bytes to append.
    pub bytes: Vec<u8>,
    /// Points in them.
    pub points: u64,
    /// Smallest stored X, Y, Z (formats with integer coordinates).
    pub lo: [i64; 3],
    /// Largest stored X, Y, Z.
    pub hi: [i64; 3],
    /// Points by return number, 1 to 15 (formats that count them).
    pub returns: [u64; 15],
    /// Points that a conversion rounded, and by how much at most, in world units.
    pub rounded: Option<(u64, f64)>,
    /// In which of its forms a format wrote the chunk; 0 where it has one.
    pub form: u8,
}

/// What a sink says when it is done.
#[derive(Debug, Clone, Default)]
pub struct SinkSummary {
    /// Points written.
    pub points: u64,
    /// Bytes of the finished file.
    pub bytes: u64,
    /// Things the user should know (rounding of a conversion, for example).
    pub notes: Vec<String>,
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

    /// True if each input gets an output of its own, in the folder [`path`](CreateSink::path).
    fn is_folder(&self) -> bool {
        false
    }

    /// The sinks of the `inputs`, in their order, if each input gets an output of its own: this one
    /// then is not created, and its [`chunk`](CreateSink::chunk) is as large as any of theirs. They
    /// are created one after the other, each with [`Source::metadata_of`] its input, and an input of
    /// which no record is kept gets its output too.
    ///
    /// Fails if two outputs would have one name; that none replaces an input is the plan's to check.
    /// Makes nothing: the folder is made by the run.
    fn each_input(&self, _inputs: &[Input]) -> Result<Option<Vec<Box<dyn CreateSink>>>> {
        Ok(None)
    }

    /// The order in which records are wanted.
    fn order(&self) -> Order;

    /// True if records that come in canonical order may be ordered by time within a chunk, because
    /// the output is smaller then.
    fn likes_time(&self) -> bool {
        false
    }

    /// True if its records still refer to the file beside the input ([`Input::beside`]), so that a
    /// copy is to be beside the output.
    fn wants_beside(&self) -> bool {
        false
    }

    /// True if it writes the normals that a stage computed.
    fn wants_normals(&self) -> bool;

    /// The dimensions of its records that it does not look at.
    fn unread(&self) -> &[String] {
        &[]
    }

    /// The chunks of the output that [`create`](CreateSink::create) would open, for a plan of the
    /// memory. Fails where `create` would refuse the schema.
    fn chunk(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<ChunkSize>;

    /// Bytes that each record takes on the disk at least while the output is written, and those that
    /// it may take besides, where a format writes a file anew; 0 where only the encoded records tell.
    fn disk_bytes(&self, _schema: &Arc<Schema>, _metadata: &Metadata) -> Result<[u64; 2]> {
        Ok([0; 2])
    }

    /// What the output will not hold though the input has it, and nobody was asked; for a plan.
    fn warnings(&self, _schema: &Schema, _metadata: &Metadata) -> Vec<String> {
        Vec::new()
    }

    /// Fails on a record that the output cannot hold, for a plan that looks at some before it begins.
    fn check(&self, _metadata: &Metadata, _records: &PointBatch) -> Result<()> {
        Ok(())
    }

    /// True if [`check`](CreateSink::check) may fail for records of `schema`.
    fn checks(&self, _schema: &Schema) -> bool {
        false
    }

    /// Checks that the format holds every dimension (or that the user dropped it) and opens the
    /// output at `staged`, a path beside the final one. With `whole`, every record of the source
    /// will come, in its order: what refers to records by number stays true.
    fn create(
        &self,
        staged: &Path,
        schema: &Arc<Schema>,
        metadata: &Metadata,
        whole: bool,
    ) -> Result<Box<dyn Sink>>;
}

/// Order of an output's records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
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

/// A stage in its role.
pub enum Role {
    /// Yields records.
    Source(Box<dyn OpenSource>),
    /// Streams.
    Transform(Box<dyn Transform>),
    /// Works on tiles.
    TileOp(Box<dyn TileOp>),
    /// Works on tiles twice: gathers, then decides.
    ScanOp(Box<dyn ScanOp>),
    /// Takes records.
    Sink(Box<dyn CreateSink>),
}

/// Everything a plan can check before a run.
#[derive(Debug, Clone, Default)]
pub struct Needs {
    /// Dimensions or columns read ("Normal", "Cell" and "Figure" are columns).
    pub reads: Vec<String>,
    /// Dimensions or columns written.
    pub writes: Vec<String>,
    /// Nearest other positions that each position's result is computed from; 0 for none.
    pub neighbors: usize,
    /// True if it may come to take fewer, once the scan is known.
    pub fewer_neighbors: bool,
    /// Side in lattice steps of the cells whose points are decided together; 0 for none (or not
    /// settled yet).
    pub cell_side: i64,
    /// True if it decides about the points of a cell together, also while their side is not settled.
    pub cells: bool,
    /// True if cells of that side are octree nodes, so that no tile face cuts one.
    pub cell_aligned: bool,
    /// Working memory per position of the tile, rim included.
    pub bytes_per_point: usize,
    /// True if it removes points.
    pub removes: bool,
    /// How it marks records instead of removing any, if it does.
    pub mark: Option<Mark>,
    /// How often the stages from the last that wrote "Normal" to this one are applied, each time to
    /// what the time before left; 0 is 1.
    pub passes: usize,
}

/// What is known of the whole scan after the decode.
pub struct ScanFacts<'a> {
    /// Records.
    pub points: u64,
    /// Distinct positions.
    pub positions: u64,
    /// Tight box of the positions.
    pub bounds: Bounds,
    /// Where lattice steps are in the world.
    pub lattice: &'a Lattice,
    /// Occupied cubes of every power-of-two side.
    pub levels: &'a Levels,
}
