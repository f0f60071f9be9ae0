//! The roles a stage can play and what it tells the plan. Roles are closed, stages are open: an
//! embedding program adds its own by implementing one of these traits.

mod format;
mod kind;
mod sink;
mod source;

use crate::Result;
use crate::point::{Bounds, Mark, PointBatch, Schema, Units};
use crate::report::Tally;
use crate::tile::Tile;

pub use crate::geom::lattice::{Lattice, Misplaced};
pub use crate::store::Levels;
pub use format::{
    Colors, CreateFor, Format, FormatName, Formats, OutputEncoding, WriteKeys, foreign,
};
pub use kind::{StageKind, StagePlace};
pub use sink::{ChunkSize, CreateSink, Encode, Encoded, Order, Sink, SinkSummary};
pub use source::{Contradiction, Input, OpenSource, Part, Source};

/// Changes or removes points as they stream by; knows no neighbours.
///
/// ```
/// use pointmill::Result;
/// use pointmill::point::{PointBatch, names};
/// use pointmill::stage::{Needs, Transform};
///
/// /// Leaves every second point of a batch out.
/// struct Half;
///
/// impl Transform for Half {
///     fn needs(&self) -> Needs {
///         // That coordinates are there is checked before the run.
///         let reads = names::XYZ.map(str::to_owned).to_vec();
///         Needs { reads, removes: true, ..Needs::default() }
///     }
///
///     fn apply(&self, batch: &mut PointBatch) -> Result<()> {
///         batch.retain(|number, _record| number % 2 == 0);
///         Ok(())
///     }
/// }
/// # let _: Box<dyn Transform> = Box::new(Half);
/// ```
pub trait Transform: Send + Sync {
    /// What it reads and writes.
    fn needs(&self) -> Needs;

    /// Refuses records of a schema that it cannot work on; called once, before any of them is read.
    ///
    /// # Errors
    ///
    /// What it cannot work on, said with the dimension.
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
    ///
    /// # Errors
    ///
    /// A record that it cannot make sense of; the run ends.
    fn apply(&self, batch: &mut PointBatch) -> Result<()>;
}

/// Computes on a tile and its neighbourhood; independent of other tiles and of any order.
///
/// ```
/// use pointmill::Result;
/// use pointmill::ops::removal;
/// use pointmill::report::Tally;
/// use pointmill::stage::{Needs, TileOp};
/// use pointmill::tile::{Fate, Tile};
///
/// /// Removes what has no other position within 10 lattice steps.
/// struct Lonely;
///
/// impl TileOp for Lonely {
///     fn needs(&self) -> Needs {
///         Needs { neighbors: 1, removes: true, ..Needs::default() }
///     }
///
///     fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
///         let (mut lonely, core) = (Vec::new(), tile.core.clone());
///         tile.each_neighborhood(1, |i, nearest| {
///             if core.contains(&i) && nearest.farthest2() > 10 * 10 {
///                 lonely.push(i);
///             }
///         })?;
///         let removed = lonely.into_iter().map(|i| removal::remove(tile, i)).sum();
///         tally.remove("lonely", "alone", removed);
///         Ok(())
///     }
/// }
///
/// let mut tile = Tile::of(vec![[0, 0, 0], [3, 0, 0], [500, 0, 0]]);
/// Lonely.run(&mut tile, &mut Tally::default())?;
/// assert_eq!(tile.fates, [Fate::Kept, Fate::Kept, Fate::Removed]);
/// # Ok::<(), pointmill::Error>(())
/// ```
pub trait TileOp: Send + Sync {
    /// What it needs; asked again after [`settle`](TileOp::settle).
    fn needs(&self) -> Needs;

    /// Called once, when the headers are read: lengths that were given with a unit of their own are
    /// converted to the scan's.
    ///
    /// # Errors
    ///
    /// A length with a unit, where the scan's is not known.
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
    ///
    /// # Errors
    ///
    /// Figures that the scan does not allow.
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
    ///
    /// # Errors
    ///
    /// Those of the tile's neighbourhoods, and broken promises of the engine; the run ends.
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
    ///
    /// # Errors
    ///
    /// As [`run`](TileOp::run).
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
#[non_exhaustive]
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
    ///
    /// # Errors
    ///
    /// As [`run`](TileOp::run).
    fn gather(&self, tile: &mut Tile, found: &mut Vec<[u64; 2]>, tally: &mut Tally) -> Result<()>;

    /// Called once, between the phases. Returns what the user is to be warned of.
    ///
    /// # Errors
    ///
    /// Those of reading what was found.
    fn conclude(&mut self, found: &dyn Gathered) -> Result<Option<String>>;
}

/// What the tiles of a [`ScanOp`]'s first phase found, wherever it is stored.
pub trait Gathered {
    /// Calls `visit` with all of it, stretch after stretch in the order of the tiles; as often as
    /// one likes.
    ///
    /// # Errors
    ///
    /// Those of reading it, and of `visit`.
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
#[non_exhaustive]
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

impl<'a> ScanFacts<'a> {
    /// A scan of so many records whose distinct positions have the tight box `bounds` and are
    /// counted by `levels`.
    pub fn new(points: u64, bounds: Bounds, lattice: &'a Lattice, levels: &'a Levels) -> Self {
        ScanFacts { points, positions: levels.positions(), bounds, lattice, levels }
    }
}
