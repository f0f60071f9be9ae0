//! The search of one point in integers alone: slower, and right whatever floats could not tell.

use super::kernel::Boxes;
use super::tree::{BoxTree, above, below};
use super::walk::{WIDENED, Work, lanes, nearest};
use crate::geom::simd::Simd;
use crate::point::{Position, distance2};

/// A neighbour by exact squared distance, then rank: ordered like that.
pub(super) type Neighbor = (u128, u32);

/// One point on its way through the tree, from the root.
pub(super) struct ExactWalk<'a> {
    simd: Simd,
    tree: &'a BoxTree,
    positions: &'a [Position],
    work: &'a mut Work,
    /// Where the point is that searches, and its rank if it is one of the positions.
    at: Position,
    own: Option<u32>,
    /// How many neighbours it wants.
    k: usize,
    /// No neighbour that it wants is beyond this one.
    limit: Neighbor,
    /// A float that no box is farther than whose points are within the limit.
    reach: f32,
    /// What it found, in order.
    found: &'a mut Vec<Neighbor>,
}

impl<'a> ExactWalk<'a> {
    /// The search of the point at `at`, of rank `own` if it is one of `positions`, for neighbours,
    /// of which none is beyond the last of `candidates`; the answer takes their place.
    pub fn new(
        simd: Simd,
        tree: &'a BoxTree,
        positions: &'a [Position],
        work: &'a mut Work,
        (at, own): (Position, Option<u32>),
        candidates: &'a mut Vec<Neighbor>,
    ) -> Self {
        let limit = candidates.last().copied().unwrap_or_default();
        let k = candidates.len();
        candidates.clear();
        let reach = reach(limit.0);
        ExactWalk { simd, tree, positions, work, at, own, k, limit, reach, found: candidates }
    }

    /// Finds the `k` nearest others.
    pub fn run(mut self) {
        if self.tree.levels > 0 {
            self.descend(self.tree.levels - 1, 0);
        }
    }

    /// Boxes are measured in floats, with everything rounded towards the point.
    fn descend(&mut self, level: usize, index: usize) {
        self.work.nodes += 1;
        let node = self.tree.node(level, index);
        let at = self.at;
        let from = |i: usize| at[i].wrapping_sub(node.origin[i]);
        let lo = std::array::from_fn(|i| below(from(i).saturating_sub(node.error)));
        let hi = std::array::from_fn(|i| above(from(i).saturating_add(node.error)));
        let (distances, near) = self.simd.run(Boxes { node, lo, hi, bound: self.reach });
        let mut left = near & lanes(node.children, None);
        while let Some(child) = nearest(&distances, left, self.reach) {
            left &= !(1 << child);
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
            let neighbor = (distance2(self.at, other), rank);
            if Some(rank) == self.own || neighbor > self.limit {
                continue;
            }
            if self.found.len() == self.k {
                self.found.pop();
            }
            let place = self.found.partition_point(|kept| *kept < neighbor);
            self.found.insert(place, neighbor);
            if self.found.len() == self.k {
                self.limit = self.found[self.k - 1];
                self.reach = reach(self.limit.0);
            }
        }
    }
}

/// The float of a squared distance, widened as boxes of true positions need.
fn reach(distance2: u128) -> f32 {
    ((distance2 as f32).next_up() * WIDENED).min(f32::MAX)
}
