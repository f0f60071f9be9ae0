//! A run of 256 points in Morton order, cut into leaves of 16 by median splits of the longest side:
//! tighter boxes than Morton order alone gives. The cuts decide speed, never an answer.

use crate::geom::simd::LANES;
use crate::point::Position;

/// Points cut into leaves together: the children of one node.
pub(super) const RUN: usize = LANES * LANES;

/// Up to 16 points in the frame of their node; unused lanes are infinitely far.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(super) struct Leaf {
    /// x, y and z.
    pub at: [[f32; LANES]; 3],
    /// Index of each point in the positions.
    pub rank: [u32; LANES],
}

impl Leaf {
    /// One of the points.
    #[inline(always)]
    pub fn point(&self, lane: usize) -> [f32; 3] {
        [self.at[0][lane], self.at[1][lane], self.at[2][lane]]
    }
}

/// The points of a run side by side, and room to part them.
pub(super) struct LeafRun {
    at: [[f32; RUN]; 3],
    rank: [u32; RUN],
    keys: [i32; RUN],
    parted: [[f32; RUN]; 3],
    parted_rank: [u32; RUN],
}

impl LeafRun {
    pub fn new() -> Box<LeafRun> {
        Box::new(LeafRun {
            at: [[0.0; RUN]; 3],
            rank: [0; RUN],
            keys: [0; RUN],
            parted: [[0.0; RUN]; 3],
            parted_rank: [0; RUN],
        })
    }

    /// Takes up to 256 positions, the first of rank `start`, relative to `origin`.
    pub fn fill(&mut self, start: u32, positions: &[Position], origin: Position) {
        for (i, p) in positions.iter().take(RUN).enumerate() {
            for axis in 0..3 {
                self.at[axis][i] = p[axis].wrapping_sub(origin[axis]) as f32;
            }
            self.rank[i] = start + i as u32;
        }
    }

    /// Orders the first `len` points so that every 16 of them make a compact leaf.
    pub fn refine(&mut self, len: usize) {
        self.split(0, len.min(RUN));
    }

    /// The leaf of the points from `first` on, of `len` in all.
    pub fn leaf(&self, first: usize, len: usize) -> Leaf {
        let mut leaf = Leaf { at: [[f32::INFINITY; LANES]; 3], rank: [u32::MAX; LANES] };
        let used = LANES.min(len - first);
        for axis in 0..3 {
            leaf.at[axis][..used].copy_from_slice(&self.at[axis][first..first + used]);
        }
        leaf.rank[..used].copy_from_slice(&self.rank[first..first + used]);
        leaf
    }

    /// Halves `start..end` along its longest side until 16 points are left.
    fn split(&mut self, start: usize, end: usize) {
        let leaves = (end - start).div_ceil(LANES);
        if leaves <= 1 {
            return;
        }
        // Whole leaves go left, so that only the last leaf of a run can be short.
        let left = leaves.div_ceil(2) * LANES;
        let (axis, lo, side) = self.longest(start, end);
        if side > 0.0 {
            self.part(start, end, left, axis, lo, side);
        }
        self.split(start, start + left);
        self.split(start + left, end);
    }

    /// The longest axis, its smallest coordinate and its length.
    fn longest(&self, start: usize, end: usize) -> (usize, f32, f32) {
        let mut longest = (0, 0.0, -1.0);
        for axis in 0..3 {
            let (lo, hi) = extremes(&self.at[axis][start..end]);
            if hi - lo > longest.2 {
                longest = (axis, lo, hi - lo);
            }
        }
        longest
    }

    /// Moves the `left` smallest along `axis` to the front.
    fn part(&mut self, start: usize, end: usize, left: usize, axis: usize, lo: f32, side: f32) {
        // Keys of 16 bits of the coordinate, then 8 bits of the lane: distinct, so a pivot with
        // exactly `left` keys below exists.
        let scale = 0.999_99 / side;
        let keys = &mut self.keys[start..end];
        for (i, (key, v)) in keys.iter_mut().zip(&self.at[axis][start..end]).enumerate() {
            let fraction = (1.0 + (v - lo) * scale).to_bits();
            *key = ((fraction >> 7 & 0xffff) << 8 | i as u32) as i32;
        }
        let pivot = pivot(keys, left);
        let (mut low, mut high) = (start, start + left);
        for i in start..end {
            let is_low = self.keys[i] < pivot;
            // The mask keeps the index in range without a check: both halves fit in a run.
            let to = (if is_low { low } else { high }) & (RUN - 1);
            low += usize::from(is_low);
            high += usize::from(!is_low);
            for axis in 0..3 {
                self.parted[axis][to] = self.at[axis][i];
            }
            self.parted_rank[to] = self.rank[i];
        }
        for axis in 0..3 {
            self.at[axis][start..end].copy_from_slice(&self.parted[axis][start..end]);
        }
        self.rank[start..end].copy_from_slice(&self.parted_rank[start..end]);
    }
}

/// The number with exactly `left` of the distinct 24-bit `keys` below it, bit by bit.
fn pivot(keys: &[i32], left: usize) -> i32 {
    let mut pivot = 0;
    for bit in (0..24).rev() {
        let trial = pivot | 1 << bit;
        let below: i32 = keys.iter().map(|&key| i32::from(key < trial)).sum();
        if below as usize <= left {
            pivot = trial;
        }
    }
    pivot
}

/// Smallest and largest; four at a time, as a plain fold would wait for every comparison.
fn extremes(values: &[f32]) -> (f32, f32) {
    const WIDE: usize = 16;
    let (mut lo, mut hi) = ([f32::INFINITY; WIDE], [f32::NEG_INFINITY; WIDE]);
    let mut chunks = values.chunks_exact(WIDE);
    for chunk in &mut chunks {
        for i in 0..WIDE {
            lo[i] = if chunk[i] < lo[i] { chunk[i] } else { lo[i] };
            hi[i] = if chunk[i] > hi[i] { chunk[i] } else { hi[i] };
        }
    }
    for (i, &v) in chunks.remainder().iter().enumerate() {
        lo[i] = if v < lo[i] { v } else { lo[i] };
        hi[i] = if v > hi[i] { v } else { hi[i] };
    }
    (
        lo.iter().fold(f32::INFINITY, |a, &b| a.min(b)),
        hi.iter().fold(f32::NEG_INFINITY, |a, &b| a.max(b)),
    )
}
