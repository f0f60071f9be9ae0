//! Stages that work on tiles.

use std::path::PathBuf;

use super::needs::Needs;
use crate::Result;
use crate::geom::lattice::Lattice;
use crate::point::{Bounds, Units};
use crate::quantity::Length;
use crate::report::Tally;
use crate::store::Levels;
use crate::tile::Tile;

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
///         Needs::none().neighbors(1).removes(None)
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

    /// The lengths that it was given, each with its key as in `grid.side`: those that the lattice
    /// cannot hold are refused before the work, and the report says what others were converted to.
    fn lengths(&self) -> Vec<(&'static str, Length)> {
        Vec::new()
    }

    /// The files that say what it does, each with the key that names it: outputs note their hashes,
    /// as those of the inputs.
    fn files(&self) -> Vec<(&'static str, PathBuf)> {
        Vec::new()
    }

    /// Called before all else in a trial on a `share` of the scan, above 0 and at most 1: keys that
    /// count records of the whole scan count as many of that share from now on.
    fn for_share(&mut self, _share: f64) {}

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
