//! Which rounds there are: a ladder of distances that ends where all that is wanted is kept.

use crate::point::Bounds;
use crate::stage::{Choice, Looks, NextRound, Round, SoFar};
use crate::store::Levels;

use super::fill::Filling;
use super::refine::Refining;

/// The last distance, as a part of the side of the voxel grid that keeps as many.
const OF_VOXEL: f64 = 0.97;
/// Rungs above the last one, each √2 as wide as the one below it.
const RUNGS: u32 = 2;
/// By how much of what is kept a rung grows by its rounds, and in how many.
const GROWTH: f64 = 2.0 / 3.0;
const ROUNDS: u32 = 2;
/// Rounds of the last rung.
const LAST_ROUNDS: u32 = 8;
/// Positions that a filling looks at for each cube of its distance that is occupied, and a round
/// for each kept point; all where there are fewer.
const FILLED_FROM: f64 = 64.0;
const PROBED: f64 = 32.0;
/// The same on rungs above the last one, which only have to find about where points are missing.
const PROBED_ABOVE: f64 = 12.0;
/// An offer stands aside for a better one within this share of its distance to a kept point.
const APART: f64 = 0.5;

/// What a round does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Work {
    Fill(Filling),
    Refine(Refining),
}

/// Where the rounds stand.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ladder {
    /// How many positions are to stay.
    pub want: u64,
    seed: u64,
    /// The distances that are filled to, the last one last.
    pub rungs: Vec<i64>,
    at: Next,
    /// The part of all positions that the rounds of the rung look at.
    probed: f64,
    work: Option<Work>,
}

/// What comes next.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Next {
    Fill { rung: usize },
    /// Fills what the sample did not cover.
    Mop,
    Refine { rung: usize, round: u32 },
    Done,
}

impl Ladder {
    /// The rounds that keep `want` of the positions counted by `levels`.
    pub fn new(want: u64, levels: &Levels, bounds: &Bounds, seed: u64) -> Ladder {
        let want = want.min(levels.positions());
        let last = (OF_VOXEL * voxel_side(levels, bounds, want)).round().clamp(1.0, LONGEST);
        let rungs = (0..=RUNGS).rev().map(|n| (last * 2f64.powf(f64::from(n) / 2.0)).round());
        let rungs = rungs.map(|r| r.min(LONGEST) as i64).collect();
        Ladder { want, seed, rungs, at: Next::Fill { rung: 0 }, probed: 1.0, work: None }
    }

    /// What the round at hand does.
    pub fn work(&self) -> Option<Work> {
        self.work
    }

    /// The distance that no removed position is from a kept one.
    pub fn last(&self) -> i64 {
        self.rungs.last().copied().unwrap_or(1)
    }

    /// What comes next.
    pub fn next(&mut self, so_far: &SoFar<'_>) -> NextRound {
        if so_far.kept > self.want {
            return NextRound::Shorten { to: self.want, seed: self.seed };
        }
        if so_far.kept == self.want {
            return NextRound::Done;
        }
        let last = self.rungs.len() - 1;
        match self.at {
            Next::Fill { rung } => {
                let share = self.filled_from(rung, so_far);
                self.at = match (rung == last, share < 1.0) {
                    (true, true) => Next::Mop,
                    _ => Next::Refine { rung, round: 0 },
                };
                let looks = Looks::Sample { most: most_of(share), seed: self.seed };
                self.fill(rung, looks)
            }
            Next::Mop => {
                self.at = Next::Refine { rung: last, round: 0 };
                let most = most_of(self.filled_from(last, so_far));
                self.fill(last, Looks::Uncovered { apart: self.last(), most })
            }
            Next::Refine { rung, round } => {
                let missing = self.want - so_far.kept;
                if round == 0 {
                    let grown = (so_far.kept as f64 * (1.0 + GROWTH)).min(self.want as f64);
                    let (of_each, kept) = match rung == last {
                        true => (PROBED, self.want as f64),
                        false => (PROBED_ABOVE, grown),
                    };
                    let positions = so_far.levels.positions().max(1) as f64;
                    self.probed = (of_each * kept / positions).min(1.0);
                }
                let (rounds, want) = match rung == last {
                    true => (LAST_ROUNDS, missing / u64::from(LAST_ROUNDS.saturating_sub(round).max(1))),
                    false => (ROUNDS, (so_far.kept as f64 * grown(round)) as u64),
                };
                let is_last = round + 1 >= rounds;
                self.at = match (is_last, rung == last) {
                    (true, false) => Next::Fill { rung: rung + 1 },
                    // Cells that are few offer few: one more round, as long as there are any.
                    (true, true) if round >= rounds && so_far.added == 0 => Next::Done,
                    _ => Next::Refine { rung, round: round + 1 },
                };
                if self.at == Next::Done {
                    return NextRound::Done;
                }
                let apart = if is_last && rung == last { 0.0 } else { APART };
                self.refine(rung, want.clamp(1, missing), apart)
            }
            Next::Done => NextRound::Done,
        }
    }

    fn fill(&mut self, rung: usize, looks: Looks) -> NextRound {
        let filling = Filling { apart: self.rungs[rung], seed: self.seed };
        self.work = Some(Work::Fill(filling));
        let (reach, kept_reach) = (filling.reach(), filling.kept_reach());
        NextRound::Round(Round { looks, reach, kept_reach, choice: Choice::InTile })
    }

    fn refine(&mut self, rung: usize, want: u64, apart: f64) -> NextRound {
        let refining = Refining { radius: self.rungs[rung], apart };
        self.work = Some(Work::Refine(refining));
        let most = most_of(self.probed);
        NextRound::Round(Round {
            looks: Looks::Sample { most, seed: self.seed },
            reach: refining.reach(),
            kept_reach: refining.kept_reach(),
            choice: Choice::Best { want, reach: refining.offer_reach() },
        })
    }

    /// The part of all positions that a rung fills from.
    fn filled_from(&self, rung: usize, so_far: &SoFar<'_>) -> f64 {
        let cubes = occupied(so_far.levels, self.rungs[rung] as f64);
        (FILLED_FROM * cubes / so_far.levels.positions().max(1) as f64).min(1.0)
    }
}

/// No distance is larger, in steps.
const LONGEST: f64 = (1i64 << 58) as f64;

/// The part of what is kept by which round number `round` of a rung grows it.
fn grown(round: u32) -> f64 {
    GROWTH / (f64::from(ROUNDS) + f64::from(round) * GROWTH)
}

/// The largest hash of a sample of that share.
fn most_of(share: f64) -> u64 {
    if share >= 1.0 { u64::MAX } else { (share * 2f64.powi(64)) as u64 }
}

/// The side in steps of the voxel grid that keeps `count` positions: between the sides that are
/// powers of two, of which the scan knows, numbers are straight lines over sides in logarithms.
fn voxel_side(levels: &Levels, bounds: &Bounds, count: u64) -> f64 {
    let longest = bounds.extent().into_iter().max().unwrap_or(0).max(1);
    let top = longest.ilog2() + 1;
    let (mut level, mut above) = (top, None);
    while level > 0 && levels.occupied(level) < count {
        above = Some(levels.occupied(level));
        level -= 1;
    }
    let (side, here) = (2f64.powi(level as i32), levels.occupied(level) as f64);
    match above.map(|above| above as f64) {
        Some(above) if here > above => {
            side * 2f64.powf((here / count as f64).ln() / (here / above).ln())
        }
        _ => side,
    }
}

/// Occupied cubes of a side in steps, by the same lines.
fn occupied(levels: &Levels, side: f64) -> f64 {
    let level = side.max(1.0).log2();
    let (below, part) = (level.floor() as u32, level.fract());
    let [more, fewer] = [below, below + 1].map(|level| levels.occupied(level).max(1) as f64);
    more * (fewer / more).powf(part)
}
