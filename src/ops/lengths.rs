//! Lengths of stages in steps of the lattice: rounded to whole ones, or squared exactly.

use crate::geom::lattice::Lattice;
use crate::quantity::Figure;

/// Cubes of this side, anchored at world 0, are the octants of the lattice: no larger side differs.
pub(super) const LARGEST_SIDE: i64 = 1 << 62;

/// What to tell of a length, given as the key `address`, that is not what it was given as.
pub(super) fn rounded(lattice: &Lattice, address: &str, length: f64) -> Option<String> {
    let held = Figure(lattice.rounded(length)?);
    let (length, steps) = (Figure(length), lattice.step);
    Some(format!(
        "`{address} = {length}` is {held} here: lengths are whole steps of the lattice, {steps}; \
         `run.lattice` makes finer ones"
    ))
}

/// A length that differs from whole steps by less than this part of it is whole: decimals are
/// seldom exact in binary, and who asks for 0.3 means three steps of 0.1.
const WHOLE: f64 = 1e-9;

/// The square of a length in steps, to compare squared distances with, which are whole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Square {
    /// The largest whole number that is no more.
    floor: u128,
    /// True if that is the square itself.
    is_whole: bool,
}

impl Square {
    pub fn of(steps: f64) -> Self {
        let whole = steps.round();
        if (steps - whole).abs() <= WHOLE * whole {
            let whole = whole as u128;
            return Square { floor: whole.saturating_mul(whole), is_whole: true };
        }
        Square { floor: (steps * steps) as u128, is_whole: false }
    }

    /// The largest squared distance that is no longer than the length.
    pub fn at_most(self) -> u128 {
        self.floor
    }

    /// The smallest squared distance that is no shorter than the length.
    pub fn at_least(self) -> u128 {
        self.floor.saturating_add(u128::from(!self.is_whole))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_of_whole_steps_is_whole_despite_binary_fractions() {
        // 0.3 / 0.1 is less than 3: rounding would lose the points at 0.3.
        for (steps, at_most, at_least) in [
            (0.3 / 0.1, 9, 9),
            (2.5, 6, 7),
            (0.4, 0, 1),
            (0.999_999, 0, 1),
            // Exact beyond the digits of a float.
            (1e15, 10u128.pow(30), 10u128.pow(30)),
            (1e30, u128::MAX, u128::MAX),
            (f64::INFINITY, u128::MAX, u128::MAX),
        ] {
            let square = Square::of(steps);
            assert_eq!((square.at_most(), square.at_least()), (at_most, at_least), "{steps}");
        }
    }
}
