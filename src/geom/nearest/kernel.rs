//! The arithmetic of the search, 16 lanes at a time, in plain loops that compilers turn into vector
//! instructions. A kernel for another instruction set replaces [`box_distances`], [`meet`] and the
//! inserts over the same layout; with the same operations in the same order (no fused multiply-add)
//! it finds the same keys.
//!
//! Squared distances are ((dx·dx) + dy·dy) + dz·dz everywhere, boxes included: rounding is
//! monotonic, so no point of a box gets a smaller float than its box does.

#![allow(clippy::needless_range_loop, reason = "one index walks several arrays of lanes")]

use super::tree::{LANES, Leaf};

/// What is farther than any point: no candidate yet.
pub(super) const NONE: f64 = f64::from_bits((f32::MAX.to_bits() as u64) << 32 | u32::MAX as u64);

/// 16 points that search together.
#[derive(Debug)]
pub(super) struct Batch {
    /// The points in the frame of the node being visited.
    pub at: [[f32; LANES]; 3],
    /// Squared distance of each point's last kept candidate: what is farther is of no use. −1 in
    /// lanes that do not search.
    pub bound: [f32; LANES],
    /// Rank of that candidate: of what is equally far, only smaller ranks are of use.
    pub bound_rank: [u32; LANES],
    /// The best keys of each point in ascending order, `width` a point.
    pub best: Vec<f64>,
    pub width: usize,
    /// How many candidates are kept, at most `width`.
    pub kept: usize,
    insert: Insert,
}

/// Merges the candidates of the lanes in a mask into an ascending list.
type Insert = fn(best: &mut [f64], distances: &[f32; LANES], ranks: &[u32; LANES], hits: u32);

/// The width of lists of `most` candidates, and how to insert there.
fn shape(most: usize) -> (usize, Insert) {
    match most {
        0..=4 => (4, insert::<4>),
        5..=8 => (8, insert::<8>),
        9..=12 => (12, insert::<12>),
        13..=16 => (16, insert::<16>),
        17..=20 => (20, insert::<20>),
        21..=24 => (24, insert::<24>),
        25..=32 => (32, insert::<32>),
        33..=48 => (48, insert::<48>),
        49..=72 => (72, insert::<72>),
        _ => (most, insert_any),
    }
}

/// A candidate as a number that sorts by distance, then rank: the float's bits above the rank's.
/// Positive floats sort like their bits, so the 64 bits can be compared as an f64, for which vector
/// minimum and maximum exist everywhere.
#[inline(always)]
fn key(distance: f32, rank: u32) -> f64 {
    f64::from_bits(u64::from(distance.to_bits()) << 32 | u64::from(rank))
}

/// Squared distance of a key.
#[inline(always)]
pub(super) fn distance_of(key: f64) -> f32 {
    f32::from_bits((key.to_bits() >> 32) as u32)
}

/// Rank of a key.
#[inline(always)]
pub(super) fn rank_of(key: f64) -> u32 {
    key.to_bits() as u32
}

#[inline(always)]
fn larger<T: PartialOrd>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

#[inline(always)]
fn smaller<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

impl Batch {
    pub fn new() -> Batch {
        Batch {
            at: [[0.0; LANES]; 3],
            bound: [-1.0; LANES],
            bound_rank: [0; LANES],
            best: Vec::new(),
            width: 0,
            kept: 0,
            insert: insert_any,
        }
    }

    /// Makes room for `most` candidates a point.
    pub fn fit(&mut self, most: usize) {
        (self.width, self.insert) = shape(most);
        self.best.clear();
        self.best.reserve_exact(self.width * LANES);
        self.best.resize(self.width * LANES, NONE);
    }

    /// Bytes of the lists for `most` candidates a point.
    pub fn bytes(most: usize) -> usize {
        shape(most).0 * LANES * size_of::<f64>()
    }

    /// Forgets all candidates; the lanes of `wanted` search for `kept`.
    pub fn start(&mut self, wanted: u32, kept: usize) {
        self.best.fill(NONE);
        self.kept = kept;
        for lane in 0..LANES {
            self.bound[lane] = if wanted >> lane & 1 == 1 { f32::MAX } else { -1.0 };
            self.bound_rank[lane] = u32::MAX;
        }
    }

    /// The largest bound of the batch.
    #[inline(always)]
    pub fn farthest(&self) -> f32 {
        // Halves against halves: a plain fold would wait for every comparison.
        let mut all = self.bound;
        for half in [8, 4, 2, 1] {
            for i in 0..half {
                all[i] = larger(all[i], all[i + half]);
            }
        }
        all[0]
    }

    /// The best keys of a lane.
    #[inline(always)]
    pub fn list(&self, lane: usize) -> &[f64] {
        &self.best[lane * self.width..(lane + 1) * self.width]
    }

    #[inline(always)]
    fn offer(&mut self, lane: usize, distances: &[f32; LANES], ranks: &[u32; LANES], hits: u32) {
        let list = &mut self.best[lane * self.width..(lane + 1) * self.width];
        (self.insert)(list, distances, ranks, hits);
        let last = list[self.kept - 1];
        self.bound[lane] = distance_of(last);
        self.bound_rank[lane] = rank_of(last);
    }

    /// The points' own leaf: everyone but oneself is a candidate.
    pub fn meet_home(&mut self, leaf: &Leaf) {
        for lane in 0..LANES {
            if self.bound[lane] < 0.0 {
                continue;
            }
            let distances = distances(leaf, self.point(lane));
            let hits = at_most(&distances, f32::MAX) & !(1 << lane);
            self.offer(lane, &distances, &leaf.rank, hits);
        }
    }

    /// Another leaf in the same frame, its box and its smallest rank. True if a bound has sunk.
    pub fn meet(&mut self, leaf: &Leaf, lo: [f32; 3], hi: [f32; 3], first: u32) -> bool {
        let mut near = self.lanes_near(lo, hi, first);
        let mut found = false;
        while near != 0 {
            let lane = near.trailing_zeros() as usize & (LANES - 1);
            near &= near - 1;
            let distances = distances(leaf, self.point(lane));
            let hits = at_most(&distances, self.bound[lane]);
            if hits != 0 {
                self.offer(lane, &distances, &leaf.rank, hits);
                found = true;
            }
        }
        found
    }

    #[inline(always)]
    fn point(&self, lane: usize) -> [f32; 3] {
        [self.at[0][lane], self.at[1][lane], self.at[2][lane]]
    }

    /// The lanes for which a box can hold a better candidate.
    #[inline(always)]
    fn lanes_near(&self, lo: [f32; 3], hi: [f32; 3], first: u32) -> u32 {
        let mut sum = [0.0; LANES];
        for axis in 0..3 {
            for i in 0..LANES {
                let q = self.at[axis][i];
                let gap = larger(larger(lo[axis] - q, q - hi[axis]), 0.0);
                sum[i] += gap * gap;
            }
        }
        let mut mask = 0;
        for i in 0..LANES {
            let nearer = sum[i] < self.bound[i];
            let tied = sum[i] == self.bound[i] && first < self.bound_rank[i];
            mask |= u32::from(nearer | tied) << i;
        }
        mask
    }
}

/// Squared distances of the points of a leaf to `q`.
#[inline(always)]
fn distances(leaf: &Leaf, q: [f32; 3]) -> [f32; LANES] {
    let mut sum = [0.0; LANES];
    for axis in 0..3 {
        for i in 0..LANES {
            let d = leaf.at[axis][i] - q[axis];
            sum[i] += d * d;
        }
    }
    sum
}

/// The lanes not above `bound`.
#[inline(always)]
pub(super) fn at_most(distances: &[f32; LANES], bound: f32) -> u32 {
    let mut mask = 0;
    for i in 0..LANES {
        mask |= u32::from(distances[i] <= bound) << i;
    }
    mask
}

/// Squared distances between 16 boxes and the box `lo..hi`.
#[inline(always)]
pub(super) fn box_distances(
    boxes_lo: &[[f32; LANES]; 3],
    boxes_hi: &[[f32; LANES]; 3],
    lo: [f32; 3],
    hi: [f32; 3],
) -> [f32; LANES] {
    let mut sum = [0.0; LANES];
    for axis in 0..3 {
        for i in 0..LANES {
            let gap = larger(boxes_lo[axis][i] - hi[axis], lo[axis] - boxes_hi[axis][i]);
            let gap = larger(gap, 0.0);
            sum[i] += gap * gap;
        }
    }
    sum
}

/// [`Insert`] for lists of `WIDTH`: the list stays in registers, and no branch depends on where a
/// candidate belongs.
fn insert<const WIDTH: usize>(
    best: &mut [f64],
    distances: &[f32; LANES],
    ranks: &[u32; LANES],
    mut hits: u32,
) {
    let Some(list) = best.first_chunk_mut::<WIDTH>() else {
        return insert_any(best, distances, ranks, hits);
    };
    let mut sorted = *list;
    while hits != 0 {
        let lane = hits.trailing_zeros() as usize & (LANES - 1);
        hits &= hits - 1;
        let candidate = key(distances[lane], ranks[lane]);
        let before = sorted;
        sorted[0] = smaller(before[0], candidate);
        for i in 1..WIDTH {
            sorted[i] = smaller(before[i], larger(before[i - 1], candidate));
        }
    }
    *list = sorted;
}

/// [`Insert`] for lists of any length.
fn insert_any(best: &mut [f64], distances: &[f32; LANES], ranks: &[u32; LANES], mut hits: u32) {
    while hits != 0 {
        let lane = hits.trailing_zeros() as usize & (LANES - 1);
        hits &= hits - 1;
        let candidate = key(distances[lane], ranks[lane]);
        let place = best.partition_point(|&kept| kept < candidate);
        if place < best.len() {
            best.copy_within(place..best.len() - 1, place + 1);
            best[place] = candidate;
        }
    }
}
