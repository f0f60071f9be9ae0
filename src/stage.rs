//! The roles a stage can play and what it tells the plan. Roles are closed, stages are open: an
//! embedding program adds its own by implementing one of these traits.

mod format;
mod kind;
mod sink;
mod source;

use crate::Result;
use crate::geom::lattice::Lattice;
use crate::point::{Bounds, Mark, PointBatch, Schema, Units};
use crate::report::Tally;
use crate::store::Levels;
use crate::tile::Tile;

pub use format::{Colors, Format, FormatName, Formats, OutputEncoding, WriteKeys, foreign};
pub use kind::{StageKind, StagePlace};
pub use sink::{ChunkSize, CreateSink, Encode, Encoded, Order, Sink, SinkSummary};
pub use source::{Contradiction, Input, OpenSource, Part, Source};

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

    /// What it was asked to do and did not, where it removed no point of a scan whose records are
    /// of a schema. It need not repeat its [`warnings`](Transform::warnings).
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

    /// The lengths that it was given, in the scan's unit, each with its key as in `grid.side`;
    /// those that the lattice cannot hold are refused before the work.
    fn lengths(&self) -> Vec<(&'static str, f64)> {
        Vec::new()
    }

    /// Called once, after the decode and before the first tile, with what is known of the whole
    /// scan: the place to fix figures that depend on it.
    fn settle(&mut self, _scan: &ScanFacts) -> Result<()> {
        Ok(())
    }

    /// What the user should know of a stage that is settled: lengths that the lattice rounds. Keys
    /// are named with their stage, as in `` `grid.side = 0.15` ``.
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

    /// The side in lattice steps of what it decides together, if it wants to look at samples of the
    /// scan a few times as wide, after `settle` and before the first tile.
    fn sample_side(&self) -> Option<i64> {
        None
    }

    /// Called for each of a few hundred small cubes, spread evenly over the records, in order,
    /// after the stages above have run on it. What it returns goes to
    /// [`forecast`](TileOp::forecast).
    fn sample(&self, _tile: &mut Tile) -> Result<Vec<f64>> {
        Ok(Vec::new())
    }

    /// Says what is to be expected of the whole scan, a function of what the samples said, in
    /// order, and fixes what depends on it: the pass is cut into tiles afterwards, and
    /// [`needs`](TileOp::needs) is asked again. It may not need more bytes or neighbours than it
    /// said before.
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
    /// Calls `visit` with all of it, stretch after stretch in the order of the tiles; as often as
    /// one likes.
    fn each(&self, visit: &mut dyn FnMut(&[[u64; 2]]) -> Result<()>) -> Result<()>;

    /// Records that the stage decides about.
    fn records(&self) -> u64;
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
    /// True if it decides about the points of a cell together, also while their side is not
    /// settled.
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
