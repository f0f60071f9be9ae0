//! What there is to choose from.

use super::tile::{RoundScan, RoundWorker};
use crate::Result;
use crate::engine::cut::cut_round;
use crate::engine::grind::DecodedScan;
use crate::engine::job::Job;
use crate::point::Position;
use crate::stage::Round;
use crate::store::{KeptPoints, Levels};
use crate::tile::Sieve;

/// Occupied cubes of the positions that the stage decides about, and how many records these have.
pub(super) fn candidates(
    job: &Job<'_>,
    op: usize,
    field: &DecodedScan<'_>,
    sieve: &Sieve,
    capacity: usize,
) -> Result<(Levels, u64)> {
    let is_all = !sieve.is_fine(&field.tiles) && job.ops[op].selection == 0;
    if is_all {
        return Ok((field.tiles.levels().clone(), field.tiles.points()));
    }
    let round = Round::counting();
    let cut = cut_round(job, &field.tiles, field.lattice, &round, capacity)?;
    let scan = RoundScan { op, number: 0, field, sieve, capacity };
    let none = KeptPoints::new(&job.area);
    let (mut all, mut records, mut last) = (Levels::default(), 0, None);
    job.items(cut.keys.len()).run(
        || RoundWorker::new(job, &scan, &round, cut.capacity),
        |worker, index| {
            let of_tile = worker.load(cut.keys[index], &none)?;
            let positions = worker.positions();
            job.advance(0)?;
            let mut levels = Levels::default();
            positions.windows(2).for_each(|pair| levels.add(Some(pair[0]), pair[1]));
            let ends = positions.first().copied().zip(positions.last().copied());
            Ok((levels, ends, of_tile))
        },
        |(levels, ends, of_tile): (Levels, Option<(Position, Position)>, u64)| {
            records += of_tile;
            let Some((first, end)) = ends else { return };
            all.add(last, first);
            all.merge(&levels);
            last = Some(end);
        },
        |_| Ok(()),
    )?;
    Ok((all, records))
}
