//! Canonical order of what a run holds: radix sorts by the upper levels of the octree, and exact
//! comparison where these do not decide. Knows no records but through a comparison.
//!
//! A sort by comparison would compare each position some twenty times, with outcomes that look
//! random to the processor. A path through the upper levels of the octree fits one word with an
//! index beside it, and a radix sort moves these words a few times without a comparison. The few
//! that are equal by then are compared exactly.

use std::cmp::Ordering;

use super::TileKey;
use super::key::morton_path;
use crate::geom::morton::morton_cmp;
use crate::point::{Bounds, Position};

/// Groups up to this size are sorted by comparison.
const FEW: usize = 64;
/// Bits that one pass of the radix sort sorts by.
const DIGIT: u32 = 8;
const BUCKETS: usize = 1 << DIGIT;
/// Passes of the radix sort: 32 bits are ten levels of the octree and more.
const DIGITS: usize = 4;

/// The order of up to 2^32 positions. Entries are a path through the octree, as many of its upper
/// levels as there is room for, above the index of a position.
#[derive(Debug, Default)]
pub(crate) struct RunOrder {
    entries: Vec<u64>,
    spare: Vec<u64>,
}

impl RunOrder {
    /// Bytes that it holds for each position.
    pub const BYTES: usize = 2 * size_of::<u64>();

    /// Memory for the order of `capacity` positions.
    pub fn with_capacity(capacity: usize) -> Self {
        RunOrder { entries: Vec::with_capacity(capacity), spare: Vec::with_capacity(capacity) }
    }

    /// Sorts the indices of `positions` by Morton order; `equal` compares those that share one.
    pub fn sort(
        &mut self,
        positions: &[Position],
        equal: &impl Fn(usize, usize) -> Ordering,
    ) -> SortedIndices<'_> {
        let index_bits = (positions.len().max(2) - 1).ilog2() + 1;
        self.entries.clear();
        self.entries.extend(0..positions.len() as u64);
        self.spare.resize(positions.len(), 0);
        let sorter = Sorter { positions, index_bits, equal };
        sorter.sort(&mut self.entries, &mut self.spare);
        SortedIndices { entries: &self.entries, mask: sorter.mask() }
    }
}

/// Indices in order.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SortedIndices<'a> {
    entries: &'a [u64],
    mask: u64,
}

impl<'a> SortedIndices<'a> {
    /// Stretches of up to `count` indices, one after the other.
    pub fn chunks(self, count: usize) -> impl Iterator<Item = SortedIndices<'a>> {
        self.entries.chunks(count).map(move |entries| SortedIndices { entries, ..self })
    }

    /// The indices.
    pub fn indices(self) -> impl ExactSizeIterator<Item = usize> {
        self.entries.iter().map(move |entry| (entry & self.mask) as usize)
    }

    /// How many there are.
    pub fn len(self) -> usize {
        self.entries.len()
    }
}

struct Sorter<'a, E> {
    positions: &'a [Position],
    index_bits: u32,
    equal: &'a E,
}

impl<E: Fn(usize, usize) -> Ordering> Sorter<'_, E> {
    fn mask(&self) -> u64 {
        (1 << self.index_bits) - 1
    }

    fn index(&self, entry: u64) -> usize {
        (entry & self.mask()) as usize
    }

    /// Sorts entries whatever their paths. Where a path leaves many undecided, as beside a stray
    /// point far away, these are sorted by paths of their own: each time at least the level at
    /// which their cube is divided is new, so that paths of ten levels and more end soon.
    fn sort(&self, entries: &mut [u64], spare: &mut [u64]) {
        if entries.len() <= FEW {
            return self.compare(entries);
        }
        let indices = entries.iter().map(|&entry| self.index(entry));
        let bounds = Bounds::of(indices.map(|i| self.positions[i]));
        let root = TileKey::holding(&bounds);
        if root.level == 0 {
            return entries.sort_unstable_by(|&a, &b| (self.equal)(self.index(a), self.index(b)));
        }
        let path_bits = u64::BITS - self.index_bits;
        for entry in entries.iter_mut() {
            let i = self.index(*entry);
            *entry =
                morton_path(self.positions[i], root.level, path_bits) << self.index_bits | i as u64;
        }
        radix_sort(entries, spare, self.index_bits);
        let mut rest = entries;
        while let [first, ..] = *rest {
            let path = first >> self.index_bits;
            let alike = |entry: &&u64| **entry >> self.index_bits == path;
            let count = 1 + rest[1..].iter().take_while(alike).count();
            let (group, later) = rest.split_at_mut(count);
            if count > 1 {
                self.sort(group, &mut spare[..count]);
            }
            rest = later;
        }
    }

    fn compare(&self, entries: &mut [u64]) {
        entries.sort_unstable_by(|&a, &b| {
            let (a, b) = (self.index(a), self.index(b));
            morton_cmp(&self.positions[a], &self.positions[b]).then_with(|| (self.equal)(a, b))
        });
    }
}

/// Sorts by the bits from `lowest` on; `spare` is as long. The upper [`DIGITS`] digits are sorted
/// by, least significant first; what these leave equal, mostly one or two positions of a surface,
/// is compared.
fn radix_sort(entries: &mut [u64], spare: &mut [u64], lowest: u32) {
    if entries.len() <= BUCKETS * 8 {
        return entries.sort_unstable();
    }
    let (any, all) = entries.iter().fold((0, u64::MAX), |(any, all), &e| (any | e, all & e));
    let varying = u64::BITS - (any & !all).leading_zeros();
    let from = varying.saturating_sub(DIGITS as u32 * DIGIT).max(lowest);
    let digit =
        |entry: u64, d: usize| (entry >> from >> (d as u32 * DIGIT)) as usize & (BUCKETS - 1);
    let mut counts = [[0usize; BUCKETS]; DIGITS];
    for &entry in entries.iter() {
        (0..DIGITS).for_each(|d| counts[d][digit(entry, d)] += 1);
    }
    let count = entries.len();
    let (mut source, mut target) = (&mut *entries, &mut *spare);
    let mut moved = false;
    for (d, places) in counts.iter_mut().enumerate() {
        // A digit that all entries share sorts nothing.
        if places[digit(source[0], d)] == count {
            continue;
        }
        let mut begin = 0;
        for place in places.iter_mut() {
            begin += std::mem::replace(place, begin);
        }
        for &entry in source.iter() {
            let place = &mut places[digit(entry, d)];
            target[*place] = entry;
            *place += 1;
        }
        std::mem::swap(&mut source, &mut target);
        moved = !moved;
    }
    if moved {
        target.copy_from_slice(source);
    }
    if from > lowest {
        entries.chunk_by_mut(|a, b| a >> from == b >> from).for_each(|group| group.sort_unstable());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(positions: &[Position]) {
        let backwards = |a: usize, b: usize| b.cmp(&a);
        let mut order = RunOrder::default();
        let sorted: Vec<usize> = order.sort(positions, &backwards).indices().collect();
        let mut expected: Vec<usize> = (0..positions.len()).collect();
        expected.sort_by(|&a, &b| morton_cmp(&positions[a], &positions[b]).then(b.cmp(&a)));
        assert!(sorted == expected, "{} positions", positions.len());
    }

    /// Positions that look random, of `bits` bits.
    fn scattered(n: u64, bits: u32) -> Vec<Position> {
        let number = |i: u64| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ i << 7) as i64;
        (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2].map(|i| number(i) >> (64 - bits))).collect()
    }

    #[test]
    fn scattered_positions_of_any_extent_are_sorted() {
        for bits in [1, 4, 12, 21, 40, 63] {
            for n in [0, 1, 2, 65, 5000] {
                check(&scattered(n, bits));
            }
        }
    }

    #[test]
    fn a_cluster_beside_a_stray_point_is_sorted_and_so_are_copies() {
        let mut positions = scattered(5000, 9);
        positions.push([1 << 61, -(1 << 61), 7]);
        positions.extend(scattered(3000, 30));
        positions.extend([[5, 5, 5]; 3000]);
        check(&positions);
    }

    #[test]
    fn positions_on_a_line_are_sorted() {
        check(&(0..6000).map(|i| [i * 7919 % 6000, 0, 0]).collect::<Vec<_>>());
    }
}
