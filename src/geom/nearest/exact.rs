//! The search of one point in integers alone: slower, and right whatever floats could not tell.

use super::tree::{LANES, Node, Tree};
use super::walk::Work;
use crate::point::{Position, distance2};

/// A neighbour by exact squared distance, then rank: ordered like that.
pub(super) type Neighbor = (u128, u32);

/// One point on its way through the tree, from the root.
pub(super) struct ExactWalk<'a> {
    pub tree: &'a Tree,
    pub positions: &'a [Position],
    pub work: &'a mut Work,
    /// The point that searches.
    pub query: u32,
    /// How many neighbours it wants.
    pub k: usize,
    /// No neighbour that it wants is beyond this one.
    pub limit: Neighbor,
    /// What it found, in order; room for `k`.
    pub found: &'a mut Vec<Neighbor>,
}

impl ExactWalk<'_> {
    /// Fills `found` with the `k` nearest others.
    pub fn run(mut self) {
        self.found.clear();
        if self.tree.levels > 0 {
            self.descend(self.tree.levels - 1, 0);
        }
    }

    fn descend(&mut self, level: usize, index: usize) {
        self.work.nodes += 1;
        let node = self.tree.node(level, index);
        let children = node.children as usize;
        let at = self.positions[self.query as usize];
        let mut distances = [0; LANES];
        for (child, distance) in distances[..children].iter_mut().enumerate() {
            *distance = box_distance2(node, child, at);
        }
        let mut left = (1u32 << children) - 1;
        while let Some(child) = nearest(&distances, left) {
            left &= !(1 << child);
            if distances[child] > self.limit.0 {
                return;
            }
            let child = node.first_child as usize + child;
            if level == 0 {
                self.meet(child);
            } else {
                self.descend(level - 1, child);
            }
        }
    }

    fn meet(&mut self, leaf: usize) {
        self.work.leaves += 1;
        for &rank in &self.tree.leaves[leaf].rank {
            let Some(&other) = self.positions.get(rank as usize) else { continue };
            let neighbor = (distance2(self.positions[self.query as usize], other), rank);
            if rank == self.query || neighbor > self.limit {
                continue;
            }
            if self.found.len() == self.k {
                self.found.pop();
            }
            let place = self.found.partition_point(|kept| *kept < neighbor);
            self.found.insert(place, neighbor);
            if self.found.len() == self.k {
                self.limit = self.found[self.k - 1];
            }
        }
    }
}

/// The lane of `left` with the smallest distance.
fn nearest(distances: &[u128; LANES], left: u32) -> Option<usize> {
    (0..LANES).filter(|lane| left >> lane & 1 == 1).min_by_key(|&lane| distances[lane])
}

/// Exact squared distance of a position to a child's box (all stored floats are integers), or less
/// by the error of stored points.
fn box_distance2(node: &Node, child: usize, at: Position) -> u128 {
    (0..3).fold(0u128, |sum, axis| {
        let q = i128::from(at[axis]) - i128::from(node.origin[axis]);
        let lo = node.lo[axis][child] as i128 - i128::from(node.error);
        let hi = node.hi[axis][child] as i128 + i128::from(node.error);
        let gap = (lo - q).max(q - hi).max(0) as u128;
        sum.saturating_add(gap.saturating_mul(gap))
    })
}
