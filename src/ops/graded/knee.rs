//! How many points to keep where nobody says: as many as the shape of the scan asks for.
//!
//! The error of a reduction falls with the number of points as long as these tell of shape, on a
//! smooth surface to a half for twice as many; what is left in the end is noise, which no number of
//! points takes away. So numbers are tried that double, on the way down the same ladder by which a
//! number is kept, and each is measured on a sample of what it removes. The number behind which
//! twice as many lower the mean error by less than a quarter is the knee of that curve. The points
//! alone decide, so the knee is the same for every memory and every order of the files.

use crate::stage::{Looks, NextRound, Round, RoundChoice, SoFar};

use super::fill::Filling;
use super::ladder::{APART, OF_VOXEL, PROBED_ABOVE};
use super::refine::{Measuring, Refining};
use super::sides::{extent, share_of, steps, voxel_side};
use super::work::{RoundWork, fill};

/// The numbers that are tried are the positions through these powers of two.
const FEWEST: u32 = 7;
const LAST: u32 = 4;
/// Where the last of them is worth it, twice as many are taken and not tried: that would take as
/// long as all others together.
const MOST: u32 = LAST - 1;
/// No number is smaller.
const LEAST: u64 = 64;
/// Twice as many points are worth it if they lower the mean error below this part of it.
const WORTH: f64 = 0.75;
/// Rounds that add points to what is filled.
const ROUNDS: u32 = 2;
/// Positions that are measured at least.
const MEASURED: f64 = 20_000.0;
/// An error is told in so many parts of the scan's extent.
const PARTS: f64 = (1u64 << 26) as f64;

/// Where the search for the knee stands.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Knee {
    seed: u64,
    /// The numbers that are tried, and at which of them it is.
    numbers: Vec<u64>,
    at: usize,
    step: KneeStep,
    radius: i64,
    /// Lattice steps of a unit of errors.
    unit: f64,
    /// Mean errors of the numbers that were tried, in lattice steps.
    pub tried: Vec<(u64, f64)>,
    most: u64,
    work: Option<RoundWork>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum KneeStep {
    Fill,
    Refine { round: u32 },
    Measured,
}

/// What comes next.
pub(super) enum KneeNext {
    Round(NextRound),
    /// The number is found.
    Found(u64),
}

impl Knee {
    pub fn new(so_far: &SoFar<'_>, seed: u64) -> Knee {
        let positions = so_far.levels.positions();
        let number = |power: u32| (positions >> power).max(LEAST).min(positions);
        let mut numbers: Vec<u64> = (LAST..=FEWEST).rev().map(number).collect();
        numbers.dedup();
        let unit = (extent(&so_far.bounds) as f64 / PARTS).max(1.0 / 16.0);
        let (at, step, radius, most) = (0, KneeStep::Fill, 1, number(MOST));
        Knee { seed, numbers, at, step, radius, unit, tried: Vec::new(), most, work: None }
    }

    /// What the round at hand does.
    pub fn work(&self) -> Option<RoundWork> {
        self.work
    }

    /// What comes next.
    pub fn next(&mut self, so_far: &SoFar<'_>) -> KneeNext {
        let want = self.numbers[self.at];
        match self.step {
            KneeStep::Fill => KneeNext::Round(self.fill(want, so_far)),
            KneeStep::Refine { round } if round < ROUNDS && so_far.kept < want => {
                self.step = KneeStep::Refine { round: round + 1 };
                let left = u64::from(ROUNDS - round);
                let some = (want - so_far.kept).div_ceil(left);
                KneeNext::Round(self.refine(some, so_far))
            }
            KneeStep::Refine { .. } => {
                self.step = KneeStep::Measured;
                KneeNext::Round(self.measure(so_far))
            }
            KneeStep::Measured => self.judge(so_far),
        }
    }

    fn fill(&mut self, want: u64, so_far: &SoFar<'_>) -> NextRound {
        self.radius = steps(OF_VOXEL * voxel_side(so_far.levels, &so_far.bounds, want));
        self.step = KneeStep::Refine { round: 0 };
        let filling = Filling { apart: self.radius, seed: self.seed };
        let share = filling.looks_at(so_far);
        self.work = Some(RoundWork::Fill(filling));
        fill(filling, Looks::sample(share, self.seed))
    }

    fn refine(&mut self, want: u64, so_far: &SoFar<'_>) -> NextRound {
        let refining = self.refining();
        self.work = Some(RoundWork::Refine(refining));
        let probed = share_of(PROBED_ABOVE * self.numbers[self.at] as f64, so_far);
        let choice = RoundChoice::Best { want, reach: refining.offer_reach() };
        self.round(refining, probed, choice)
    }

    fn measure(&mut self, so_far: &SoFar<'_>) -> NextRound {
        let refining = self.refining();
        self.work = Some(RoundWork::Measure(Measuring { refining, unit: self.unit }));
        self.round(refining, self.measured(so_far), RoundChoice::InTile)
    }

    /// What rounds look at; borders are for the reduction itself.
    fn refining(&self) -> Refining {
        Refining { radius: self.radius, apart: APART, borders: false, floor: 0.0 }
    }

    fn round(&self, refining: Refining, share: f64, choice: RoundChoice) -> NextRound {
        let (reach, kept_reach) = (refining.reach(), refining.kept_reach());
        let looks = Looks::sample(share, self.seed);
        NextRound::Round(Round { looks, reach, kept_reach, choice })
    }

    /// The share of all positions that is measured.
    fn measured(&self, so_far: &SoFar<'_>) -> f64 {
        share_of((PROBED_ABOVE * self.numbers[self.at] as f64).max(MEASURED), so_far)
    }

    /// Whether the last number is worth it, beside the one before.
    fn judge(&mut self, so_far: &SoFar<'_>) -> KneeNext {
        let looked_at = self.measured(so_far) * so_far.levels.positions() as f64;
        let mean = so_far.counted as f64 * self.unit / looked_at.max(1.0);
        let before = self.tried.last().copied();
        self.tried.push((self.numbers[self.at], mean));
        if let Some((number, error)) = before
            && mean >= WORTH * error
        {
            return KneeNext::Found(number);
        }
        if mean == 0.0 {
            return KneeNext::Found(self.numbers[self.at]);
        }
        if self.at + 1 == self.numbers.len() {
            return KneeNext::Found(self.most);
        }
        self.at += 1;
        self.step = KneeStep::Fill;
        self.next(so_far)
    }
}
