//! Which part of a mesh a thread draws: squares of the plane, each with all that is above it.
//!
//! A triangle belongs to the square of its first corner, so its circle reaches no farther from the
//! square than two of the largest radii. What is loaded is therefore the square with a rim of that
//! width, whatever the heights: a cube of the octree would not do, since a point far above or below
//! may lie in the circle.
//!
//! Squares are nodes of a quadtree on the lattice, and triangles are written in the order of their
//! first corners on the Morton curve of the plane. Each square is one stretch of that curve, so
//! where squares are cut shows in nothing that is written.

use std::cmp::Ordering;
use std::ops::Range;

use crate::Result;
use crate::geom::morton::plane_morton_cmp;
use crate::point::{Bounds, Position};
use crate::store::TileKey;
use crate::tile::NumberedPositions;

/// A node of the quadtree over a plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PlaneSquare {
    /// Its smallest corner.
    corner: [i64; 2],
    /// Binary logarithm of its side in steps.
    level: u32,
}

impl PlaneSquare {
    /// The smallest one that holds all of a box across an axis.
    fn holding(bounds: &Bounds, axis: usize) -> PlaneSquare {
        let flat = |p: Position| {
            let [u, v] = across(p, axis);
            [u, v, 0]
        };
        let TileKey { corner: [u, v, _], level } =
            TileKey::holding(&Bounds { lo: flat(bounds.lo), hi: flat(bounds.hi) });
        PlaneSquare { corner: [u, v], level }
    }

    /// Its quarters in Morton order; None for a single place.
    fn quarters(&self) -> Option<[PlaneSquare; 4]> {
        let [u, v] = self.corner;
        let halves = TileKey { corner: [u, v, 0], level: self.level }.children()?;
        let quarter = |n: usize| {
            let TileKey { corner: [u, v, _], level } = halves[n];
            PlaneSquare { corner: [u, v], level }
        };
        Some([0, 1, 2, 3].map(quarter))
    }

    fn last(&self) -> [i64; 2] {
        let [u, v] = self.corner;
        let Bounds { hi: [u, v, _], .. } = TileKey { corner: [u, v, 0], level: self.level }.cube();
        [u, v]
    }

    /// The square with all that is above and below it.
    pub(super) fn column(&self, bounds: &Bounds, axis: usize) -> Bounds {
        let mut column = *bounds;
        let (corner, last) = (self.corner, self.last());
        for n in 0..2 {
            let axis = (axis + 1 + n) % 3;
            (column.lo[axis], column.hi[axis]) = (corner[n], last[n]);
        }
        column
    }

    /// Which of some places in Morton order are in the square.
    pub(super) fn stretch_of<T>(&self, places: &[T], at: impl Fn(&T) -> [i64; 2]) -> Range<usize> {
        let start = places.partition_point(|place| self.side_of(at(place)).is_lt());
        start..places.partition_point(|place| self.side_of(at(place)).is_le())
    }

    /// Where a place is: before the square, in it or behind it on the Morton curve.
    fn side_of(&self, place: [i64; 2]) -> Ordering {
        match plane_morton_cmp(place, self.corner) {
            Ordering::Less => Ordering::Less,
            _ if plane_morton_cmp(place, self.last()).is_gt() => Ordering::Greater,
            _ => Ordering::Equal,
        }
    }

    /// Steps of its side, at most 2^63.
    fn side(&self) -> u64 {
        1 << self.level.min(63)
    }
}

/// The coordinates of a position across an axis.
pub(super) fn across(p: Position, axis: usize) -> [i64; 2] {
    [p[(axis + 1) % 3], p[(axis + 2) % 3]]
}

/// Squares are as many rims wide at least, or most of what is loaded would be rims; less where they
/// would not fit otherwise.
const RIMS_ACROSS: u64 = 4;

/// The squares of a mesh.
pub(super) struct SquareCut {
    pub squares: Vec<PlaneSquare>,
    /// Positions that one of them has with its rim, at most.
    pub heaviest: u64,
}

/// Cuts the plane across an axis into squares that have about `wanted` positions with a rim of so
/// many steps, and no more than `most` if it can be: see [`SquareCut::heaviest`]. Without a rim all
/// is one. In Morton order; squares that nothing is left in are left out.
pub(super) fn cut(
    scan: &NumberedPositions,
    axis: usize,
    rim: Option<i64>,
    [wanted, most]: [u64; 2],
) -> Result<SquareCut> {
    let bounds = scan.bounds();
    let mut cut = SquareCut { squares: Vec::new(), heaviest: 0 };
    if bounds.is_empty() {
        return Ok(cut);
    }
    let mut open = vec![PlaneSquare::holding(&bounds, axis)];
    while let Some(square) = open.pop() {
        let column = square.column(&bounds, axis);
        if scan.most_in(&column)? == 0 {
            continue;
        }
        let Some(rim) = rim else {
            cut.heaviest = scan.most();
            cut.squares.push(square);
            continue;
        };
        let positions = scan.most_in(&column.grown(rim))?;
        let (rim, side) = (rim.unsigned_abs(), square.side());
        let is_narrow = side <= rim.saturating_mul(RIMS_ACROSS);
        // A smaller square would have hardly less in its rim.
        let is_least = side <= rim / 4;
        let quarters = square.quarters();
        match quarters.filter(|_| positions > wanted && !(is_narrow && positions <= most)) {
            Some(quarters) if !is_least => open.extend(quarters.into_iter().rev()),
            _ => {
                cut.heaviest = cut.heaviest.max(positions);
                cut.squares.push(square);
            }
        }
    }
    Ok(cut)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarters_are_stretches_of_the_curve_one_behind_the_other() {
        let bounds = Bounds { lo: [-3, -70, 2], hi: [9, 40, 2] };
        for axis in 0..3 {
            let all = PlaneSquare::holding(&bounds, axis);
            let quarters = all.quarters().unwrap();
            for (n, quarter) in quarters.iter().enumerate() {
                for place in [quarter.corner, quarter.last()] {
                    assert_eq!(all.side_of(place), Ordering::Equal);
                    let sides = quarters.map(|other| other.side_of(place));
                    let expected = [0, 1, 2, 3].map(|other| n.cmp(&other));
                    assert_eq!(sides, expected, "{quarter:?}");
                }
            }
            let column = all.column(&bounds, axis);
            assert!(column.holds(&bounds));
            assert_eq!((column.lo[axis], column.hi[axis]), (bounds.lo[axis], bounds.hi[axis]));
        }
        assert_eq!(PlaneSquare { corner: [4, 4], level: 0 }.quarters(), None);
    }
}
