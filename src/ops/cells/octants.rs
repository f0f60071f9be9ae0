//! Parts of a cell by octants of its cube.

use std::ops::Range;

use super::division::{CellPart, Division};
use crate::point::{Bounds, Position};

impl Division<'_> {
    /// Parts the members by the octants of the smallest octant of the initial cell that holds them.
    pub(super) fn cut_in_eight(
        &mut self,
        part: &mut [u32],
        child: impl Fn(Range<usize>) -> CellPart,
    ) {
        let positions = self.positions;
        let tight = Bounds::of(part.iter().map(|&i| positions[i as usize]));
        let Some(middle) = middle(&tight, self.rule.origin, self.rule.side) else { return };
        let octant = |i: u32| {
            let p = positions[i as usize];
            (0..3).fold(0, |octant, axis| octant | usize::from(p[axis] >= middle[axis]) << axis)
        };
        self.distribute::<9>(part, octant, child);
    }
}

/// Smallest corner of the last octant of the smallest octant of a cell that holds `bounds`; the
/// lower half of an odd side is the longer one. None if `bounds` is a single position.
fn middle(bounds: &Bounds, origin: Position, side: i64) -> Option<Position> {
    let corner =
        |axis: usize| origin[axis] + (bounds.lo[axis] - origin[axis]).div_euclid(side) * side;
    let mut corner: Position = std::array::from_fn(corner);
    let mut sides = [side; 3];
    while sides != [1; 3] {
        let middle = std::array::from_fn(|axis| corner[axis] + (sides[axis] - sides[axis] / 2));
        if (0..3).any(|axis| bounds.lo[axis] < middle[axis] && middle[axis] <= bounds.hi[axis]) {
            return Some(middle);
        }
        for axis in 0..3 {
            let half = sides[axis] / 2;
            if bounds.lo[axis] >= middle[axis] {
                corner[axis] = middle[axis];
                sides[axis] = half;
            } else {
                sides[axis] -= half;
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_is_that_of_the_smallest_octant() {
        let bounds = |lo, hi| Bounds { lo, hi };
        assert_eq!(middle(&bounds([0; 3], [7; 3]), [0; 3], 8), Some([4; 3]));
        assert_eq!(middle(&bounds([4; 3], [5, 4, 4]), [0; 3], 8), Some([5; 3]));
        assert_eq!(middle(&bounds([-7; 3], [-1; 3]), [-14, 0, 7], 7), Some([-3; 3]));
        assert_eq!(middle(&bounds([3; 3], [3; 3]), [-14, 0, 7], 7), None);
        // A side of 3 is halved into 2 and 1: octants need not be cubes.
        assert_eq!(middle(&bounds([0, 2, 0], [1, 2, 0]), [0; 3], 3), Some([1, 3, 1]));
    }
}
