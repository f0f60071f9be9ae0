//! The division of a cell into parts whose normals agree.

use super::{Cells, Split, corner};
use crate::geom::angle::{MaxAngle, cosine, dominant_axis, is_turned, outer_sum};
use crate::point::{Bounds, Position, distance2};
use crate::tile::Cells as Partition;

/// Divisions that a part may be deep, besides two for every doubling of the cell's positions,
/// before it is cut in eight.
const DEEPEST: u32 = 64;
/// Sides up to which squared distances within a cell fit in an i64.
const SHORT_SIDE: i64 = 1 << 30;

/// When and how a cell is divided.
pub(super) struct Rule {
    reference: [f64; 3],
    max_angle: MaxAngle,
    min_points: usize,
    split: Split,
    side: i64,
}

impl Rule {
    pub(super) fn new(cells: &Cells, reference: [f64; 3], side: i64) -> Self {
        Rule {
            reference,
            max_angle: MaxAngle::new(cells.max_angle),
            min_points: cells.min_points.get(),
            split: cells.split,
            side,
        }
    }
}

/// Members `start..end` of a cell, cut off by `depth` divisions.
struct Part {
    start: usize,
    end: usize,
    depth: u32,
}

/// The positions with the smallest and the largest angle of a part.
struct Extremes {
    nearest: Position,
    farthest: Position,
}

/// Divides cells of one tile, one after the other, in memory that it keeps.
pub(super) struct Division<'a> {
    rule: Rule,
    positions: &'a [Position],
    normals: &'a [[f32; 3]],
    stack: Vec<Part>,
    spare: Vec<u32>,
}

impl<'a> Division<'a> {
    pub(super) fn new(rule: Rule, positions: &'a [Position], normals: &'a [[f32; 3]]) -> Self {
        Division { rule, positions, normals, stack: Vec::new(), spare: Vec::new() }
    }

    /// Divides the initial cell `members[start..end]` of `cells`: reorders the members part by part,
    /// each in Morton order, says which of their normals are turned, and adds the end of each part.
    /// Returns true if a part was so deep that it was cut in eight.
    pub(super) fn run(&mut self, start: usize, end: usize, cells: &mut Partition) -> bool {
        let Partition { members, turned, ends, .. } = cells;
        if self.spare.len() < end - start {
            self.spare.reserve_exact(end - start - self.spare.len());
            self.spare.resize(end - start, 0);
        }
        let deepest = DEEPEST + 2 * (end - start).max(1).ilog2();
        let mut cut_deep = false;
        self.stack.push(Part { start, end, depth: 0 });
        while let Some(Part { start, end, depth }) = self.stack.pop() {
            let part = &mut members[start..end];
            let Some(extremes) = self.survey(part, &mut turned[start..end]) else {
                ends.push(end as u32);
                continue;
            };
            let pushed = self.stack.len();
            if self.rule.split == Split::Voronoi && depth < deepest {
                self.bisect(start, part, depth, &extremes);
            } else {
                cut_deep |= self.rule.split == Split::Voronoi;
                self.cut_in_eight(start, part, depth);
            }
            if self.stack.len() - pushed < 2 {
                // Only positions that are not distinct cannot be told apart.
                self.stack.truncate(pushed);
                ends.push(end as u32);
            }
        }
        cut_deep
    }

    /// Turns the normals of a part to its own dominant axis; returns the extremes of their angles,
    /// of equal ones the first, if the part is to be divided.
    fn survey(&self, part: &[u32], turned: &mut [bool]) -> Option<Extremes> {
        let normal = |i: u32| self.normals[i as usize];
        if let ([only], [turned]) = (part, &mut *turned) {
            // Half of all parts where cells are divided to the last; its own normal is the axis.
            *turned = is_turned([0.0; 3], normal(*only));
            return None;
        }
        let axis = dominant_axis(outer_sum(part.iter().map(|&i| normal(i))));
        let mut smallest = (f64::NEG_INFINITY, 0);
        let mut largest = (f64::INFINITY, 0);
        for (&i, turned) in part.iter().zip(turned) {
            *turned = is_turned(axis, normal(i));
            let cosine = cosine(self.rule.reference, normal(i), *turned);
            if cosine > smallest.0 {
                smallest = (cosine, i);
            }
            if cosine < largest.0 {
                largest = (cosine, i);
            }
        }
        let divide = part.len() > self.rule.min_points
            && self.rule.max_angle.is_exceeded(smallest.0, largest.0);
        divide.then(|| Extremes {
            nearest: self.positions[smallest.1 as usize],
            farthest: self.positions[largest.1 as usize],
        })
    }

    /// Parts the members by the bisector of the two extremes; equally far ones go to the smallest
    /// angle's.
    fn bisect(&mut self, start: usize, part: &mut [u32], depth: u32, extremes: &Extremes) {
        let &Extremes { nearest, farthest } = extremes;
        let positions = self.positions;
        let cut = if self.rule.side <= SHORT_SIDE {
            // |x − a|² ≤ |x − b|² as 2 (x − a)·(b − a) ≤ |b − a|², exact as every term is below 2^61.
            let apart: [i64; 3] = std::array::from_fn(|axis| farthest[axis] - nearest[axis]);
            let apart2: i64 = apart.iter().map(|d| d * d).sum();
            self.part_in_two(part, |i| {
                let p = positions[i as usize];
                let along: i64 = (0..3).map(|axis| (p[axis] - nearest[axis]) * apart[axis]).sum();
                2 * along <= apart2
            })
        } else {
            self.part_in_two(part, |i| {
                let p = positions[i as usize];
                distance2(p, nearest) <= distance2(p, farthest)
            })
        };
        let end = start + part.len();
        for range in [start + cut..end, start..start + cut] {
            if !range.is_empty() {
                self.stack.push(Part { start: range.start, end: range.end, depth: depth + 1 });
            }
        }
    }

    /// Brings the members for which `first` holds to the front, both parts in the order they had;
    /// returns how many there are.
    fn part_in_two(&mut self, part: &mut [u32], first: impl Fn(u32) -> bool) -> usize {
        let (mut front, mut back) = (0, 0);
        for at in 0..part.len() {
            // Both are written and one is counted: no branch to mispredict.
            let i = part[at];
            part[front] = i;
            self.spare[back] = i;
            let is_first = usize::from(first(i));
            front += is_first;
            back += 1 - is_first;
        }
        part[front..].copy_from_slice(&self.spare[..back]);
        front
    }

    /// Parts the members by the octants of the smallest octant of the initial cell that holds them.
    fn cut_in_eight(&mut self, start: usize, part: &mut [u32], depth: u32) {
        let positions = self.positions;
        let tight = Bounds::of(part.iter().map(|&i| positions[i as usize]));
        let Some(middle) = middle(&tight, self.rule.side) else { return };
        let octant = |i: u32| {
            let p = positions[i as usize];
            (0..3).fold(0, |octant, axis| octant | usize::from(p[axis] >= middle[axis]) << axis)
        };
        let mut bounds = [0; 9];
        part.iter().for_each(|&i| bounds[octant(i) + 1] += 1);
        for i in 0..8 {
            bounds[i + 1] += bounds[i];
        }
        let mut next = bounds;
        let spare = &mut self.spare[..part.len()];
        spare.copy_from_slice(part);
        for &mut i in spare {
            let octant = octant(i);
            part[next[octant]] = i;
            next[octant] += 1;
        }
        for octant in bounds.windows(2).rev().filter(|octant| octant[0] < octant[1]) {
            let (start, end) = (start + octant[0], start + octant[1]);
            self.stack.push(Part { start, end, depth: depth + 1 });
        }
    }
}

/// Smallest corner of the last octant of the smallest octant of a cell that holds `bounds`; the
/// lower half of an odd side is the longer one. None if `bounds` is a single position.
fn middle(bounds: &Bounds, side: i64) -> Option<Position> {
    let mut corner = corner(bounds.lo, side);
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
        assert_eq!(middle(&bounds([0; 3], [7; 3]), 8), Some([4; 3]));
        assert_eq!(middle(&bounds([4; 3], [5, 4, 4]), 8), Some([5; 3]));
        assert_eq!(middle(&bounds([-7; 3], [-1; 3]), 7), Some([-3; 3]));
        assert_eq!(middle(&bounds([3; 3], [3; 3]), 7), None);
        // A side of 3 is halved into 2 and 1: octants need not be cubes.
        assert_eq!(middle(&bounds([0, 2, 0], [1, 2, 0]), 3), Some([1, 3, 1]));
    }
}
