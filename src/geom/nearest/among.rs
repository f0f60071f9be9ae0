//! The k nearest points of one set for every point of another.
//!
//! The points that ask are cut into leaves as those that are asked are, so that 16 of them that are
//! near to each other walk together, by the same kernels and the same proofs. They have no leaf in
//! the other tree to begin at, so they begin where they would stand in its order.

use super::own::Nearest;
use super::tree::{BoxTree, EXACT};
use super::walk::{TreeWalk, Visitors, Work};
use crate::geom::morton::morton_cmp;
use crate::geom::simd::Simd;
use crate::point::Position;

/// The search of the k nearest points of a set for points of another; its memory stays from set to
/// set.
///
/// ```
/// use pointmill::internals::NearestAmong;
///
/// let (kept, queries) = ([[0, 0, 0], [5, 0, 0], [7, 0, 0]], [[1, 0, 0], [6, 0, 0]]);
/// let mut nearest = NearestAmong::default();
/// let mut found = Vec::new();
/// nearest.search(&kept, &queries, 2, |i, neighbors| found.push((i, neighbors.to_vec())));
/// assert_eq!(found, [(0, vec![0, 1]), (1, vec![1, 2])]);
/// ```
#[derive(Debug, Default)]
pub struct NearestAmong {
    /// The set that is asked.
    nearest: Nearest,
    queries: BoxTree,
}

impl NearestAmong {
    /// A search by the given instruction set; all give the same answers.
    pub fn with(simd: Simd) -> Self {
        NearestAmong { nearest: Nearest::with(simd), queries: BoxTree::default() }
    }

    /// Bytes that a search among `points` for `queries` holds at most, and 1 KiB and up to 256 for
    /// each neighbour.
    pub fn bytes(points: usize, queries: usize, k: usize) -> usize {
        Nearest::bytes(points, k) + BoxTree::bytes(queries)
    }

    /// For every index `i` of `queries`, in an order of its own choice, calls
    /// `visit(i, neighbors)`: the indices of the min(k, n) nearest of the n `positions` in order of
    /// (exact squared distance, index).
    ///
    /// Both sets have fewer than 2^32 positions, each coordinate within ±2^62; those of `positions`
    /// are distinct. Any order gives right answers; Morton order gives them fast.
    pub fn search(
        &mut self,
        positions: &[Position],
        queries: &[Position],
        k: usize,
        mut visit: impl FnMut(usize, &[u32]),
    ) {
        let NearestAmong { nearest, queries: asking } = self;
        nearest.build(positions);
        asking.build(queries);
        let k = k.min(positions.len());
        if k == 0 {
            (0..queries.len()).for_each(|i| visit(i, &[]));
            return;
        }
        let is_all = k == positions.len();
        nearest.batch.fit_together((k + 1).min(positions.len()));
        let mut farthest = f32::MAX;
        for run in 0..asking.runs() {
            for child in 0..asking.node(0, run).children as usize {
                let visitors = Visitors::of(asking, run, child);
                let ranks = &visitors.leaf.rank;
                let is_used = |rank: &u32| (*rank as usize) < queries.len();
                let active = (0..ranks.len()).filter(|lane| is_used(&ranks[*lane]));
                let active = active.fold(0, |active, lane| active | 1 << lane);
                // As far as what was found before, exact floats need no further one to be proven. A
                // wrong guess costs a redo.
                let exact = visitors.node.error == 0 && farthest < (EXACT / 4) as f32;
                let kept = if exact { k } else { (k + 1).min(positions.len()) };
                let Nearest { simd, tree, batch, work, .. } = &mut *nearest;
                let walk = TreeWalk::new(*simd, tree, batch, work, visitors);
                // Who is near in Morton order is mostly near.
                let at = &queries[ranks[0] as usize];
                let near = positions.partition_point(|p| morton_cmp(p, at).is_lt());
                let error = walk.run_as_guests(tree.run_with(near as u32), active, kept);
                farthest = batch.farthest;
                for (lane, &rank) in ranks.iter().enumerate().filter(|(_, rank)| is_used(rank)) {
                    let at = queries[rank as usize];
                    nearest.settle(positions, (k, is_all), (at, None), lane, error);
                    visit(rank as usize, &nearest.neighbors);
                }
            }
        }
    }

    /// What the last search did.
    pub fn work(&self) -> Work {
        self.nearest.work()
    }

    /// How many points of the last search floats could not prove.
    pub fn redone(&self) -> u64 {
        self.nearest.redone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::hash::of_position;
    use crate::point::distance2;

    /// Compares a search on every instruction set with one by all distances.
    fn compare(positions: &[Position], queries: &[Position], k: usize) {
        for simd in Simd::all() {
            let mut visited = vec![0; queries.len()];
            NearestAmong::with(simd).search(positions, queries, k, |i, found| {
                visited[i] += 1;
                let far = |j: u32| (distance2(queries[i], positions[j as usize]), j);
                let mut all: Vec<u32> = (0..positions.len() as u32).collect();
                all.sort_unstable_by_key(|j| far(*j));
                all.truncate(k);
                assert_eq!(found, all, "{:?} of {simd:?}", queries[i]);
            });
            assert!(visited.iter().all(|n| *n == 1), "{visited:?}");
        }
    }

    /// Distinct positions, some far more than a coordinate apart, and many at equal distances.
    fn some(seed: u64, count: usize, wide: u64) -> Vec<Position> {
        let number = |i: usize, axis: i64| {
            let hash = of_position(seed, [i as i64, axis, 0]);
            (hash % wide) as i64 - (wide / 2) as i64
        };
        let mut all: Vec<Position> =
            (0..count).map(|i| std::array::from_fn(|axis| number(i, axis as i64))).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    #[test]
    fn they_are_the_nearest_of_all() {
        for (n, wide) in [7, 40, 1 << 13, 1 << 26, 1 << 40, 1 << 62].into_iter().enumerate() {
            for (points, queries) in [(0, 5), (1, 30), (3, 40), (20, 300), (700, 400), (60, 0)] {
                let positions = some(n as u64, points, wide);
                let queries = some(100 + n as u64, queries, wide);
                for k in [1, 5, 12, 13] {
                    compare(&positions, &queries, k);
                }
            }
        }
    }

    #[test]
    fn points_of_both_sets_are_their_own_nearest_and_ties_go_by_index() {
        let grid: Vec<Position> = (0..400).map(|i| [i % 20 * 3, i / 20 * 3, 0]).collect();
        compare(&grid, &grid, 12);
        let between: Vec<Position> = grid.iter().map(|p| [p[0] + 1, p[1] - 2, 5]).collect();
        compare(&grid, &between, 12);
        compare(&grid, &[[0, 0, 1 << 61], [-(1 << 61), 1 << 60, 4]], 12);
    }
}
