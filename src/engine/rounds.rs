//! Rounds of a stage that chooses what stays by what it chose before.
//!
//! A round goes over all tiles, as a pass does; but its tiles are cut for how little of the scan it
//! looks at, and it leaves nothing but points: those that its tiles keep, or offers, of which the
//! best of the whole scan are kept. So a scan that is larger than memory is chosen from as a whole,
//! as many times as the stage asks for, and each time only kept points and offers are written.

mod offers;
mod select;
mod tile;

use std::collections::VecDeque;
use std::sync::Arc;

use super::cut::{CutRound, cut_round};
use super::grind::DecodedScan;
use super::job::Job;
use super::pass::{Call, Op};
use crate::geom::hash::of_position;
use crate::host::PhaseItems;
use crate::point::Position;
use crate::stage::{Choice, NextRound, Round, SoFar};
use crate::store::{Block, KeptPoints, KeptReader, Levels, TileKey};
use crate::tile::Sieve;
use crate::{Error, Result};

use offers::{OfferReader, Offers, accept};
use select::nth_largest;
use tile::RoundWorker;

/// Rounds that can be undone.
const UNDONE: usize = 2;

/// Lets the stage `op` choose in rounds, over what `sieve` lets a pass see.
pub(super) fn choose(
    job: &mut Job<'_>,
    op: usize,
    field: &DecodedScan<'_>,
    sieve: &Sieve,
    capacity: usize,
) -> Result<()> {
    let (levels, records) = candidates(job, op, field, sieve, capacity)?;
    let mut kept = KeptPoints::new(&job.area);
    let mut last: VecDeque<KeptPoints> = VecDeque::new();
    let (mut number, mut added, mut counted, mut least) = (0, 0, 0, 0.0);
    let mut before = None;
    loop {
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
            NextRound::Done => break,
        }
    }
    drop(last);
    stage(job, op)?.chosen(Arc::new(kept));
    Ok(())
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
    fn of(&self, round: &Round, keys: &RoundKeys) -> Option<&Offers> {
        let alike = |r: &Round| (r.looks, r.reach, r.kept_reach);
        (alike(&self.round) == alike(round) && self.keys == *keys).then_some(&self.offers)
    }
}

/// What is kept behind a round, what its tiles counted, and what it leaves for the next.
type RoundOutcome = (KeptPoints, u64, Option<OfferedBefore>);

/// What the tiles of a round are about.
struct RoundScan<'a> {
    op: usize,
    /// Of the round, from 0.
    number: u32,
    field: &'a DecodedScan<'a>,
    sieve: &'a Sieve,
    /// Positions that the arena of a thread takes.
    capacity: usize,
}

impl RoundScan<'_> {
    fn call(&self) -> Call {
        Call { op: self.op, gathers: false }
    }

    fn round(
        &self,
        job: &Job<'_>,
        round: &Round,
        kept: &KeptPoints,
        before: Option<OfferedBefore>,
    ) -> Result<RoundOutcome> {
        let cut = cut_round(job, &self.field.tiles, self.field.lattice, round, self.capacity)?;
        match round.choice {
            Choice::InTile => {
                let (new, counted) = self.keep(job, round, kept, &cut)?;
                Ok((new, counted, None))
            }
            Choice::Best { want, reach } => {
                let last = before.as_ref().and_then(|before| before.of(round, &cut.keys));
                let last = last.filter(|_| !job.task.whole_rims);
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
                let merged = Merged::of(found.kept, chosen, self.number);
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

/// The kept points of a cube behind a round.
#[derive(Default)]
struct Merged {
    positions: Vec<Position>,
    rounds: Vec<u32>,
}

impl Merged {
    /// Those that were there, in Morton order with the round that kept each, and those `chosen` in
    /// round `number`, in Morton order.
    fn of(there: &KeptReader, chosen: impl Iterator<Item = Position>, number: u32) -> Merged {
        let mut merged = Merged::default();
        let mut old = there.positions.iter().zip(&there.rounds).peekable();
        for p in chosen {
            let before = |(q, _): &(&Position, &u32)| crate::store::morton_cmp(q, &p).is_lt();
            while let Some((&q, &round)) = old.next_if(before) {
                merged.push(q, round);
            }
            merged.push(p, number);
        }
        old.for_each(|(&q, &round)| merged.push(q, round));
        merged
    }

    fn push(&mut self, p: Position, round: u32) {
        self.positions.push(p);
        self.rounds.push(round);
    }
}

/// Occupied cubes of the positions that the stage decides about.
fn candidates(
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
    items(job, &cut).run(
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

/// Blocks of kept points that an item reads.
const BLOCKS: usize = 64;

/// The same points but for those of the last round whose hash is too large.
fn shorten(
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
        let mut merged = Merged::default();
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

/// The tiles of a round, in the order in which they are its items.
pub(super) type RoundKeys = [TileKey];
