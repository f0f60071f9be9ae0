//! The tree: leaves of 16 points side by side, nodes of 16 boxes side by side.
//!
//! Every node has a frame of its own, anchored at the middle of its box, so that 32-bit floats are
//! exact (or as fine as the node is small) wherever in the world it lies and however far away the
//! farthest point of the set is.

use super::refine::{Leaf, LeafRun, RUN};
use crate::geom::simd::LANES;
use crate::point::{Bounds, Position};

/// Integers up to here are exact in f32.
pub(super) const EXACT: i64 = 1 << 24;
/// Levels of a tree of 2^32 points at most.
const MAX_LEVELS: usize = 8;

/// Up to 16 boxes in the node's frame. The children of level 0 are leaves.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(super) struct BoxNode {
    /// Smallest x, y and z. In level 0 the extremes of the leaf's stored floats; above, rounded
    /// outward, so that the positions themselves are inside.
    pub lo: [[f32; LANES]; 3],
    /// Largest x, y and z.
    pub hi: [[f32; LANES]; 3],
    /// Smallest rank in each child; set in level 0 only.
    pub first: [u32; LANES],
    /// The position that is 0 in this frame.
    pub origin: Position,
    /// No position of the node is farther from the origin on any axis.
    pub reach: i64,
    /// No stored point is farther from its position on any axis; 0 when all are exact.
    pub error: i64,
    /// How many children there are.
    pub children: u32,
    /// The first child: a leaf in level 0, above it a node of the level below.
    pub first_child: u32,
}

/// All leaves and nodes; the memory stays from build to build.
#[derive(Debug, Default)]
pub(super) struct BoxTree {
    pub leaves: Vec<Leaf>,
    pub nodes: Vec<BoxNode>,
    /// Where each level starts in `nodes`, and where the last one ends.
    starts: [usize; MAX_LEVELS + 1],
    pub levels: usize,
    /// Exact boxes of the level being built.
    boxes: Vec<Bounds>,
}

impl BoxTree {
    /// Leaves, nodes and boxes of a tree of `points`, at most.
    fn sizes(points: usize) -> (usize, usize, usize) {
        let cuts = most_cuts(points);
        let mut level = points.div_ceil(RUN) + cuts;
        let (mut nodes, boxes) = (level, level);
        while level > 1 {
            level = level.div_ceil(LANES);
            nodes += level;
        }
        (points.div_ceil(LANES) + cuts, nodes, boxes)
    }

    /// Bytes of a tree of `points`.
    pub fn bytes(points: usize) -> usize {
        let (leaves, nodes, boxes) = BoxTree::sizes(points);
        leaves * size_of::<Leaf>() + nodes * size_of::<BoxNode>() + boxes * size_of::<Bounds>()
    }

    /// Makes room for `points`, so that building with as many or fewer allocates nothing.
    pub fn reserve(&mut self, points: usize) {
        let (leaves, nodes, boxes) = BoxTree::sizes(points);
        self.leaves.reserve_exact(leaves.saturating_sub(self.leaves.len()));
        self.nodes.reserve_exact(nodes.saturating_sub(self.nodes.len()));
        self.boxes.reserve_exact(boxes.saturating_sub(self.boxes.len()));
    }

    /// Room held, in leaves, nodes and boxes.
    #[cfg(test)]
    pub fn capacity(&self) -> [usize; 3] {
        [self.leaves.capacity(), self.nodes.capacity(), self.boxes.capacity()]
    }

    /// Rebuilds the tree over `positions`.
    pub fn build(&mut self, positions: &[Position]) {
        self.leaves.clear();
        self.nodes.clear();
        self.boxes.clear();
        self.reserve(positions.len());
        let mut run = LeafRun::new();
        let (mut start, mut cuts) = (0, most_cuts(positions.len()));
        while start < positions.len() {
            let mut of_run = &positions[start..positions.len().min(start + RUN)];
            if cuts > 0
                && let Some(end) = far_apart(of_run)
            {
                of_run = &of_run[..end];
                cuts -= 1;
            }
            let (node, bounds) = self.add_run(&mut run, start as u32, of_run);
            self.nodes.push(node);
            self.boxes.push(bounds);
            start += of_run.len();
        }
        self.starts = [0; MAX_LEVELS + 1];
        self.levels = usize::from(!positions.is_empty());
        self.starts[1] = self.nodes.len();
        while self.boxes.len() > 1 {
            self.add_level();
            self.levels += 1;
            self.starts[self.levels] = self.nodes.len();
        }
    }

    /// Leaves of one run, and the node above them.
    fn add_run(
        &mut self,
        run: &mut LeafRun,
        start: u32,
        positions: &[Position],
    ) -> (BoxNode, Bounds) {
        let bounds = Bounds::of(positions.iter().copied());
        let mut node = BoxNode::over(&bounds);
        // Rounded to nearest, a float below 2^(m+1) is off by at most 2^(m-24).
        node.error = match node.reach {
            0..=EXACT => 0,
            reach => 1 << (reach.ilog2() - 24),
        };
        node.first_child = self.leaves.len() as u32;
        run.fill(start, positions, node.origin);
        run.refine(positions.len());
        for (i, first) in (0..positions.len()).step_by(LANES).enumerate() {
            let leaf = run.leaf(first, positions.len());
            for axis in 0..3 {
                let used = &leaf.at[axis][..LANES.min(positions.len() - first)];
                node.lo[axis][i] = used.iter().fold(f32::INFINITY, |lo, &v| lo.min(v));
                node.hi[axis][i] = used.iter().fold(f32::NEG_INFINITY, |hi, &v| hi.max(v));
            }
            node.first[i] = leaf.rank.iter().fold(u32::MAX, |least, &r| least.min(r));
            self.leaves.push(leaf);
            node.children += 1;
        }
        (node, bounds)
    }

    /// One level above the highest; leaves its boxes in `boxes`.
    fn add_level(&mut self) {
        let parents = self.boxes.len().div_ceil(LANES);
        for parent in 0..parents {
            let first = parent * LANES;
            let children = &self.boxes[first..self.boxes.len().min(first + LANES)];
            let bounds = children.iter().fold(Bounds::EMPTY, |all, b| all.union(b));
            let mut node = BoxNode::over(&bounds);
            node.first_child = first as u32;
            for (i, child) in children.iter().enumerate() {
                for axis in 0..3 {
                    node.lo[axis][i] = below(child.lo[axis].wrapping_sub(node.origin[axis]));
                    node.hi[axis][i] = above(child.hi[axis].wrapping_sub(node.origin[axis]));
                }
                node.children += 1;
            }
            self.nodes.push(node);
            self.boxes[parent] = bounds;
        }
        self.boxes.truncate(parents);
    }

    /// Node `index` of `level`; its parent is node `index / 16` one level above.
    pub fn node(&self, level: usize, index: usize) -> &BoxNode {
        &self.nodes[self.starts[level] + index]
    }

    /// The node above the leaf with the point of this rank, or the last one.
    pub fn run_with(&self, rank: u32) -> usize {
        let begins = |run: &BoxNode| run.first.iter().fold(u32::MAX, |least, &r| least.min(r));
        self.nodes[..self.runs()].partition_point(|run| begins(run) <= rank).saturating_sub(1)
    }

    /// The nodes above the leaves.
    pub fn runs(&self) -> usize {
        self.starts[1]
    }
}

impl BoxNode {
    /// A node over `bounds`, still without children.
    fn over(bounds: &Bounds) -> BoxNode {
        let origin: Position =
            std::array::from_fn(|axis| i64::midpoint(bounds.lo[axis], bounds.hi[axis]));
        let reach = (0..3).fold(0, |reach: i64, axis| {
            let up = bounds.hi[axis].saturating_sub(origin[axis]);
            let down = origin[axis].saturating_sub(bounds.lo[axis]);
            reach.max(up).max(down)
        });
        BoxNode {
            lo: [[f32::INFINITY; LANES]; 3],
            hi: [[f32::NEG_INFINITY; LANES]; 3],
            first: [u32::MAX; LANES],
            origin,
            reach,
            error: 0,
            children: 0,
            first_child: 0,
        }
    }
}

/// How many runs may end early, so that a far point does not cost its run the precision. What more
/// there is is found all the same, only slower.
fn most_cuts(points: usize) -> usize {
    (points / 4096 + 16).min(points.saturating_sub(1))
}

/// Where a run is best cut, if its frame rounds and its first points are near to each other but
/// not to the next.
fn far_apart(run: &[Position]) -> Option<usize> {
    let reach = |run: &[Position]| BoxNode::over(&Bounds::of(run.iter().copied())).reach;
    let whole = reach(run);
    if whole <= EXACT {
        return None;
    }
    let far = |a: Position, b: Position| (0..3).any(|i| a[i].abs_diff(b[i]) >= whole as u64 / 4);
    let cut = (1..run.len()).find(|&i| far(run[i - 1], run[i]))?;
    (reach(&run[..cut]) < whole / 16).then_some(cut)
}

/// The largest f32 not above `v`.
pub(super) fn below(v: i64) -> f32 {
    let rounded = v as f32;
    // 2^63 itself is no i64: the cast would stop short of it.
    let up = rounded >= -(i64::MIN as f32) || rounded as i64 > v;
    if up { rounded.next_down() } else { rounded }
}

/// The smallest f32 not below `v`.
pub(super) fn above(v: i64) -> f32 {
    let rounded = v as f32;
    if (rounded as i64) < v { rounded.next_up() } else { rounded }
}
