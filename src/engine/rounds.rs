//! Rounds of a stage that chooses what stays by what it chose before.
//!
//! A round goes over all tiles, as a pass does; but its tiles are cut for how little of the scan it
//! looks at, and it leaves nothing but points: those that its tiles keep, or offers, of which the
//! best of the whole scan are kept. So a scan that is larger than memory is chosen from as a whole,
//! as many times as the stage asks for, and each time only kept points and offers are written.

mod beside;
mod candidates;
mod merged;
mod offers;
mod shorten;
mod tile;

use std::collections::VecDeque;
use std::sync::Arc;

use super::cut::{CutRound, cut_round};
use super::grind::DecodedScan;
use super::job::Job;
use super::pass::Op;
use crate::host::PhaseItems;
use crate::stage::{NextRound, Round, RoundChoice, SoFar};
use crate::store::{Block, KeptPoints, TileKey};
use crate::tile::Sieve;
use crate::{Error, Result};

pub(super) use beside::MeasuredGrid;
use beside::measure_beside;
use candidates::candidates;
use merged::MergedPoints;
use offers::{OfferReader, Offers, accept};
use shorten::shorten;
use tile::{RoundScan, RoundWorker};

/// Rounds that can be undone.
const UNDONE: usize = 2;

/// Lets the stage `op` choose in rounds, over what `sieve` lets a pass see. What was measured of a
/// voxel grid beside it.
pub(super) fn choose(
    job: &mut Job<'_>,
    op: usize,
    field: &DecodedScan<'_>,
    sieve: &Sieve,
    capacity: usize,
) -> Result<Option<MeasuredGrid>> {
    let (levels, records) = candidates(job, op, field, sieve, capacity)?;
    let mut kept = KeptPoints::new(&job.area);
    let mut last: VecDeque<KeptPoints> = VecDeque::new();
    let (mut number, mut added, mut counted, mut least) = (0, 0, 0, 0.0);
    let mut before = None;
    let grid = loop {
        let bounds = field.tiles.bounds();
        let kept_now = kept.count();
        let so_far =
            SoFar { levels: &levels, records, bounds, kept: kept_now, added, counted, least };
        let scan = RoundScan { op, number, field, sieve, capacity };
        match stage(job, op)?.next(&so_far)? {
            NextRound::Round(round) => {
                let (new, found, left) = scan.round(job, &round, &kept, before.take())?;
                least = left.as_ref().map_or(0.0, |left| left.least);
                before = left;
                (added, counted) = (new.count() - kept.count(), found);
                last.push_back(std::mem::replace(&mut kept, new));
                while last.len() > UNDONE {
                    last.pop_front();
                }
                number += 1;
            }
            NextRound::Shorten { to, seed } => {
                before = None;
                kept = shorten(job, &kept, number.saturating_sub(1), to, seed)?;
                added = kept.count() - last.back().map_or(0, KeptPoints::count);
            }
            NextRound::Undo { rounds } => {
                before = None;
                for _ in 0..rounds {
                    let more = || Error::internal("more rounds are undone than there were");
                    kept = last.pop_back().ok_or_else(more)?;
                }
                added = 0;
            }
            NextRound::Again => {
                before = None;
                last.clear();
                kept = KeptPoints::new(&job.area);
                (number, added, counted) = (0, 0, 0);
            }
            NextRound::Done => break stage(job, op)?.beside(&so_far),
        }
    };
    drop((last, before));
    let scan = RoundScan { op, number, field, sieve, capacity };
    let beside = grid.map(|grid| measure_beside(job, &scan, (&levels, records), grid));
    let beside = beside.transpose()?.flatten();
    stage(job, op)?.chosen(Arc::new(kept));
    Ok(beside)
}

/// The stage that chooses.
fn stage<'j>(job: &'j mut Job<'_>, op: usize) -> Result<&'j mut dyn crate::stage::RoundOp> {
    match &mut job.ops[op].op {
        Op::Round(op) => Ok(&mut **op),
        _ => Err(Error::internal("a stage is to choose in rounds and does not")),
    }
}

/// What a round left that offered.
struct OfferedBefore {
    round: Round,
    keys: Vec<TileKey>,
    /// The lowest score of the best of them.
    least: f64,
    offers: Offers,
}

impl OfferedBefore {
    /// The offers, if they are of the same tiles and positions as those of `round` are.
    fn of(&self, round: &Round, keys: &[TileKey]) -> Option<&Offers> {
        let alike = |r: &Round| (r.looks, r.reach, r.kept_reach);
        (alike(&self.round) == alike(round) && self.keys == *keys).then_some(&self.offers)
    }
}

/// What is kept behind a round, what its tiles counted, and what it leaves for the next.
type RoundOutcome = (KeptPoints, u64, Option<OfferedBefore>);

impl RoundScan<'_> {
    fn round(
        &self,
        job: &Job<'_>,
        round: &Round,
        kept: &KeptPoints,
        before: Option<OfferedBefore>,
    ) -> Result<RoundOutcome> {
        let cut = cut_round(job, &self.field.tiles, self.field.lattice, round, self.capacity)?;
        match round.choice {
            RoundChoice::InTile => {
                let (new, counted) = self.keep(job, round, kept, &cut)?;
                Ok((new, counted, None))
            }
            RoundChoice::Best { want, reach } => {
                let last = before.as_ref().and_then(|before| before.of(round, &cut.keys));
                let (offers, counted) = self.offers(job, round, kept, &cut, last)?;
                drop(before);
                let chosen = offers.best(want)?;
                let least = chosen.least();
                let new = accept(job, &cut.keys, &chosen, reach, kept, self.number)?;
                let left =
                    OfferedBefore { round: *round, keys: cut.keys, least, offers: chosen.all() };
                Ok((new, counted, Some(left)))
            }
        }
    }

    /// Keeps what tiles say.
    fn keep(
        &self,
        job: &Job<'_>,
        round: &Round,
        kept: &KeptPoints,
        cut: &CutRound,
    ) -> Result<(KeptPoints, u64)> {
        let mut new = KeptPoints::new(&job.area);
        let (mut blocks, mut counted) = (Vec::new(), 0);
        items(job, cut).run(
            || RoundWorker::new(job, self, round, cut.capacity),
            |worker, index| {
                let found = worker.run(cut.keys[index], kept, None)?;
                let chosen = found.keep.iter().map(|&i| found.positions[i as usize]);
                let merged = MergedPoints::of(found.kept, chosen, self.number);
                job.advance(0)?;
                Ok((new.pack(&merged.positions, &merged.rounds)?, found.counted))
            },
            |(of_tile, counts): (Vec<Block>, u64)| {
                blocks.extend(of_tile);
                counted += counts;
            },
            |_| Ok(()),
        )?;
        new.enter(blocks)?;
        Ok((new, counted))
    }

    /// What tiles offer.
    fn offers(
        &self,
        job: &Job<'_>,
        round: &Round,
        kept: &KeptPoints,
        cut: &CutRound,
        before: Option<&Offers>,
    ) -> Result<(Offers, u64)> {
        let mut offers = Offers::new(&job.area);
        let (mut stretches, mut counted) = (Vec::new(), 0);
        items(job, cut).run(
            || (RoundWorker::new(job, self, round, cut.capacity), OfferReader::default()),
            |(worker, last), index| {
                if let Some(before) = before {
                    before.load(index, last)?;
                }
                let last = before.map(|_| &last.offers[..]);
                let found = worker.run(cut.keys[index], kept, last)?;
                job.advance(0)?;
                Ok((offers.store(found.offers)?, found.counted))
            },
            |(of_tile, counts)| {
                stretches.push(of_tile);
                counted += counts;
            },
            |_| Ok(()),
        )?;
        offers.enter(stretches);
        Ok((offers, counted))
    }
}

fn items<'j>(job: &'j Job<'_>, cut: &CutRound) -> PhaseItems<'j, impl Fn() + Sync> {
    job.items(cut.keys.len())
}
