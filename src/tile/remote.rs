//! The nearest positions of one point anywhere in the scan: best-first search over the index.
//!
//! It is for the few positions whose neighbourhoods a tile cannot prove. Loading a wider rim for
//! all would cost more than these searches, and where a scan is empty around a point no width would
//! do. Boxes are visited by their distance, so no block is read that cannot hold a neighbour, and
//! the blocks last read are kept, as such positions lie side by side.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::sieve::{Runs, Sieve};
use crate::Result;
use crate::point::{Position, distance2};
use crate::store::morton_cmp;
use crate::store::{Reader, SealedTiles};

/// Decoded blocks that a search keeps for the next one.
const CACHED: usize = 64;

/// A best-first search with its cache of blocks; one a thread.
#[derive(Debug)]
pub struct Remote {
    cache: Vec<(usize, Vec<Position>)>,
    reader: Reader,
    runs: Runs,
    open: BinaryHeap<Reverse<(u128, usize, usize)>>,
    found: Vec<(u128, Position)>,
}

impl Default for Remote {
    fn default() -> Self {
        Remote {
            cache: vec![(usize::MAX, Vec::new()); CACHED],
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
        ((CACHED + 2) * crate::store::BLOCK * size_of::<Position>()) as u64 + (64 << 10);

    /// The `k` positions nearest to `p` other than itself, by exact squared distance, ties by
    /// Morton order, of those that `sieve` lets be seen; fewer if there are fewer. `bound` is a
    /// squared distance within which `k` others are known to lie, if one is known.
    pub fn nearest(
        &mut self,
        (tiles, sieve): (&SealedTiles, &Sieve),
        p: Position,
        k: usize,
        bound: Option<u128>,
    ) -> Result<impl Iterator<Item = Position> + '_> {
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
                self.look_into((tiles, sieve), node, p, k, bound)?;
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
        Ok(self.found.iter().map(|found| found.1))
    }

    /// Squared distance beyond which nothing matters; what lies exactly there may still win a tie.
    fn farthest(&self, k: usize, bound: Option<u128>) -> u128 {
        let kth = if self.found.len() < k { u128::MAX } else { self.found[k - 1].0 };
        kth.min(bound.unwrap_or(u128::MAX))
    }

    fn look_into(
        &mut self,
        (tiles, sieve): (&SealedTiles, &Sieve),
        block: usize,
        p: Position,
        k: usize,
        bound: Option<u128>,
    ) -> Result<()> {
        let slot = block % CACHED;
        if self.cache[slot].0 != block {
            let (positions, copies) = tiles.read(block, &mut self.reader)?;
            let cached = &mut self.cache[slot];
            cached.0 = usize::MAX;
            cached.1.clear();
            cached.1.extend_from_slice(positions);
            if sieve.is_fine(tiles) {
                let runs = &mut self.runs;
                runs.read(tiles, sieve, block, copies)?;
                let mut j = 0;
                cached.1.retain(|_| {
                    j += 1;
                    runs.of(j - 1).iter().any(|run| run.is_in(sieve.seen))
                });
            }
            cached.0 = block;
        }
        for i in 0..self.cache[slot].1.len() {
            let q = self.cache[slot].1[i];
            let distance = distance2(p, q);
            if q == p || distance > self.farthest(k, bound) {
                continue;
            }
            let nearer = |found: &(u128, Position)| {
                found.0.cmp(&distance).then_with(|| morton_cmp(&found.1, &q)).is_lt()
            };
            let place = self.found.partition_point(nearer);
            if place < k {
                self.found.truncate(k - 1);
                self.found.insert(place, (distance, q));
            }
        }
        Ok(())
    }
}
