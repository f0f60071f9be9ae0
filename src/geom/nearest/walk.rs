//! The walk of one leaf's points through the tree: from their own leaf upward, and from every
//! ancestor down into whatever is near enough to matter; or, through the tree of another set, down
//! from its root.

use super::batch::Batch;
use super::kernel::{Boxes, Guests, Home, Visit};
use super::refine::Leaf;
use super::tree::{BoxNode, BoxTree, EXACT, above, below};
use crate::geom::simd::{LANES, Simd};
use crate::point::Position;

/// Above level 0, boxes are measured against bounds this much larger. Their distances are those of
/// true positions up to five roundings, (1 + 2^-24)^5, so that nothing as near as the bound is
/// passed over, neither by float nor by integer distance.
pub(super) const WIDENED: f32 = 1.0 + 1.0 / (1 << 20) as f32;

/// What a search did, for tests and for tuning.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct Work {
    /// Points that searched.
    pub queries: u64,
    /// Points that the search in floats could not prove, redone in integers.
    pub redone: u64,
    /// Nodes of 16 boxes that a leaf's points looked at together, or a redone point alone.
    pub nodes: u64,
    /// Leaves of 16 points that a leaf's points looked at together, or a redone point alone.
    pub leaves: u64,
}

/// The points of a leaf, which search together.
#[derive(Clone, Copy)]
pub(super) struct Visitors<'a> {
    /// The level-0 node of the leaf, in whose frame the points are.
    pub node: &'a BoxNode,
    /// Which of its children the leaf is.
    pub child: usize,
    pub leaf: &'a Leaf,
}

impl<'a> Visitors<'a> {
    /// The points of leaf `child` of the level-0 node `run`.
    pub fn of(tree: &'a BoxTree, run: usize, child: usize) -> Visitors<'a> {
        let node = tree.node(0, run);
        Visitors { node, child, leaf: &tree.leaves[node.first_child as usize + child] }
    }

    /// The box of the points, in the frame of their node.
    fn extremes(&self) -> [[f32; 3]; 2] {
        [self.node.lo, self.node.hi].map(|side| side.map(|axis| axis[self.child]))
    }
}

/// One leaf's points on their way.
pub(super) struct TreeWalk<'a> {
    simd: Simd,
    tree: &'a BoxTree,
    batch: &'a mut Batch,
    work: &'a mut Work,
    visitors: Visitors<'a>,
    /// The level-0 node of the leaf in the tree that it walks through, if it is of that.
    home: Option<usize>,
    /// Exact box of the leaf's points.
    lo: Position,
    hi: Position,
    /// No coordinate difference that was computed is off by more than this, besides its own
    /// relative rounding: 0 while all coordinates are exact integers.
    error: f64,
}

impl<'a> TreeWalk<'a> {
    /// The way of `visitors` through a tree.
    pub fn new(
        simd: Simd,
        tree: &'a BoxTree,
        batch: &'a mut Batch,
        work: &'a mut Work,
        visitors: Visitors<'a>,
    ) -> Self {
        let Visitors { node, .. } = visitors;
        let [lo, hi] = visitors.extremes();
        let lo = std::array::from_fn(|axis| {
            let stored = node.origin[axis].saturating_add(lo[axis] as i64);
            stored.saturating_sub(node.error)
        });
        let hi = std::array::from_fn(|axis| {
            let stored = node.origin[axis].saturating_add(hi[axis] as i64);
            stored.saturating_add(node.error)
        });
        TreeWalk { simd, tree, batch, work, visitors, home: None, lo, hi, error: 0.0 }
    }

    /// Fills the batch with the `kept` nearest by float distance of the lanes in `wanted`, and
    /// returns the largest error of a coordinate difference, in lattice steps: see [`super`]. The
    /// points are of another tree; those of the level-0 node `near` are likely to be near to them.
    pub fn run_as_guests(mut self, near: usize, wanted: u32, kept: usize) -> f64 {
        let node = self.tree.node(0, near);
        let (lo, hi) = self.in_frame(node);
        let (distances, _) = self.simd.run(Boxes { node, lo, hi, bound: 0.0 });
        let child = nearest(&distances, lanes(node.children, None), f32::INFINITY).unwrap_or(0);
        self.note_error(near);
        let guests = Guests {
            points: &self.visitors.leaf.at,
            shift: self.shift(near),
            leaf: &self.tree.leaves[node.first_child as usize + child],
            batch: self.batch,
            wanted,
            kept,
        };
        self.simd.run(guests);
        self.climb(near, child)
    }

    /// The same of the points of the level-0 node `home` of the tree, among the others of it.
    pub fn run(mut self, home: usize, wanted: u32, kept: usize) -> f64 {
        self.home = Some(home);
        self.simd.run(Home { batch: self.batch, leaf: self.visitors.leaf, wanted, kept });
        let child = self.visitors.child;
        self.climb(home, child)
    }

    /// From a leaf, which the points have met, upward, and from every ancestor down.
    fn climb(mut self, run: usize, leaf: usize) -> f64 {
        self.visit_run(run, Some(leaf));
        let mut child = run;
        for level in 1..self.tree.levels {
            let parent = child / LANES;
            self.descend(level, parent, Some(child % LANES));
            child = parent;
        }
        self.error
    }

    /// A box around the points in the frame of a node, rounded outward.
    fn in_frame(&self, node: &BoxNode) -> ([f32; 3], [f32; 3]) {
        (
            std::array::from_fn(|i| below(self.lo[i].saturating_sub(node.origin[i]))),
            std::array::from_fn(|i| above(self.hi[i].saturating_sub(node.origin[i]))),
        )
    }

    /// Visits the children of a node above level 0, nearest first, except `skip`.
    fn descend(&mut self, level: usize, index: usize, skip: Option<usize>) {
        self.work.nodes += 1;
        let node = self.tree.node(level, index);
        let (lo, hi) = self.in_frame(node);
        let (distances, near) = self.simd.run(Boxes { node, lo, hi, bound: self.reach() });
        let mut left = near & lanes(node.children, skip);
        while let Some(child) = nearest(&distances, left, self.reach()) {
            left &= !(1 << child);
            let child = node.first_child as usize + child;
            if level == 1 {
                self.visit_run(child, None);
            } else {
                self.descend(level - 1, child, None);
            }
        }
    }

    /// Visits the leaves of a level-0 node, nearest first, except `skip`.
    fn visit_run(&mut self, index: usize, skip: Option<usize>) {
        self.work.nodes += 1;
        self.note_error(index);
        let node = self.tree.node(0, index);
        let first = node.first_child as usize;
        let shift = self.shift(index);
        let [lo, hi] = self.visitors.extremes();
        let visit = Visit {
            batch: self.batch,
            node,
            leaves: &self.tree.leaves[first..first + node.children as usize],
            left: lanes(node.children, skip),
            points: &self.visitors.leaf.at,
            lo,
            hi,
            shift,
        };
        self.work.leaves += self.simd.run(visit);
    }

    /// From the frame of the home node to that of another.
    fn shift(&self, index: usize) -> [f32; 3] {
        let (home, other) = (self.visitors.node, self.tree.node(0, index));
        std::array::from_fn(|axis| home.origin[axis].wrapping_sub(other.origin[axis]) as f32)
    }

    /// Notes what moving the points into the frame of a level-0 node costs in precision.
    fn note_error(&mut self, index: usize) {
        let shift = self.shift(index);
        let (home, other) = (self.visitors.node, self.tree.node(0, index));
        let far = shift.iter().fold(0.0, |far: f64, s| far.max(f64::from(s.abs())));
        let reach = far + home.reach as f64;
        let mut error = (home.error + other.error) as f64;
        if self.home != Some(index) && reach > EXACT as f64 {
            // Rounding of the shift, at most 2^-24 of it, and of the sum; second orders are less
            // than the 2^-20 added.
            error += (far + reach) * f64::from(WIDENED) / EXACT as f64;
        }
        self.error = self.error.max(error);
    }

    /// How far boxes above level 0 matter.
    fn reach(&self) -> f32 {
        (self.batch.farthest * WIDENED).min(f32::MAX)
    }
}

/// The first `children` lanes as a mask, without `skip`.
pub(super) fn lanes(children: u32, skip: Option<usize>) -> u32 {
    let all = (1 << children) - 1;
    skip.map_or(all, |lane| all & !(1 << lane))
}

/// The lane of `left` with the smallest distance, if that is not above `reach`.
pub(super) fn nearest(distances: &[f32; LANES], mut left: u32, reach: f32) -> Option<usize> {
    if left == 0 {
        return None;
    }
    let mut best = left.trailing_zeros() as usize & (LANES - 1);
    left &= left - 1;
    while left != 0 {
        let lane = left.trailing_zeros() as usize & (LANES - 1);
        left &= left - 1;
        best = if distances[lane] < distances[best] { lane } else { best };
    }
    (distances[best] <= reach).then_some(best)
}
