//! Occupied cubes of every power-of-two side, exactly, from one walk in Morton order.
//!
//! A stage chooses the side of its cells by how many positions a cell would hold. Two positions
//! that follow each other in Morton order say by their highest different bit at which sides they
//! are in different cubes, so a counter for each bit is enough, and the merge passes over all
//! positions anyway. An estimate from samples would be wrong for scans whose density varies.

use serde::{Deserialize, Serialize};

use super::key::split_level;
use crate::point::Position;

/// How many world-anchored cubes of side 2^j hold a position, for every j.
///
/// Two positions that follow each other in Morton order are in different cubes of side 2^j exactly
/// when the highest bit in which they differ is at or above j; so one count per bit is enough.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Levels {
    first: bool,
    /// For each bit, in halves: `serde` knows arrays of no more than 32.
    splits: [[u64; 32]; 2],
    positions: u64,
}

impl Levels {
    /// Counts the distinct position `p` that follows `before` (None for the very first) in Morton
    /// order.
    pub fn add(&mut self, before: Option<Position>, p: Position) {
        match before.and_then(|b| split_level(b, p)) {
            Some(level) => self.split(level),
            None => {
                self.positions += 1;
                self.first = true;
            }
        }
    }

    /// Counts a position that first differs from the one before in bit `level`.
    pub(crate) fn split(&mut self, level: u32) {
        self.positions += 1;
        self.splits.as_flattened_mut()[level as usize] += 1;
    }

    /// Adds what another walk counted; exactly one of all walks began with `None`.
    pub fn merge(&mut self, other: &Levels) {
        self.first |= other.first;
        self.positions += other.positions;
        for (mine, theirs) in
            self.splits.as_flattened_mut().iter_mut().zip(other.splits.as_flattened())
        {
            *mine += theirs;
        }
    }

    /// Distinct positions.
    pub fn positions(&self) -> u64 {
        self.positions
    }

    /// Occupied cubes of side 2^j.
    pub fn occupied(&self, j: u32) -> u64 {
        u64::from(self.first) + self.splits.as_flattened()[j.min(63) as usize..].iter().sum::<u64>()
    }

    /// The smallest j for which positions ÷ occupied cubes of side 2^j ≥ `mean`; where a scan is
    /// too small for that, the smallest j from which on larger cubes hold no more.
    pub fn smallest_side(&self, mean: u64) -> u32 {
        let fewest = self.occupied(62);
        (0..62)
            .find(|&j| {
                let occupied = self.occupied(j);
                self.positions >= occupied.saturating_mul(mean) || occupied == fewest
            })
            .unwrap_or(62)
    }
}
