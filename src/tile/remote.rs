//! The nearest positions of one point anywhere in the scan: best-first search over the index.
//!
//! It is for the few positions whose neighbourhoods a tile cannot prove. Loading a wider rim for
//! all would cost more than these searches, and where a scan is empty around a point no width would
//! do. Boxes are visited by their distance, so no block is read that cannot hold a neighbour, and
//! the blocks last read are kept, as such positions lie side by side.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::sieve::{RecordRun, Runs, Sieve};
use crate::Result;
use crate::point::{Position, distance2};
use crate::store::morton_cmp;
use crate::store::{Reader, SealedTiles, first_of_each};

/// Decoded blocks that a search keeps for the next one.
const CACHED: usize = 64;

/// A best-first search with its cache of blocks; one a thread.
#[derive(Debug)]
pub struct Remote {
    cache: Vec<Cached>,
    reader: Reader,
    runs: Runs,
    open: BinaryHeap<Reverse<(u128, usize, usize)>>,
    found: Vec<FoundPosition>,
}

/// What a search keeps of a block: the positions that are seen, each with its place in the block.
#[derive(Debug, Clone)]
struct Cached {
    block: usize,
    positions: Vec<(Position, u32)>,
}

/// A position that a search found.
#[derive(Debug, Clone, Copy)]
pub(super) struct FoundPosition {
    /// Its squared distance.
    distance2: u128,
    pub(super) position: Position,
    /// Its block, and its place in it.
    pub(super) block: usize,
    pub(super) index: u32,
}

impl Default for Remote {
    fn default() -> Self {
        Remote {
            cache: vec![Cached { block: usize::MAX, positions: Vec::new() }; CACHED],
            reader: Reader::default(),
            runs: Runs::default(),
            open: BinaryHeap::new(),
            found: Vec::new(),
        }
    }
}

impl Remote {
    /// Bytes that it holds.
    pub const BYTES: u64 =
        ((CACHED + 2) * crate::store::BLOCK * size_of::<(Position, u32)>()) as u64 + (64 << 10);

    /// The `k` positions nearest to `p` other than itself, by exact squared distance, ties by
    /// Morton order, of those that `sieve` lets be seen; fewer if there are fewer. `bound` is a
    /// squared distance within which `k` others are known to lie, if one is known.
    pub(super) fn nearest(
        &mut self,
        (tiles, sieve): (&SealedTiles, &Sieve),
        p: Position,
        k: usize,
        bound: Option<u128>,
    ) -> Result<&[FoundPosition]> {
        self.search((tiles, sieve), p, k, bound, false)?;
        Ok(&self.found)
    }

    /// The `k` positions of all of a scan that are nearest to `p`, which need not be one of them,
    /// in the order of [`nearest`](Remote::nearest): `p` itself first if the scan has it.
    pub fn nearest_to<'f>(
        &mut self,
        tiles: &SealedTiles,
        p: Position,
        k: usize,
        found: &'f mut Vec<Position>,
    ) -> Result<&'f [Position]> {
        self.search((tiles, &Sieve::default()), p, k, None, true)?;
        found.clear();
        found.extend(self.found.iter().map(|found| found.position));
        Ok(found)
    }

    /// The number of the first record of the nearest position that was found last in `tiles`.
    pub fn record_of_nearest(&mut self, tiles: &SealedTiles) -> Result<Option<u64>> {
        let Some(nearest) = self.found.first() else { return Ok(None) };
        let (_, copies) = tiles.read(nearest.block, &mut self.reader)?;
        let first = tiles.block(nearest.block).first_record;
        Ok(first_of_each(first, copies).nth(nearest.index as usize))
    }

    fn search(
        &mut self,
        (tiles, sieve): (&SealedTiles, &Sieve),
        p: Position,
        k: usize,
        bound: Option<u128>,
        itself: bool,
    ) -> Result<()> {
        self.found.clear();
        self.open.clear();
        let root = tiles.root();
        if let Some(distance) = tiles.node_distance2(root, p) {
            self.open.push(Reverse((distance, root.0, root.1)));
        }
        while let Some(Reverse((distance, height, node))) = self.open.pop() {
            if distance > self.farthest(k, bound) {
                break;
            }
            if height == 0 {
                self.look_into((tiles, sieve), node, (p, itself), k, bound)?;
                continue;
            }
            for child in tiles.children((height, node)) {
                if let Some(distance) = tiles.node_distance2(child, p)
                    && distance <= self.farthest(k, bound)
                {
                    self.open.push(Reverse((distance, child.0, child.1)));
                }
            }
        }
        Ok(())
    }

    /// Squared distance beyond which nothing matters; what lies exactly there may still win a tie.
    fn farthest(&self, k: usize, bound: Option<u128>) -> u128 {
        let kth = if self.found.len() < k { u128::MAX } else { self.found[k - 1].distance2 };
        kth.min(bound.unwrap_or(u128::MAX))
    }

    fn look_into(
        &mut self,
        (tiles, sieve): (&SealedTiles, &Sieve),
        block: usize,
        (p, itself): (Position, bool),
        k: usize,
        bound: Option<u128>,
    ) -> Result<()> {
        let cached = &mut self.cache[block % CACHED];
        if cached.block != block {
            let (positions, copies) = tiles.read(block, &mut self.reader)?;
            cached.block = usize::MAX;
            cached.positions.clear();
            cached.positions.extend(positions.iter().copied().zip(0..));
            if sieve.is_fine(tiles) {
                let runs = &mut self.runs;
                runs.read(tiles, sieve, block, copies)?;
                let is_seen = |run: &RecordRun| run.is_in(sieve.seen);
                cached.positions.retain(|&(_, j)| runs.of(j as usize).iter().any(is_seen));
            }
            cached.block = block;
        }
        for i in 0..self.cache[block % CACHED].positions.len() {
            let (q, index) = self.cache[block % CACHED].positions[i];
            let distance = distance2(p, q);
            if q == p && !itself || distance > self.farthest(k, bound) {
                continue;
            }
            let nearer = |found: &FoundPosition| {
                let other = &found.position;
                found.distance2.cmp(&distance).then_with(|| morton_cmp(other, &q)).is_lt()
            };
            let place = self.found.partition_point(nearer);
            if place < k {
                self.found.truncate(k - 1);
                let found = FoundPosition { distance2: distance, position: q, block, index };
                self.found.insert(place, found);
            }
        }
        Ok(())
    }
}
