//! The initial cells of a tile: cubes anchored at world 0 that have a position in its core.

use std::ops::Range;

use super::keys::Cells;
use super::settings::Reference;
use crate::geom::angle::is_known;
use crate::point::{Bounds, NORMAL, Position};
use crate::tile::{Partition, Tile};
use crate::{Error, Result};

/// Cells along an axis that a packed key can tell apart.
const PACKED_CELLS: i64 = 1 << 21;

impl Cells {
    /// The initial cells that have a position in the tile's core, in the memory of the tile's own,
    /// and how many of them cross its faces.
    pub(super) fn initial_cells(&self, tile: &mut Tile) -> Result<(Partition, u64)> {
        let side = self.settled()?.steps;
        if u32::try_from(tile.positions.len()).is_err() {
            return Err(Error::internal("a tile has more than 2^32 positions"));
        }
        let mut cells = std::mem::take(&mut tile.cells);
        cells.clear();
        cells.reference = self.direction().and_then(Reference::direction);
        let normals = tile.columns.get(&NORMAL)?;
        let crossing =
            Grouping { tile, normals, side, by_class: !self.by.is_empty() }.run(&mut cells);
        cells.turned.resize(cells.members.len(), false);
        Ok((cells, crossing))
    }
}

/// A tile's positions, to be grouped by the cube of side `side` that they are in.
pub(in crate::ops) struct Grouping<'a> {
    pub(in crate::ops) tile: &'a Tile,
    pub(in crate::ops) normals: &'a [[f32; 3]],
    pub(in crate::ops) side: i64,
    /// True if positions of different classes are in different cells.
    pub(in crate::ops) by_class: bool,
}

impl Grouping<'_> {
    /// Makes each cell with a core position a group of `cells`: the chosen positions of it that
    /// have a normal, in Morton order. Returns how many groups have positions on both sides of a
    /// face of the tile.
    pub(in crate::ops) fn run(&self, cells: &mut Partition) -> u64 {
        if self.tile.core.is_empty() {
            return 0;
        }
        if self.side.count_ones() == 1 {
            return self.nodes(cells);
        }
        let core = Bounds::of(self.tile.positions[self.tile.core.clone()].iter().copied());
        let (lo, hi) = (self.cell(core.lo), self.cell(core.hi));
        if (0..3).all(|axis| hi[axis] - lo[axis] < PACKED_CELLS) {
            let packed = |key, (v, lo)| key * PACKED_CELLS + (v - lo);
            self.sorted(cells, lo, hi, |cell| cell.into_iter().zip(lo).fold(0, packed))
        } else {
            self.sorted(cells, lo, hi, |cell| cell)
        }
    }

    /// Which cell along each axis, from world 0, a position is in.
    fn cell(&self, p: Position) -> [i64; 3] {
        p.map(|v| v.div_euclid(self.side))
    }

    /// Cells that are octree nodes follow one another in Morton order.
    fn nodes(&self, cells: &mut Partition) -> u64 {
        let level = self.side.trailing_zeros();
        let same = |i: usize, j: usize| {
            let (a, b) = (self.tile.positions[i], self.tile.positions[j]);
            (0..3).all(|axis| (a[axis] ^ b[axis]) >> level == 0)
        };
        // A core smaller than a cell: the rest of the cell is before or behind it.
        let Range { start: mut first, end: mut last } = self.tile.core.clone();
        while first > 0 && same(first - 1, self.tile.core.start) {
            first -= 1;
        }
        while last < self.tile.positions.len() && same(last, self.tile.core.end - 1) {
            last += 1;
        }
        cells.members.reserve_exact(last - first);
        cells.ends.reserve_exact(last - first);
        let mut crossing = 0;
        for i in first..last {
            if i > first && !same(i - 1, i) {
                crossing += self.close(cells);
            }
            if self.belongs(i) {
                cells.members.push(i as u32);
            }
        }
        crossing + self.close(cells)
    }

    /// Other cells are scattered over Morton order in runs, which are brought together by sorting.
    fn sorted<K: Ord>(
        &self,
        cells: &mut Partition,
        lo: [i64; 3],
        hi: [i64; 3],
        key: impl Fn([i64; 3]) -> K,
    ) -> u64 {
        let inside =
            |cell: [i64; 3]| (0..3).all(|axis| lo[axis] <= cell[axis] && cell[axis] <= hi[axis]);
        // Counted first: growing would hold more than the stage says it needs.
        let mut count = 0;
        self.runs(|cell, _| count += usize::from(inside(cell)));
        let mut runs = Vec::with_capacity(count);
        self.runs(|cell, run| {
            if inside(cell) {
                runs.push((key(cell), run.start as u32, run.end as u32));
            }
        });
        runs.sort_unstable();
        let length = |(_, start, end): &(K, u32, u32)| (end - start) as usize;
        cells.members.reserve_exact(runs.iter().map(length).sum());
        cells.ends.reserve_exact(runs.len());
        let mut crossing = 0;
        for (i, (cell, start, end)) in runs.iter().enumerate() {
            if i > 0 && runs[i - 1].0 != *cell {
                crossing += self.close(cells);
            }
            cells.members.extend((*start..*end).filter(|&i| self.belongs(i as usize)));
        }
        crossing + self.close(cells)
    }

    /// Calls `each` for every run of positions that are in one cell.
    fn runs(&self, mut each: impl FnMut([i64; 3], Range<usize>)) {
        let mut start = 0;
        while start < self.tile.positions.len() {
            let cell = self.cell(self.tile.positions[start]);
            let corner = cell.map(|v| v * self.side);
            let same = |p: &Position| {
                (0..3).all(|axis| (p[axis].wrapping_sub(corner[axis]) as u64) < self.side as u64)
            };
            let end =
                start + 1 + self.tile.positions[start + 1..].iter().take_while(|p| same(p)).count();
            each(cell, start..end);
            start = end;
        }
    }

    /// Ends the group of the members since the last one, or a group of each of their classes where
    /// classes are told apart. Returns how many have positions on both sides of a face of the tile.
    fn close(&self, cells: &mut Partition) -> u64 {
        let start = cells.ends.last().map_or(0, |&end| end as usize);
        if !self.by_class {
            return self.close_one(cells, start);
        }
        let class = |&i: &u32| self.tile.classes.get(i as usize).copied().unwrap_or_default();
        cells.members[start..].sort_by_key(class);
        let mixed = cells.members.split_off(start);
        let one = |group: &[u32]| {
            let start = cells.members.len();
            cells.members.extend_from_slice(group);
            self.close_one(cells, start)
        };
        mixed.chunk_by(|a, b| class(a) == class(b)).map(one).sum()
    }

    /// Ends the group of the members from `start` on, or drops them if none is in the core. Returns
    /// 1 if only some are.
    fn close_one(&self, cells: &mut Partition, start: usize) -> u64 {
        let group = &cells.members[start..];
        let before = group.partition_point(|&i| (i as usize) < self.tile.core.start);
        let core = group[before..].partition_point(|&i| (i as usize) < self.tile.core.end);
        let crossing = core < group.len();
        if core == 0 {
            cells.members.truncate(start);
            return 0;
        }
        cells.ends.push(cells.members.len() as u32);
        u64::from(crossing)
    }

    fn belongs(&self, i: usize) -> bool {
        self.tile.is_chosen(i) && is_known(self.normals[i])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_that_are_not_chosen_are_in_no_cell() {
        for side in [8, 7] {
            let mut tile = Tile::of((0..6).map(|x| [x, 0, 0]).collect());
            let mut normals = [[0.0, 0.0, 1.0]; 6];
            normals[5] = [f32::NAN; 3];
            (tile.selections, tile.limits) = (vec![3, 1, 2, 0, 3, 3], 2);
            let mut cells = Partition::default();
            Grouping { tile: &tile, normals: &normals, side, by_class: false }.run(&mut cells);
            assert_eq!((cells.members, cells.ends), (vec![0, 2, 4], vec![3]), "side {side}");
        }
    }
}
