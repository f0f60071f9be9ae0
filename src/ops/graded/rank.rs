//! In which order points were kept, as outputs have it.
//!
//! Where any number is to be cut off, ranks say besides at which distance a point was kept: rungs
//! of the ladder are powers of √2 of the scan's unit, and each has eight ranks. So a reduction can
//! be cut off at a length, by whoever has nothing but its points.

use crate::point::{Column, names};

/// When each point was kept: points of lower ranks are a coarser reduction of the same scan. 65535
/// are exceptions, which are kept and no part of the surface.
pub const KEEP_RANK: Column<u16> = Column::new(names::KEEP_RANK, &[]).computed_by("graded");
/// The rank of exceptions.
pub(super) const EXCEPTION: u16 = u16::MAX;

/// The longest distance of a rung is this power of √2, and the shortest its inverse.
const WIDEST: i32 = 80;
/// Ranks of a rung.
const OF_RUNG: u16 = 8;

/// A rung of the ladder of all distances: the number of √2 of which it is the power.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::ops) struct Rung(i32);

impl Rung {
    /// The rung of the largest distance that is no longer than `length`, in the scan's unit.
    pub fn within(length: f64) -> Rung {
        let power = (2.0 * length.log2()).floor();
        Rung((power.clamp(-f64::from(WIDEST), f64::from(WIDEST))) as i32)
    }

    /// The rungs from this one down to `last`, this one at least.
    pub fn down_to(self, last: Rung) -> impl Iterator<Item = Rung> {
        (last.0.min(self.0)..=self.0).rev().map(Rung)
    }

    /// The next longer one.
    pub fn coarser(self) -> Rung {
        Rung((self.0 + 1).min(WIDEST))
    }

    /// Its distance in the scan's unit.
    pub fn length(self) -> f64 {
        2f64.powf(f64::from(self.0) / 2.0)
    }

    /// The first of its ranks.
    pub fn first_rank(self) -> u16 {
        (WIDEST - self.0) as u16 * OF_RUNG
    }

    /// The last of them.
    pub fn last_rank(self) -> u16 {
        self.first_rank() + OF_RUNG - 1
    }
}

/// The rank behind another, below that of an exception.
pub(super) fn rank_behind(rank: u16) -> u16 {
    (rank + 1).min(EXCEPTION - 1)
}

/// The rank of what a round kept: below that of an exception.
pub(super) fn rank_of(round: u32) -> u16 {
    round.min(u32::from(EXCEPTION) - 1) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rung_is_no_longer_than_the_length_and_the_next_is() {
        for length in [1e-9, 0.002, 0.5, 1.0, 3.0, 1e6] {
            let rung = Rung::within(length);
            let next = Rung(rung.0 + 1);
            assert!(rung.length() <= length * (1.0 + 1e-12) && next.length() > length, "{length}");
            assert!(next.last_rank() < rung.first_rank(), "the coarser rung comes first");
        }
        assert!(Rung::within(1e-300).last_rank() < EXCEPTION);
        assert_eq!(Rung::within(1e300).first_rank(), 0);
        let rungs: Vec<Rung> = Rung(3).down_to(Rung(1)).collect();
        assert_eq!(rungs, [Rung(3), Rung(2), Rung(1)]);
        assert_eq!(Rung(3).down_to(Rung(5)).count(), 1);
    }
}
