//! The initial cells of a tile: cubes anchored at world 0 that have a position in its core.

use std::ops::Range;

use super::corner;
use crate::point::{Bounds, Position};
use crate::tile::Cells as Partition;

/// Cells along an axis that a packed key can tell apart.
const PACKED_CELLS: i64 = 1 << 21;

/// A tile's positions, to be grouped by the cube of side `side` that they are in.
pub(super) struct Grouping<'a> {
    pub(super) positions: &'a [Position],
    pub(super) normals: &'a [[f32; 3]],
    pub(super) core: Range<usize>,
    pub(super) side: i64,
}

impl Grouping<'_> {
    /// Makes each cell with a core position a group of `cells`: its positions that have a normal, in
    /// Morton order. Returns how many groups have positions on both sides of a face of the tile.
    pub(super) fn run(&self, cells: &mut Partition) -> u64 {
        if self.core.is_empty() {
            return 0;
        }
        if self.side.count_ones() == 1 {
            return self.nodes(cells);
        }
        let first = Bounds::of(self.positions[self.core.clone()].iter().copied());
        let (lo, hi) = (corner(first.lo, self.side), corner(first.hi, self.side));
        let bounds = Bounds { lo, hi: hi.map(|v| v.saturating_add(self.side - 1)) };
        let cells_from_lo = |p: Position, axis: usize| {
            p[axis].div_euclid(self.side) - lo[axis].div_euclid(self.side)
        };
        if (0..3).all(|axis| cells_from_lo(hi, axis) < PACKED_CELLS) {
            self.sorted(cells, &bounds, |p| {
                (0..3)
                    .fold(0, |key, axis| key * PACKED_CELLS as u64 + cells_from_lo(p, axis) as u64)
            })
        } else {
            self.sorted(cells, &bounds, |p| corner(p, self.side))
        }
    }

    /// Cells that are octree nodes follow one another in Morton order.
    fn nodes(&self, cells: &mut Partition) -> u64 {
        let level = self.side.trailing_zeros();
        let same = |i: usize, j: usize| {
            let (a, b) = (self.positions[i], self.positions[j]);
            (0..3).all(|axis| (a[axis] ^ b[axis]) >> level == 0)
        };
        // A core smaller than a cell: the rest of the cell is before or behind it.
        let Range { start: mut first, end: mut last } = self.core;
        while first > 0 && same(first - 1, self.core.start) {
            first -= 1;
        }
        while last < self.positions.len() && same(last, self.core.end - 1) {
            last += 1;
        }
        cells.members.reserve_exact(last - first);
        let mut crossing = 0;
        for i in first..last {
            if i > first && !same(i - 1, i) {
                crossing += self.close(cells);
            }
            if self.has_normal(i) {
                cells.members.push(i as u32);
            }
        }
        crossing + self.close(cells)
    }

    /// Other cells are found by sorting the positions of `bounds` by cell.
    fn sorted<K: Ord>(
        &self,
        cells: &mut Partition,
        bounds: &Bounds,
        key: impl Fn(Position) -> K,
    ) -> u64 {
        let inside = |i: &usize| self.has_normal(*i) && bounds.contains(self.positions[*i]);
        let mut keyed: Vec<(K, u32)> =
            Vec::with_capacity((0..self.positions.len()).filter(inside).count());
        keyed.extend(
            (0..self.positions.len()).filter(inside).map(|i| (key(self.positions[i]), i as u32)),
        );
        keyed.sort_unstable();
        cells.members.reserve_exact(keyed.len());
        let mut crossing = 0;
        for (i, (cell, member)) in keyed.iter().enumerate() {
            if i > 0 && keyed[i - 1].0 != *cell {
                crossing += self.close(cells);
            }
            cells.members.push(*member);
        }
        crossing + self.close(cells)
    }

    /// Ends the group of the members since the last one, or drops them if none is in the core.
    /// Returns 1 if only some are.
    fn close(&self, cells: &mut Partition) -> u64 {
        let start = cells.ends.last().map_or(0, |&end| end as usize);
        let group = &cells.members[start..];
        let before = group.partition_point(|&i| (i as usize) < self.core.start);
        let core = group[before..].partition_point(|&i| (i as usize) < self.core.end);
        let crossing = core < group.len();
        if core == 0 {
            cells.members.truncate(start);
            return 0;
        }
        cells.ends.push(cells.members.len() as u32);
        u64::from(crossing)
    }

    fn has_normal(&self, i: usize) -> bool {
        !self.normals[i][0].is_nan()
    }
}
