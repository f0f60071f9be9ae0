//! A look at a sample of the scan before a pass, from which stages say what is to be expected and
//! settle what the pipeline leaves to them.
//!
//! The sample is small cubes, spread evenly over the ranks of the positions, so that it is a
//! function of the points alone: tiles would depend on the memory, and points at random would have
//! no neighbours. The cubes are loaded like tiles, with a rim, and are items of a phase.

use super::grind::{DecodedScan, Worker};
use super::job::Job;
use super::pass::{Call, Pass, put_to_work};
use super::row::RowLayout;
use super::shares::Shares;
use crate::Result;
use crate::stage::Forecast;
use crate::store::{Reader, SealedTiles, TileKey};
use crate::tile::Sieve;

/// Cubes that are looked at, at most and at least.
const SAMPLES: (u64, u64) = (256, 32);
/// Between the two, one cube of so many: a look costs a small part of the pass.
const ONE_OF: u64 = 8;
/// Cells that a cube is wide, about: of one cell too little is seen to tell noise from shape.
const CELLS_ACROSS: u64 = 4;
/// Positions that a cube has on average, at most, however large the cells.
const MOST_POSITIONS: u64 = 2048;
/// Positions of a cube beyond which it is left out; as many fit into any plan's tiles.
const HEAVIEST: u64 = 8192;
/// Positions that are loaded around a cube and in it, at most.
const RIM: usize = 16_384;
/// Positions that a tile of a look takes.
const CAPACITY: usize = 32_768;

/// Positions that a tile of a look takes, of which each thread has one.
pub(crate) fn samples_capacity(shares: &Shares) -> usize {
    shares.tile_positions.min(CAPACITY)
}

/// What those of the stages `ops` of `pass` expect that look at samples, each with its number, from
/// samples that are a function of the points alone.
pub(crate) fn forecast(
    job: &mut Job<'_>,
    pass: &Pass,
    ops: &[usize],
    field: &DecodedScan<'_>,
    sieve: &Sieve,
) -> Result<Vec<(usize, Forecast)>> {
    let mut forecasts = Vec::new();
    for &op in ops {
        let Some(side) = job.ops[op].op.tile().sample_side() else { continue };
        let side = side.max(1);
        let keys = cubes(&field.tiles, side)?;
        let samples = samples(job, pass, op, field, sieve, &keys)?;
        forecasts.push((op, job.ops[op].op.tile_mut().forecast(&samples)));
    }
    Ok(forecasts)
}

/// What stage `op` says of the cubes `keys`, in their order, those left out that are too heavy.
fn samples(
    job: &Job<'_>,
    pass: &Pass,
    op: usize,
    field: &DecodedScan<'_>,
    sieve: &Sieve,
    keys: &[TileKey],
) -> Result<Vec<Vec<f64>>> {
    let capacity = samples_capacity(&job.shares);
    let mut samples = Vec::new();
    job.items(keys.len()).run(
        || {
            let mut worker = Worker::new(job, pass, field, sieve, capacity, &RowLayout::default());
            worker.limit_rim(RIM);
            (worker, Reader::default())
        },
        |(worker, reader), index| {
            job.advance(0)?;
            let key = keys[index];
            if field.tiles.holds_more(&key.cube(), HEAVIEST, reader)? {
                return Ok(None);
            }
            let (tile, _) = worker.run(key, Some(op))?;
            put_to_work(tile, &job.ops, Call { op, gathers: false });
            let figures = job.ops[op].op.tile().sample(tile)?;
            Ok(Some(figures.into_iter().map(f64::to_bits).collect::<Vec<_>>()))
        },
        // A figure may be no number, which not every form of text can hold: bits are always kept.
        |sample: Option<Vec<u64>>| {
            samples.extend(sample.map(|bits| bits.into_iter().map(f64::from_bits).collect()));
        },
        |_| Ok(()),
    )?;
    Ok(samples)
}

/// The octree nodes, a few times `side` steps wide, that hold positions spread evenly
/// over Morton order.
fn cubes(tiles: &SealedTiles, side: i64) -> Result<Vec<TileKey>> {
    let wide = (side as u64).saturating_mul(CELLS_ACROSS).checked_next_power_of_two();
    let level = wide.map_or(63, u64::ilog2);
    let level = level.min(tiles.levels().smallest_side(MOST_POSITIONS));
    let mut reader = Reader::default();
    let mut keys: Vec<TileKey> = Vec::new();
    let samples = tiles.levels().occupied(level) / ONE_OF;
    let samples = samples.clamp(SAMPLES.1, SAMPLES.0).min(tiles.positions());
    for n in 0..samples {
        let rank = (u128::from(tiles.positions()) * (2 * u128::from(n) + 1)
            / (2 * u128::from(samples))) as u64;
        let block = tiles.block_with(rank);
        let (positions, _) = tiles.read(block, &mut reader)?;
        let within = (rank - tiles.block(block).first_position) as usize;
        keys.extend(positions.get(within).map(|&p| TileKey::around(p, level)));
    }
    Ok(keys)
}
