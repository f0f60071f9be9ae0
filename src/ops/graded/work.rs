//! What a round does.

use super::correct::Correcting;
use super::fill::Filling;
use super::refine::{Measuring, Refining};
use crate::stage::{Looks, NextRound, Round, RoundChoice};

/// What a round does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum RoundWork {
    Fill(Filling),
    Refine(Refining),
    Correct(Correcting),
    Measure(Measuring),
}

/// A round that fills.
pub(super) fn fill(filling: Filling, looks: Looks) -> NextRound {
    let (reach, kept_reach) = (filling.reach(), filling.kept_reach());
    NextRound::Round(Round { looks, reach, kept_reach, choice: RoundChoice::InTile })
}
