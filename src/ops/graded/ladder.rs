//! Rounds towards a number of points: a ladder of distances that ends where all are kept.
//!
//! On each rung positions are kept until none is farther than a distance from a kept one; then a
//! few rounds add points where the surface is told worst. The distances fall by √2. For one number
//! of points the last distance follows from that number, and twelve rungs above it are enough: what
//! they keep, they keep with little to look at. For an order in which any number can be cut off
//! (`ranks`), rungs are powers of √2 of the scan's unit and begin at its width, so that they are
//! the same whatever the number is.

use crate::report::Grouped;
use crate::stage::{Looks, NextRound, Round, RoundChoice, SoFar};
use crate::{Error, ErrorKind};

use super::fill::Filling;
use super::rank::{Rung, rank_behind};
use super::refine::Refining;
use super::settings::Effort;
use super::sides::{LONGEST, extent, share_of, steps, voxel_side};
use super::work::{RoundWork, fill};

/// The last distance, as a part of the side of the voxel grid that keeps as many.
pub(super) const OF_VOXEL: f64 = 0.97;
/// By how much of what is kept a rung grows by its rounds.
const GROWTH: f64 = 2.0 / 3.0;
/// Kept points from which on a rung has rounds.
const FEWEST: u64 = 200;
/// Positions that a round of the last rung looks at for each kept point, and of others, which only
/// have to find about where points are missing.
const PROBED: f64 = 32.0;
pub(super) const PROBED_ABOVE: f64 = 12.0;
/// Rounds of the last rung keep so many times as many points as if all kept the same number: what
/// is kept early is seen by more rounds.
const EARLY: f64 = 1.4;
/// An offer stands aside for a better one within this share of its distance to a kept point.
pub(super) const APART: f64 = 0.5;

/// How points are chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Manner {
    pub effort: Effort,
    /// Of equally good choices, which are made.
    pub seed: u64,
    /// See [`Refining::borders`].
    pub borders: bool,
}

/// The rounds of a ladder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rounds {
    /// Rungs above the last one.
    above: u32,
    /// Rounds of each of these, and of the last one.
    each: u32,
    last: u32,
}

impl Rounds {
    fn of(effort: Effort) -> Rounds {
        match effort {
            Effort::Low => Rounds { above: 0, each: 0, last: 3 },
            Effort::Normal => Rounds { above: 12, each: 2, last: 8 },
        }
    }
}

/// Cells below this part of the lowest score that was chosen in the round before do not come to be
/// chosen in the next.
const LOW: f64 = 0.25;

/// Where the rounds stand.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ladder {
    /// How many positions are to stay.
    pub want: u64,
    manner: Manner,
    rounds: Rounds,
    /// The distances that are filled to, the last one last.
    rungs: Vec<i64>,
    /// True if what is kept before the last round does not depend on how many are wanted.
    ranked: bool,
    /// The ranks of what rounds kept, and the first of each rung; none where ranks are the numbers
    /// of rounds.
    pub ranks: Vec<u16>,
    of_rungs: Vec<u16>,
    at: LadderStep,
    covered: Option<i64>,
    /// The same once the round at hand is done, if all that it keeps stays.
    covers: Option<i64>,
    /// The part of all positions that the rounds of the rung look at.
    probed: f64,
    work: Option<RoundWork>,
}

/// What comes next.
#[derive(Debug, Clone, Copy, PartialEq)]
enum LadderStep {
    Fill {
        rung: usize,
    },
    /// Fills what the sample did not cover.
    Mop,
    Refine {
        rung: usize,
        round: u32,
    },
}

impl Ladder {
    /// The rounds that keep `want` of the positions, none of which is then farther from a kept one
    /// than the last distance, or than `spacing` steps.
    pub fn new(want: u64, so_far: &SoFar<'_>, manner: Manner, spacing: Option<i64>) -> Ladder {
        let rounds = Rounds::of(manner.effort);
        let last = steps(OF_VOXEL * voxel_side(so_far.levels, &so_far.bounds, want));
        let last = spacing.map_or(last, |spacing| last.min(spacing));
        let rung = |n: u32| (last as f64 * 2f64.powf(f64::from(n) / 2.0)).round().min(LONGEST);
        let rungs = (0..=rounds.above).rev().map(|n| rung(n) as i64).collect();
        Ladder {
            want,
            manner,
            rounds,
            rungs,
            ranked: false,
            ranks: Vec::new(),
            of_rungs: Vec::new(),
            at: LadderStep::Fill { rung: 0 },
            covered: None,
            covers: None,
            probed: 1.0,
            work: None,
        }
    }

    /// Rounds of which any number of points can be cut off, on a lattice of steps of this length.
    pub fn ranked(want: u64, so_far: &SoFar<'_>, manner: Manner, step: f64) -> Ladder {
        let widest = extent(&so_far.bounds) as f64 / 4.0 * step;
        let all = || Rung::within(widest.max(step)).down_to(Rung::within(step));
        let rungs = all().map(|rung| steps(rung.length() / step));
        let ladder = Ladder::new(want, so_far, manner, None);
        let each = ladder.rounds.each.max(1) + 1;
        let rounds = Rounds { each, last: each, ..ladder.rounds };
        let of_rungs = all().map(Rung::first_rank).collect();
        Ladder { rungs: rungs.collect(), ranked: true, of_rungs, rounds, ..ladder }
    }

    /// What the round at hand does.
    pub fn work(&self) -> Option<RoundWork> {
        self.work
    }

    /// The distance in steps that no removed position is farther from a kept one than: the last one
    /// that was filled to and of whose points all stay.
    pub fn covered(&self) -> Option<i64> {
        self.covered
    }

    /// True if a position that is not kept may be farther than `spacing` steps from all that are.
    pub fn leaves_apart(&self, spacing: i64, so_far: &SoFar<'_>) -> bool {
        let is_covered = self.covered.is_some_and(|covered| covered <= spacing);
        !is_covered && so_far.kept < so_far.levels.positions()
    }

    /// What comes next.
    pub fn next(&mut self, so_far: &SoFar<'_>) -> NextRound {
        if so_far.kept > self.want {
            self.covers = None;
            return NextRound::Shorten { to: self.want, seed: SHORTENED_BY };
        }
        self.covered = self.covers.take().or(self.covered);
        if so_far.kept == self.want {
            return NextRound::Done;
        }
        let last = self.rungs.len() - 1;
        match self.at {
            LadderStep::Fill { rung } => {
                let share = self.filled_from(rung, so_far);
                self.at = match (rung == last, share < 1.0) {
                    (true, true) => LadderStep::Mop,
                    _ => LadderStep::Refine { rung, round: 0 },
                };
                self.fill(rung, Looks::sample(share, self.manner.seed))
            }
            LadderStep::Mop => {
                self.at = LadderStep::Refine { rung: last, round: 0 };
                let share = self.filled_from(last, so_far);
                self.fill(last, Looks::uncovered(self.rungs[last], share))
            }
            LadderStep::Refine { rung, round: 0 } if rung < last && so_far.kept < FEWEST => {
                self.at = LadderStep::Fill { rung: rung + 1 };
                self.next(so_far)
            }
            LadderStep::Refine { rung, round } => self.refine(rung, round, so_far),
        }
    }

    /// Enters the rank of what a round keeps: the first of a rung, or the one behind the last.
    fn rank(&mut self, of_rung: Option<usize>) {
        if let Some(&last) = self.ranks.last().or(self.of_rungs.first()) {
            let first = of_rung.and_then(|rung| self.of_rungs.get(rung).copied());
            self.ranks.push(first.unwrap_or_else(|| rank_behind(last)));
        }
    }

    fn fill(&mut self, rung: usize, looks: Looks) -> NextRound {
        let is_first = matches!(looks, Looks::Sample { .. });
        self.rank(is_first.then_some(rung));
        let filling = self.filling(rung);
        self.work = Some(RoundWork::Fill(filling));
        // A sample that is covered says nothing of the others.
        let looks_at_all = looks.share() >= 1.0 || matches!(looks, Looks::Uncovered { .. });
        self.covers = looks_at_all.then_some(filling.apart);
        fill(filling, looks)
    }

    fn refine(&mut self, rung: usize, round: u32, so_far: &SoFar<'_>) -> NextRound {
        let is_last_rung = rung == self.rungs.len() - 1 && !self.ranked;
        let missing = self.want - so_far.kept;
        if round == 0 {
            let grown = so_far.kept as f64 * (1.0 + GROWTH);
            let of_rung = match is_last_rung {
                true => PROBED * self.want as f64,
                false => PROBED_ABOVE * grown,
            };
            self.probed = share_of(of_rung, so_far);
        }
        let (rounds, want) = match is_last_rung {
            true => {
                let left = self.rounds.last.saturating_sub(round).max(1);
                let each = EARLY * missing as f64 / f64::from(left);
                (self.rounds.last, missing.min(each as u64))
            }
            false => (self.rounds.each, (so_far.kept as f64 * self.grown(round)) as u64),
        };
        let is_last = round + 1 >= rounds;
        let is_bottom = rung == self.rungs.len() - 1;
        if is_bottom && round > rounds && so_far.added == 0 {
            return NextRound::Done;
        }
        if is_bottom && round >= rounds {
            // Cells that are few offer few: more rounds, as long as there are any.
            self.probed = 1.0;
        }
        self.at = match is_last && !is_bottom {
            true => LadderStep::Fill { rung: rung + 1 },
            false => LadderStep::Refine { rung, round: round + 1 },
        };
        let apart = if is_last && is_last_rung { 0.0 } else { APART };
        let floor = if (1..rounds).contains(&round) { LOW * so_far.least } else { 0.0 };
        let refining =
            Refining { radius: self.rungs[rung], apart, borders: self.manner.borders, floor };
        self.work = Some(RoundWork::Refine(refining));
        self.rank(None);
        let want = if self.ranked { want.max(1) } else { want.clamp(1, missing) };
        NextRound::Round(Round {
            looks: Looks::sample(self.probed, self.manner.seed),
            reach: refining.reach(),
            kept_reach: refining.kept_reach(),
            choice: RoundChoice::Best { want, reach: refining.offer_reach() },
        })
    }

    /// The part of what is kept by which round number `round` of a rung grows it.
    fn grown(&self, round: u32) -> f64 {
        GROWTH / (f64::from(self.rounds.each) + f64::from(round) * GROWTH)
    }

    fn filling(&self, rung: usize) -> Filling {
        Filling { apart: self.rungs[rung], seed: self.manner.seed }
    }

    /// The part of all positions that a rung fills from.
    fn filled_from(&self, rung: usize, so_far: &SoFar<'_>) -> f64 {
        self.filling(rung).looks_at(so_far)
    }
}

/// More points are needed for a spacing than may stay.
pub(super) fn too_few(spacing: f64, most: u64) -> Error {
    let told = format!(
        "`graded.max_spacing = {spacing}` takes more than the {} points that `graded.keep` allows",
        Grouped(most)
    );
    let help = "keep more points, or give a longer `graded.max_spacing`, or none";
    Error::new(ErrorKind::Data, told).help(help)
}

/// By which hash some are left of what a round kept: whoever cuts a number off what is written can
/// do it, too.
pub(in crate::ops) const SHORTENED_BY: u64 = 0;
