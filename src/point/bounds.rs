//! Boxes of lattice positions.

use serde::{Deserialize, Serialize};

/// A position on the [`Lattice`](crate::stage::Lattice), in steps from world 0.
pub type Position = [i64; 3];

/// Exact squared distance of two positions, in lattice steps squared; saturates where the
/// difference of two coordinates exceeds 2^63.
pub fn distance2(a: Position, b: Position) -> u128 {
    let [x, y, z] = [a[0].abs_diff(b[0]), a[1].abs_diff(b[1]), a[2].abs_diff(b[2])];
    if (x | y | z) >> 31 == 0 {
        return u128::from(x * x + y * y + z * z);
    }
    [x, y, z]
        .into_iter()
        .fold(0u128, |sum, d| sum.saturating_add(u128::from(d).saturating_mul(u128::from(d))))
}

/// Exact squared distance of a position of a cube to its centre, in half steps squared: the centre
/// of an odd `side` is between two steps.
pub fn center_distance2(p: Position, corner: Position, side: i64) -> u128 {
    distance2(std::array::from_fn(|axis| 2 * (p[axis] - corner[axis])), [side; 3])
}

/// A box of lattice positions; both corners belong to it. Empty when `lo > hi` on any axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Bounds {
    /// Smallest coordinate on each axis.
    pub lo: Position,
    /// Largest coordinate on each axis.
    pub hi: Position,
}

impl Default for Bounds {
    fn default() -> Self {
        Bounds::EMPTY
    }
}

impl Bounds {
    /// The box that holds nothing.
    pub const EMPTY: Bounds = Bounds { lo: [i64::MAX; 3], hi: [i64::MIN; 3] };

    /// The tight box of `positions`.
    pub fn of(positions: impl IntoIterator<Item = Position>) -> Self {
        let mut bounds = Bounds::EMPTY;
        positions.into_iter().for_each(|p| bounds.add(p));
        bounds
    }

    /// True if it holds no position.
    pub fn is_empty(&self) -> bool {
        (0..3).any(|axis| self.lo[axis] > self.hi[axis])
    }

    /// Grows to hold `p`.
    pub fn add(&mut self, p: Position) {
        for (axis, v) in p.into_iter().enumerate() {
            self.lo[axis] = self.lo[axis].min(v);
            self.hi[axis] = self.hi[axis].max(v);
        }
    }

    /// The smallest box that holds both.
    pub fn union(&self, other: &Bounds) -> Bounds {
        let mut all = *self;
        for axis in 0..3 {
            all.lo[axis] = all.lo[axis].min(other.lo[axis]);
            all.hi[axis] = all.hi[axis].max(other.hi[axis]);
        }
        all
    }

    /// What both boxes have in common.
    pub fn common(&self, other: &Bounds) -> Bounds {
        let axis =
            |axis: usize| (self.lo[axis].max(other.lo[axis]), self.hi[axis].min(other.hi[axis]));
        let [x, y, z] = [axis(0), axis(1), axis(2)];
        Bounds { lo: [x.0, y.0, z.0], hi: [x.1, y.1, z.1] }
    }

    /// This box with `steps` more on every side, cut off at the ends of i64.
    pub fn grown(&self, steps: i64) -> Bounds {
        Bounds {
            lo: self.lo.map(|v| v.saturating_sub(steps)),
            hi: self.hi.map(|v| v.saturating_add(steps)),
        }
    }

    /// True if `p` is inside.
    pub fn contains(&self, p: Position) -> bool {
        (0..3).all(|axis| self.lo[axis] <= p[axis] && p[axis] <= self.hi[axis])
    }

    /// True if all of `other` is inside.
    pub fn holds(&self, other: &Bounds) -> bool {
        (0..3).all(|axis| self.lo[axis] <= other.lo[axis] && other.hi[axis] <= self.hi[axis])
    }

    /// True if the boxes share a position.
    pub fn meets(&self, other: &Bounds) -> bool {
        (0..3).all(|axis| self.lo[axis] <= other.hi[axis] && other.lo[axis] <= self.hi[axis])
    }

    /// Exact squared distance of `p` to the nearest position of the box, saturating; 0 inside.
    pub fn distance2(&self, p: Position) -> u128 {
        let nearest = std::array::from_fn(|axis| p[axis].clamp(self.lo[axis], self.hi[axis]));
        distance2(p, nearest)
    }

    /// Length of each side in steps between the outermost positions; 0 for a single plane.
    pub fn extent(&self) -> [u64; 3] {
        std::array::from_fn(|axis| self.hi[axis].abs_diff(self.lo[axis]))
    }
}
