//! Cutting the decoded scan into tiles that fit the memory, wide enough for the stages' cells.

use super::job::Job;
use super::passes::{Pass, StageOp};
use super::shares::{Demands, Shares};
use crate::budget::whole_mebibytes;
use crate::geom::lattice::Lattice;
use crate::tile::{CutError, SealedTiles, TileKey};
use crate::{Error, Result};

/// How far beyond its cube a tile's columns must be right: the sides of the cells that its faces
/// may cut, which add along the chain.
pub(super) fn reach(ops: &[StageOp], pass: &Pass) -> i64 {
    pass.needs(ops)
        .filter(|needs| !needs.cell_aligned)
        .fold(0, |sum, needs| sum.saturating_add(needs.cell_side))
}

pub(super) fn neighbors(ops: &[StageOp], pass: &Pass) -> usize {
    pass.needs(ops).map(|needs| needs.neighbors).max().unwrap_or(0)
}

/// Tiles are at least four cells wide, or their zones would be mostly their neighbours'.
const CELLS_ACROSS: u64 = 4;

/// The tiles of a pass and the positions that an arena for them takes: as planned, or, where a cube
/// that cannot be cut holds more, what the memory left after the decode can give.
pub(super) fn cut(
    job: &Job<'_>,
    pass: &Pass,
    lattice: &Lattice,
    shares: &Shares,
    demands: &Demands,
    tiles: &SealedTiles,
) -> Result<(Vec<TileKey>, usize)> {
    let side = pass.needs(&job.ops).map(|needs| needs.cell_side).max().unwrap_or(0);
    let lowest = match u64::try_from(side).unwrap_or(0).saturating_mul(CELLS_ACROSS) {
        0 => 0,
        wide => wide.checked_next_power_of_two().map_or(64, u64::ilog2),
    };
    let wanted = job.tile_points.map_or(zone_of(shares.tile_positions), |points| points as u64);
    let reach = reach(&job.ops, pass);
    let free = demands.tile_positions(job.budget.free());
    let mut capacity = shares.tile_positions;
    loop {
        // Around all positions there is no rim.
        let all = capacity as u64 >= tiles.positions();
        let most = if all { tiles.positions() } else { zone_of(capacity) };
        match tiles.cut(wanted, most, reach, lowest) {
            Ok(keys) => return Ok((keys, capacity)),
            Err(CutError::Read(error)) => return Err(error),
            Err(CutError::TooHeavy { .. }) if capacity < free => capacity = free,
            Err(CutError::TooHeavy { key, positions }) => {
                let tile = (2 * positions + 1).min(tiles.positions());
                let limit = demands.limit_for_tile(tile);
                return Err(too_heavy(lattice, key, (positions, most), limit));
            }
        }
    }
}

/// Positions of a tile's zone: half of its memory is for them, the other half for the rim.
fn zone_of(tile_positions: usize) -> u64 {
    (tile_positions / 2) as u64
}

/// The error of a cube that cannot be cut and holds more positions than the most that fit.
fn too_heavy(lattice: &Lattice, key: TileKey, (positions, most): (u64, u64), limit: u64) -> Error {
    let (lo, hi) = (lattice.world(key.cube().lo), lattice.world(key.cube().hi));
    let limit = whole_mebibytes(limit);
    Error::memory(format!(
        "the cube from {lo:?} to {hi:?} and the cells around it hold {positions} positions, more \
         than the {most} that a tile may have"
    ))
    .help(format!(
        "give `run.memory = \"{limit}\"` or more, fewer `run.threads`, or a smaller cell side"
    ))
}
