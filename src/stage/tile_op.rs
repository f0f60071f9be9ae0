//! Stages that work on tiles.

use super::needs::Needs;
use crate::Result;
use crate::geom::lattice::Lattice;
use crate::point::{Bounds, Units};
use crate::report::Tally;
use crate::store::Levels;
use crate::tile::Tile;

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
