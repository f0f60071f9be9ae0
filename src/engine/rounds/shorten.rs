//! Some of what the last round kept, by chance.

use super::merged::MergedPoints;
use crate::Result;
use crate::engine::job::Job;
use crate::geom::hash::of_position;
use crate::geom::select::nth_largest;
use crate::store::{KeptPoints, KeptReader};

/// Blocks of kept points that an item reads.
const BLOCKS: usize = 64;

/// The same points but for those of the last round whose hash is too large.
pub(super) fn shorten(
    job: &Job<'_>,
    kept: &KeptPoints,
    number: u32,
    to: u64,
    seed: u64,
) -> Result<KeptPoints> {
    let mut reader = KeptReader::default();
    let mut of_last = |visit: &mut dyn FnMut(u64)| {
        for block in 0..kept.blocks() {
            kept.block(block, &mut reader)?;
            let each = reader.positions.iter().zip(&reader.rounds);
            let new = each.filter(|(_, round)| **round == number);
            new.for_each(|(p, _)| visit(!of_position(seed, *p)));
        }
        Ok(())
    };
    let mut there = 0;
    of_last(&mut |_| there += 1)?;
    let want = to.saturating_sub(kept.count() - there);
    let (least, mut ties) = nth_largest(want, of_last)?;
    let mut new = KeptPoints::new(&job.area);
    let mut reader = KeptReader::default();
    for first in (0..kept.blocks()).step_by(BLOCKS) {
        let mut merged = MergedPoints::default();
        for block in first..(first + BLOCKS).min(kept.blocks()) {
            kept.block(block, &mut reader)?;
            for (&p, &round) in reader.positions.iter().zip(&reader.rounds) {
                let hash = !of_position(seed, p);
                let is_tied = hash == least && ties > 0;
                ties -= u64::from(round == number && is_tied);
                if round != number || hash > least || is_tied {
                    merged.push(p, round);
                }
            }
        }
        let blocks = new.pack(&merged.positions, &merged.rounds)?;
        new.enter(blocks)?;
    }
    Ok(new)
}
