//! Rounds towards a tolerance: positions are filled to a distance; then points are added to the
//! surface where it is too far off, until that does not pay any more.
//!
//! What is still too far off then is kept, too, but not made a part of the surface, whose planes it
//! would only break: an exception. So every removed position is within the tolerance of the
//! surface, whatever the scan is.

use crate::stage::{Looks, NextRound, Round, RoundChoice, SoFar};

use super::correct::Correcting;
use super::fill::Filling;
use super::ladder::APART;
use super::refine::Refining;
use super::work::{RoundWork, fill};

/// Rounds at most.
const MOST_ROUNDS: u32 = 24;
/// Rounds before it is asked whether they pay.
const ALWAYS: u32 = 3;

/// Where the rounds stand.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Certain {
    /// Lattice steps.
    pub tolerance: f64,
    pub radius: i64,
    seed: u64,
    at: CertainStep,
    /// What would be kept in all before the last round, exceptions included.
    total: Option<u64>,
    work: Option<RoundWork>,
    /// Positions that would be exceptions, as far as is known.
    pub exceptions: u64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum CertainStep {
    Fill,
    Mop,
    Correct { round: u32 },
    Done,
}

impl Certain {
    /// Rounds that leave no position farther than `radius` steps from a kept one, and none farther
    /// than `tolerance` from the surface.
    pub fn new(tolerance: f64, radius: i64, seed: u64) -> Certain {
        let (at, total, work) = (CertainStep::Fill, None, None);
        Certain { tolerance, radius, seed, at, total, work, exceptions: 0 }
    }

    /// What the round at hand does.
    pub fn work(&self) -> Option<RoundWork> {
        self.work
    }

    /// What comes next.
    pub fn next(&mut self, so_far: &SoFar<'_>) -> NextRound {
        let filling = Filling { apart: self.radius, seed: self.seed };
        let share = filling.looks_at(so_far);
        match self.at {
            CertainStep::Fill => {
                self.at =
                    if share < 1.0 { CertainStep::Mop } else { CertainStep::Correct { round: 0 } };
                self.work = Some(RoundWork::Fill(filling));
                fill(filling, Looks::sample(share, self.seed))
            }
            CertainStep::Mop => {
                self.at = CertainStep::Correct { round: 0 };
                fill(filling, Looks::uncovered(self.radius, share))
            }
            CertainStep::Correct { round } => self.correct(round, so_far),
            CertainStep::Done => NextRound::Done,
        }
    }

    fn correct(&mut self, round: u32, so_far: &SoFar<'_>) -> NextRound {
        if let Some(before) = round.checked_sub(1) {
            let total = so_far.kept - so_far.added + so_far.counted;
            if so_far.counted == 0 {
                self.exceptions = 0;
                return NextRound::Done;
            }
            if before > ALWAYS && self.total.is_some_and(|least| total > least) {
                self.at = CertainStep::Done;
                return NextRound::Undo { rounds: 2 };
            }
            (self.total, self.exceptions) = (Some(total), so_far.counted);
            if round >= MOST_ROUNDS {
                self.at = CertainStep::Done;
                return NextRound::Undo { rounds: 1 };
            }
        }
        self.at = CertainStep::Correct { round: round + 1 };
        let refining = Refining { radius: self.radius, apart: APART, borders: false, floor: 0.0 };
        let Certain { radius, tolerance, .. } = *self;
        self.work = Some(RoundWork::Correct(Correcting { radius, tolerance, apart: APART }));
        NextRound::Round(Round {
            looks: Looks::sample(1.0, self.seed),
            reach: refining.reach(),
            kept_reach: refining.kept_reach(),
            choice: RoundChoice::Best { want: u64::MAX, reach: refining.offer_reach() },
        })
    }
}
