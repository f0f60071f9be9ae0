//! Which divisions are made: all of ranges wider than the largest allowed, and some of exactly
//! that.

use std::cmp::Ordering;

use crate::geom::angle::MaxAngle;
use crate::point::Position;
use crate::store::morton_cmp;

/// Which of the divisions that could be made are made.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limit {
    /// All of a wider range are.
    pub(super) max_angle: MaxAngle,
    /// Of those of exactly this range, the first in canonical order.
    pub(super) ties: Option<Ties>,
}

/// Where divisions of exactly the largest range end, in canonical order: by initial cell, in the
/// order of their Morton-first positions; within one each part before its own parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Ties {
    /// Morton-first position of the initial cell in which the last one is.
    pub(super) last: Position,
    /// How many are in that one.
    pub(super) made: u64,
}

impl Limit {
    /// How many divisions of exactly the largest range the initial cell that begins with `first`
    /// has.
    pub(super) fn ties(&self, first: Position) -> u64 {
        self.ties.map_or(0, |ties| match morton_cmp(&first, &ties.last) {
            Ordering::Less => u64::MAX,
            Ordering::Equal => ties.made,
            Ordering::Greater => 0,
        })
    }

    /// The one test that decides about a division: whether a part is divided whose angles span
    /// `narrowest`, or a part above it less, if `ties` more are made of exactly the largest range.
    pub(super) fn allows(&self, narrowest: f64, ties: u64) -> bool {
        self.max_angle.is_exceeded_by(narrowest) || ties > 0 && self.is_tie(narrowest)
    }

    /// True if a division of that range is one of exactly the largest.
    pub(super) fn is_tie(&self, narrowest: f64) -> bool {
        narrowest == self.max_angle.cosine()
    }
}
