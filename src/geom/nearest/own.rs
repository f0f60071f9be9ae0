//! The search within one set, and how any answer is proven or redone: see [`super`].

use super::batch::{Batch, distance_of};
use super::exact::{ExactWalk, Neighbor};
use super::tree::{BoxNode, BoxTree, EXACT};
use super::walk::{TreeWalk, Visitors, Work};
use crate::geom::simd::{LANES, Simd};
use crate::point::{Position, distance2};

/// The relative error of the root of a float distance, 2.5 · 2^-24, rounded up.
const ROUNDING: f64 = 1.0 / (1 << 22) as f64;

/// The search of the k nearest neighbours within a set; its memory stays from set to set.
///
/// ```
/// use pointmill::internals::Nearest;
///
/// let positions = [[0, 0, 0], [1, 0, 0], [5, 0, 0], [7, 0, 0]];
/// let mut nearest = Nearest::new();
/// nearest.build(&positions);
/// let mut found = Vec::new();
/// nearest.search(&positions, 2, |i| i == 2, |i, neighbors, distance2| {
///     found.push((i, neighbors.to_vec(), distance2));
/// });
/// assert_eq!(found, [(2, vec![3, 1], 16)]);
/// ```
#[derive(Debug)]
pub struct Nearest {
    pub(super) simd: Simd,
    pub(super) tree: BoxTree,
    points: usize,
    pub(super) batch: Batch,
    found: Vec<Neighbor>,
    pub(super) neighbors: Vec<u32>,
    pub(super) work: Work,
}

impl Default for Nearest {
    fn default() -> Self {
        Nearest::new()
    }
}

impl Nearest {
    /// Bytes that a set holds per position, besides [`FIXED_BYTES`](Self::FIXED_BYTES).
    pub const BYTES_PER_POINT: usize = 19;
    /// Bytes that any set holds, however small, besides 1 KiB and up to 256 for each
    /// neighbour asked for.
    pub const FIXED_BYTES: usize = 32 << 10;

    /// Bytes that a search of `k` neighbours in a set of `points` holds, to the byte.
    pub fn bytes(points: usize, k: usize) -> usize {
        BoxTree::bytes(points)
            + Batch::bytes(k + 1)
            + k * (size_of::<Neighbor>() + size_of::<u32>())
    }

    /// A search that holds no set yet, by the best instruction set of the processor.
    pub fn new() -> Self {
        Nearest::with(Simd::best())
    }

    /// The same by the given one; all give the same answers.
    pub fn with(simd: Simd) -> Self {
        Nearest {
            simd,
            tree: BoxTree::default(),
            points: 0,
            batch: Batch::new(),
            found: Vec::new(),
            neighbors: Vec::new(),
            work: Work::default(),
        }
    }

    /// What it searches by.
    pub fn simd(&self) -> Simd {
        self.simd
    }

    /// Allocates for sets of up to `points`, so that building them allocates nothing more.
    pub fn reserve(&mut self, points: usize) {
        self.tree.reserve(points);
    }

    /// Takes a set of fewer than 2^32 distinct positions, each coordinate within ±2^62. Any order
    /// gives right answers; Morton order gives them fast.
    pub fn build(&mut self, positions: &[Position]) {
        self.points = positions.len();
        self.tree.build(positions);
    }

    /// For every index `i` with `wanted(i)`, in an order of its own choice, calls
    /// `visit(i, neighbors, distance2)`: the indices of the min(k, n − 1) nearest other positions
    /// in order of (exact squared distance, index), and the exact squared distance of the last in
    /// lattice steps, 0 if there is none.
    ///
    /// # Panics
    ///
    /// If `positions` are not as many as at the last [`build`](Self::build); they must be the same.
    pub fn search(
        &mut self,
        positions: &[Position],
        k: usize,
        mut wanted: impl FnMut(usize) -> bool,
        mut visit: impl FnMut(usize, &[u32], u128),
    ) {
        assert_eq!(positions.len(), self.points, "a search is of the positions it was built of");
        self.work = Work::default();
        let k = k.min(positions.len().saturating_sub(1));
        if k == 0 {
            (0..positions.len()).filter(|&i| wanted(i)).for_each(|i| visit(i, &[], 0));
            return;
        }
        self.batch.fit((k + 1).min(positions.len() - 1));
        self.found.reserve_exact(k.saturating_sub(self.found.len()));
        self.neighbors.reserve_exact(k.saturating_sub(self.neighbors.len()));
        for run in 0..self.tree.runs() {
            for child in 0..self.tree.node(0, run).children as usize {
                self.search_leaf(positions, k, (run, child), &mut wanted, &mut visit);
            }
        }
    }

    /// Searches for the wanted points of leaf `child` of the level-0 node `run`.
    fn search_leaf(
        &mut self,
        positions: &[Position],
        k: usize,
        (run, child): (usize, usize),
        wanted: &mut impl FnMut(usize) -> bool,
        visit: &mut impl FnMut(usize, &[u32], u128),
    ) {
        let node = self.tree.node(0, run);
        let ranks = self.tree.leaves[node.first_child as usize + child].rank;
        let mut active = 0;
        for (lane, &rank) in ranks.iter().enumerate() {
            // Unused lanes have a rank beyond all positions.
            if (rank as usize) < positions.len() && wanted(rank as usize) {
                active |= 1 << lane;
            }
        }
        if active == 0 {
            return;
        }
        let one_more = (k + 1).min(positions.len() - 1);
        let kept = if likely_exact(node, child, k) { k } else { one_more };
        let Nearest { simd, tree, batch, work, .. } = self;
        let error = TreeWalk::new(*simd, tree, batch, work, Visitors::of(tree, run, child))
            .run(run, active, kept);
        for (lane, &rank) in ranks.iter().enumerate().filter(|(lane, _)| active >> lane & 1 == 1) {
            let own = (positions[rank as usize], Some(rank));
            let is_all = k == positions.len() - 1;
            let distance2 = self.settle(positions, (k, is_all), own, lane, error);
            visit(rank as usize, &self.neighbors, distance2);
        }
    }

    /// How many points of the last search floats could not prove.
    pub fn redone(&self) -> u64 {
        self.work.redone
    }

    /// What the last search did.
    pub fn work(&self) -> Work {
        self.work
    }

    /// Proves or redoes what the batch found for the point of `lane`, which is `own`: leaves its
    /// `k` neighbours, all that there are or not, in `neighbors` and returns the last one's squared
    /// distance.
    pub(super) fn settle(
        &mut self,
        positions: &[Position],
        (k, is_all): (usize, bool),
        own: (Position, Option<u32>),
        lane: usize,
        error: f64,
    ) -> u128 {
        self.work.queries += 1;
        let bound = self.batch.bound[lane];
        let one_more = self.batch.kept > k;
        let last = if one_more { distance_of(self.batch.key(lane, k - 1)) } else { bound };
        self.neighbors.resize(k, 0);
        self.batch.ranks(lane, &mut self.neighbors);
        if error == 0.0 && last < EXACT as f32 {
            return last as u128;
        }
        let proven = is_all || one_more && gap(last, bound, error);
        let at = own.0;
        self.found.clear();
        self.found.extend(
            self.neighbors.iter().map(|&rank| (distance2(at, positions[rank as usize]), rank)),
        );
        self.found.sort_unstable();
        if !proven {
            self.work.redone += 1;
            ExactWalk::new(self.simd, &self.tree, positions, &mut self.work, own, &mut self.found)
                .run();
        }
        self.neighbors.clear();
        self.neighbors.extend(self.found.iter().map(|&(_, rank)| rank));
        self.found[k - 1].0
    }
}

/// True if the k nearest of a leaf's points will likely be exact in floats, so that none more is
/// needed to prove them. A wrong guess costs a redo.
fn likely_exact(node: &BoxNode, child: usize, k: usize) -> bool {
    let diagonal2 = (0..3).fold(0.0, |sum, axis| {
        let side = node.hi[axis][child] - node.lo[axis][child];
        sum + side * side
    });
    node.error == 0 && diagonal2 * (1 + k / LANES) as f32 <= (EXACT / 4) as f32
}

/// True if a float distance `last` is a smaller distance than `next`, whatever rounding did.
fn gap(last: f32, next: f32, error: f64) -> bool {
    let (last, next) = (f64::from(last).sqrt(), f64::from(next).sqrt());
    // √3, rounded up: the error of three coordinates together.
    let error = error * 1.7321;
    last * (1.0 + ROUNDING) + error < next * (1.0 - ROUNDING) - error
}
