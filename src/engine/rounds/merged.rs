//! Kept points of a cube and those that a round adds to them.

use crate::point::Position;
use crate::store::{KeptReader, morton_cmp};

/// The kept points of a cube behind a round.
#[derive(Default)]
pub(super) struct MergedPoints {
    pub positions: Vec<Position>,
    pub rounds: Vec<u32>,
}

impl MergedPoints {
    /// Those that were there, in Morton order with the round that kept each, and those `chosen` in
    /// round `number`, in Morton order.
    pub fn of(
        there: &KeptReader,
        chosen: impl Iterator<Item = Position>,
        number: u32,
    ) -> MergedPoints {
        let mut merged = MergedPoints::default();
        let mut old = there.positions.iter().zip(&there.rounds).peekable();
        for p in chosen {
            let before = |(q, _): &(&Position, &u32)| morton_cmp(q, &p).is_lt();
            while let Some((&q, &round)) = old.next_if(before) {
                merged.push(q, round);
            }
            merged.push(p, number);
        }
        old.for_each(|(&q, &round)| merged.push(q, round));
        merged
    }

    /// Adds the next point.
    pub fn push(&mut self, p: Position, round: u32) {
        self.positions.push(p);
        self.rounds.push(round);
    }
}
