//! Cutting the decoded scan into tiles that fit the memory, wide enough for the stages' cells.
//!
//! A tile is the smallest octree node that is not too heavy, found by counts of the decoded scan.
//! Tiles of one size would be chosen for the densest place and be nearly empty elsewhere; a density
//! guessed from headers would be wrong exactly where memory is short. A node much smaller than the
//! cells would be loaded mostly for its neighbours, so nodes are not cut below four cells unless
//! they do not fit otherwise.
//!
//! Where tiles are cut decides about speed alone, never about what stages compute.

use std::sync::Arc;

use super::job::Job;
use super::pass::{Pass, StageOp};
use super::shares::MILL_SPARE;
use crate::budget::{Bytes, Lease, whole_mebibytes};
use crate::geom::lattice::Lattice;
use crate::stage::Round;
use crate::store::{CutError, SealedTiles, TileKey};
use crate::{Error, Result};

/// How far beyond its cube a tile's columns must be right: the sides of the cells that its faces
/// may cut, which add along the chain.
pub(crate) fn reach(ops: &[StageOp], pass: &Pass) -> i64 {
    pass.needs(ops)
        .filter(|needs| !needs.cell_aligned)
        .fold(0, |sum, needs| sum.saturating_add(needs.cell_side))
}

pub(crate) fn neighbors(ops: &[StageOp], pass: &Pass) -> usize {
    pass.needs(ops).map(|needs| needs.neighbors).max().unwrap_or(0)
}

/// Tiles are at least four cells wide, or their zones would be mostly their neighbours'; one cell
/// where they would not fit otherwise.
const CELLS_ACROSS: u64 = 4;

/// The tiles of a pass.
pub(crate) struct TileCut {
    cells: CellWidths,
    pub keys: Vec<TileKey>,
    /// Positions that the arena of a thread takes.
    pub capacity: usize,
    /// Threads that have one: all, unless a tile is so heavy that the memory does not do for all.
    pub millers: usize,
    _listed: Lease,
}

/// What the tiles of passes depend on; equal for all passes of most pipelines.
#[derive(Clone, Copy, PartialEq, Eq)]
struct CellWidths {
    side: u64,
    reach: i64,
}

impl CellWidths {
    fn of(ops: &[StageOp], pass: &Pass) -> CellWidths {
        let side = pass.needs(ops).map(|needs| needs.cell_side).max().unwrap_or(0);
        CellWidths { side: u64::try_from(side).unwrap_or(0), reach: reach(ops, pass) }
    }

    /// The level of the smallest octree node that is `across` cells wide.
    fn level(self, across: u64) -> u32 {
        match self.side.saturating_mul(across) {
            0 => 0,
            wide => wide.checked_next_power_of_two().map_or(64, u64::ilog2),
        }
    }
}

/// The tiles of every pass, before the first begins: a scan too heavy for the memory is refused
/// when nothing but its decode is lost.
pub(crate) fn cut_all(
    job: &Job<'_>,
    lattice: &Lattice,
    tiles: &SealedTiles,
) -> Result<Vec<Arc<TileCut>>> {
    let mut known: Vec<(CellWidths, Arc<TileCut>)> = Vec::new();
    let mut cuts = Vec::new();
    for pass in &job.task.passes {
        let cells = CellWidths::of(&job.ops, pass);
        let cut = match known.iter().find(|(same, _)| *same == cells) {
            Some((_, cut)) => cut.clone(),
            None => Arc::new(cut(job, cells, lattice, tiles, 0)?),
        };
        known.push((cells, cut.clone()));
        cuts.push(cut);
    }
    Ok(cuts)
}

/// The tiles of a pass whose stages may have chosen other cells since `made` was cut; the mill
/// holds `held` bytes already.
pub(crate) fn cut_again(
    job: &Job<'_>,
    pass: &Pass,
    lattice: &Lattice,
    tiles: &SealedTiles,
    made: &Arc<TileCut>,
    held: u64,
) -> Result<Arc<TileCut>> {
    let cells = CellWidths::of(&job.ops, pass);
    match cells == made.cells {
        true => Ok(made.clone()),
        false => cut(job, cells, lattice, tiles, held).map(Arc::new),
    }
}

/// The tiles of a pass and the positions that an arena for them takes: as planned; or, where a cube
/// holds more, what the memory left after the decode can give; or cubes of a cell; or arenas of
/// fewer threads.
fn cut(
    job: &Job<'_>,
    cells: CellWidths,
    lattice: &Lattice,
    tiles: &SealedTiles,
    held: u64,
) -> Result<TileCut> {
    let (shares, demands) = (&job.shares, &job.task.demands);
    let wanted =
        job.task.tile_points().map_or(zone_of(shares.tile_positions), |points| points as u64);
    let later = demands.gathered(shares) + MILL_SPARE;
    let free = (job.budget.free() + held).saturating_sub(later.0);
    let largest = demands.tile_positions(job.threads.count(), free).max(shares.tile_positions);
    let (good, lowest) = (cells.level(CELLS_ACROSS), cells.level(1));
    let mut tries =
        vec![(shares.tile_positions, good), (largest, good), (largest, lowest)].into_iter();
    let mut millers = job.threads.count();
    let mut at = tries.next();
    while let Some((capacity, smallest)) = at {
        // Around all positions there is no rim.
        let all = capacity as u64 >= tiles.positions();
        let most = if all { tiles.positions() } else { zone_of(capacity) };
        let (key, positions) = match tiles.cut(wanted, most, cells.reach, (good, smallest)) {
            Ok(keys) => {
                let bytes = Bytes::of(keys.len() as u64, size_of::<TileKey>());
                let _listed = job.budget.lease(bytes.0, "list of tiles")?;
                return Ok(TileCut { cells, keys, capacity, millers, _listed });
            }
            Err(CutError::Read(error)) => return Err(error),
            Err(CutError::TooHeavy { key, positions }) => (key, positions),
        };
        at = tries.next();
        if at.is_none() {
            let found = (key, positions);
            let (key, positions) = heaviest(tiles, wanted, cells.reach, (good, lowest), found)?;
            let tile = positions.saturating_mul(2).saturating_add(1).min(tiles.positions());
            let fits = |millers: &usize| demands.tile_positions(*millers, free) as u64 >= tile;
            let Some(fewer) = (1..millers).rev().find(fits) else {
                let limit = demands.limit_for_tile(1, tile);
                let error = too_heavy(lattice, key, positions, most);
                let smaller = smaller(&job.ops);
                return Err(error.help(remedy(limit, &smaller, held == 0 && is_sampled(job))));
            };
            let enough = whole_mebibytes(demands.limit_for_tile(millers, tile));
            job.warn(format!(
                "{positions} points lie so close that their tile leaves memory for {fewer} of \
                 {millers} threads; `run.memory = \"{enough}\"` does for all"
            ));
            (millers, at) = (fewer, Some((demands.tile_positions(fewer, free), lowest)));
        }
    }
    Err(Error::internal("a tile fits and does not"))
}

/// The heaviest of the cubes that cannot be cut, of which one was found: a memory that does for
/// that one does for all. Each try passes over all that are no heavier than the last.
fn heaviest(
    tiles: &SealedTiles,
    wanted: u64,
    reach: i64,
    levels: (u32, u32),
    mut found: (TileKey, u64),
) -> Result<(TileKey, u64)> {
    loop {
        match tiles.cut(wanted, found.1, reach, levels) {
            Ok(_) => return Ok(found),
            Err(CutError::Read(error)) => return Err(error),
            Err(CutError::TooHeavy { key, positions }) => found = (key, positions),
        }
    }
}

/// Positions of a tile's zone: half of its memory is for them, the other half for the rim.
fn zone_of(tile_positions: usize) -> u64 {
    (tile_positions / 2) as u64
}

/// The error of a cube that cannot be cut and holds more positions than the most that fit.
fn too_heavy(lattice: &Lattice, key: TileKey, positions: u64, most: u64) -> Error {
    let (lo, hi) = (lattice.world(key.cube().lo), lattice.world(key.cube().hi));
    Error::memory(format!(
        "the cube from {lo:?} to {hi:?} and the cells around it hold {positions} positions, more \
         than the {most} that a tile may have"
    ))
}

/// True if a stage may choose wider cells than those that are cut by now.
fn is_sampled(job: &Job<'_>) -> bool {
    let sampled = |op: &StageOp| op.op.tile().sample_side().is_some();
    job.ops.iter().any(sampled)
}

/// What makes tiles lighter besides memory: a shorter length of the stage with the widest cells.
fn smaller(ops: &[StageOp]) -> String {
    let widest = ops.iter().max_by_key(|stage| stage.op.tile().needs().cell_side);
    let lengths = widest.map_or(Vec::new(), |stage| stage.op.tile().lengths());
    match lengths.first() {
        Some((key, _)) => format!("a smaller `{key}`"),
        None => "a smaller cell side".to_owned(),
    }
}

/// What does for the heaviest tile.
fn remedy(limit: u64, smaller: &str, may_grow: bool) -> String {
    let limit = whole_mebibytes(limit);
    match may_grow {
        false => format!("give `run.memory = \"{limit}\"` or more, or {smaller}"),
        true => format!(
            "give `run.memory = \"{limit}\"` at least, or {smaller}: a side that is chosen by \
             samples of the points is known behind this, and may take more"
        ),
    }
}

/// The tiles of a round.
pub(super) struct CutRound {
    pub keys: Vec<TileKey>,
    /// Positions that the arena of a thread takes.
    pub capacity: usize,
    _listed: Lease,
}

/// Tiles of a round at least, where there are so many positions: threads share them.
const ROUND_TILES: u64 = 16;
/// A round has no smaller tiles than these, rather than more of them.
const ROUND_POSITIONS: u64 = 16_384;

/// The tiles of a round of `pass`, in the memory that its mill has.
pub(super) fn cut_round(
    job: &Job<'_>,
    tiles: &SealedTiles,
    lattice: &Lattice,
    round: &Round,
    capacity: usize,
) -> Result<CutRound> {
    let share = round.looks.share();
    let of_all = |positions: u64| (positions as f64 / share).min(1e18) as u64;
    let few = (tiles.positions() / ROUND_TILES).max(of_all(ROUND_POSITIONS));
    let wanted = of_all(zone_of(capacity)).min(few);
    // A sample may be larger than its share.
    let most = of_all(capacity as u64 * 9 / 10);
    let cells = CellWidths { side: round.reach.unsigned_abs(), reach: round.reach };
    let levels = (cells.level(CELLS_ACROSS), cells.level(1).saturating_sub(3));
    match tiles.cut(wanted, most, cells.reach, levels) {
        Ok(keys) => {
            let bytes = Bytes::of(keys.len() as u64, size_of::<TileKey>());
            let _listed = job.budget.lease(bytes.0, "list of tiles")?;
            Ok(CutRound { keys, capacity, _listed })
        }
        Err(CutError::Read(error)) => Err(error),
        Err(CutError::TooHeavy { key, positions }) => {
            let needed = (positions as f64 * share) as u64 * 2;
            let limit = job.task.demands.limit_for_tile(job.threads.count(), needed);
            let error = too_heavy(lattice, key, positions, most);
            let enough = whole_mebibytes(limit);
            Err(error.help(format!("give `run.memory = \"{enough}\"` or more")))
        }
    }
}
