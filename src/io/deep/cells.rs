//! How dense points are, as seen from above: the squares that have some are counted, so that what
//! lies around a scan and holes in it play no part.
//!
//! Squares are as narrow as so many can be held: when there are too many, four become one. A square
//! of the wider ones is exactly four of the narrower, so that their width in the end is a function
//! of the points alone, whoever saw which first.

use std::collections::HashSet;

use crate::geom::hash::PlaceHashes;

/// Squares that are held.
const MOST: usize = 1 << 18;
/// Bytes that they take in a table that grows.
pub const CELL_BYTES: u64 = 17 * 4 * MOST as u64;
/// Width of the narrowest squares: 2 to this power, in the unit of the coordinates.
const NARROWEST: i32 = -24;
/// Binary digits of a coordinate that squares tell apart at most.
const DIGITS: i32 = 40;
/// Points that a square with points is to have on average, so that its count says something.
const POINTS: u64 = 16;

/// The squares that have points.
#[derive(Debug, Clone)]
pub struct OccupiedCells {
    exponent: i32,
    cells: HashSet<[i64; 2], PlaceHashes>,
    /// The last that was added: points come beside each other.
    last: Option<[i64; 2]>,
}

impl Default for OccupiedCells {
    fn default() -> Self {
        OccupiedCells { exponent: NARROWEST, cells: HashSet::default(), last: None }
    }
}

/// 2 to this power.
pub fn power(exponent: i32) -> f64 {
    2f64.powi(exponent)
}

/// The power of two at or below a finite number.
pub fn exponent_of(number: f64) -> i32 {
    (number.to_bits() >> 52 & 0x7ff) as i32 - 1023
}

impl OccupiedCells {
    /// Adds a point, whose coordinates are finite.
    pub fn add(&mut self, x: f64, y: f64) {
        let least = exponent_of(x).max(exponent_of(y)) - DIGITS;
        if least > self.exponent {
            self.join(least);
        }
        let cell = [x, y].map(|v| (v * power(-self.exponent)).floor() as i64);
        if self.last == Some(cell) {
            return;
        }
        self.last = Some(cell);
        self.cells.insert(cell);
        self.thin();
    }

    fn thin(&mut self) {
        while self.cells.len() > MOST {
            self.join(self.exponent + 1);
        }
    }

    /// Makes squares as wide as 2 to this power.
    fn join(&mut self, exponent: i32) {
        self.cells = joined(&self.cells, exponent - self.exponent);
        (self.exponent, self.last) = (exponent, None);
    }

    /// Adds the squares of other points.
    pub fn merge(&mut self, mut other: OccupiedCells) {
        let exponent = self.exponent.max(other.exponent);
        self.join(exponent);
        other.join(exponent);
        self.cells.extend(other.cells);
        self.thin();
    }

    /// The side of a square and how many have some of these points: of the narrowest squares that
    /// have enough points each. None for points too few, or that are all in one place.
    pub fn counted(&self, points: u64) -> Option<(f64, u64)> {
        let (mut cells, mut exponent) = (self.cells.clone(), self.exponent);
        while points / POINTS < cells.len() as u64 {
            cells = joined(&cells, 1);
            exponent += 1;
            if cells.len() <= 4 {
                break;
            }
        }
        (cells.len() > 4).then(|| (power(exponent), cells.len() as u64))
    }
}

/// Squares 2 to the power `by` as wide.
fn joined(cells: &HashSet<[i64; 2], PlaceHashes>, by: i32) -> HashSet<[i64; 2], PlaceHashes> {
    let by = by.clamp(0, 63);
    cells.iter().map(|cell| cell.map(|at| at >> by)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(points: impl Iterator<Item = (f64, f64)>) -> OccupiedCells {
        let mut cells = OccupiedCells::default();
        points.for_each(|(x, y)| cells.add(x, y));
        cells
    }

    /// Points of a grid, 0.25 apart, on a square with a hole.
    fn grid(side: u32) -> impl Iterator<Item = (f64, f64)> {
        let at = |n: u32| f64::from(n) * 0.25 + 5e5;
        let all = (0..side).flat_map(move |i| (0..side).map(move |j| (i, j)));
        let hole = side / 4..side / 2;
        all.filter(move |(i, j)| !(hole.contains(i) && hole.contains(j)))
            .map(move |(i, j)| (at(i), at(j)))
    }

    #[test]
    fn the_density_of_a_grid_with_a_hole_is_that_of_the_grid() {
        for side in [256, 1024] {
            let points: Vec<_> = grid(side).collect();
            let (width, count) =
                cells(points.iter().copied()).counted(points.len() as u64).unwrap();
            let density = points.len() as f64 / (count as f64 * width * width);
            assert!((density - 16.0).abs() < 0.5, "{density} in {count} of {width}");
        }
    }

    #[test]
    fn who_saw_which_points_changes_nothing() {
        let points: Vec<_> = grid(1200).chain([(-1e9, 1e12), (0.0, -0.0)]).collect();
        assert!(points.len() > MOST, "squares are joined");
        let whole = cells(points.iter().copied());
        let (one, two) = points.split_at(points.len() / 3);
        let mut merged = cells(two.iter().rev().copied());
        merged.merge(cells(one.iter().copied()));
        assert_eq!((merged.exponent, &merged.cells), (whole.exponent, &whole.cells));
    }

    #[test]
    fn points_in_one_place_have_no_density() {
        assert_eq!(cells((0..1000).map(|_| (3.0, 4.0))).counted(1000), None);
        assert_eq!(cells((0..3).map(|n| (f64::from(n), 4.0))).counted(3), None);
        assert_eq!(cells(std::iter::empty()).counted(0), None);
    }
}
