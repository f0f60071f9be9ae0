//! Sixteen floats side by side: the few operations that kernels need and compilers do not reliably
//! find in loops.

use super::real::{EIGHT, Eight, Real};
use crate::geom::rows;

/// Numbers side by side.
pub const LANES: usize = 16;
/// Columns of a list that [`Lanes::insert`] inserts into.
pub const COLUMNS: usize = 4;
/// One number of each of 16 lists.
pub type Row = [f64; LANES];

/// Operations on 16 f32 at once, a value of an implementing type being the witness that the
/// processor has them. Every implementation gives the bits of [`Portable`].
pub trait Lanes: Copy {
    /// Sixteen f32.
    type F32: Copy;
    /// Eight f64.
    type F64: Real;

    /// The numbers of an array.
    fn load(self, from: &[f32; LANES]) -> Self::F32;
    /// The numbers as an array.
    fn store(self, v: Self::F32) -> [f32; LANES];
    /// One number in all lanes.
    fn splat(self, v: f32) -> Self::F32;
    /// a + b.
    fn add(self, a: Self::F32, b: Self::F32) -> Self::F32;
    /// a − b.
    fn sub(self, a: Self::F32, b: Self::F32) -> Self::F32;
    /// a · b.
    fn mul(self, a: Self::F32, b: Self::F32) -> Self::F32;
    /// a where a > b, else b.
    fn larger(self, a: Self::F32, b: Self::F32) -> Self::F32;
    /// The lanes where a ≤ b, a bit each.
    fn at_most(self, a: Self::F32, b: Self::F32) -> u32;
    /// The lanes where a < b, or a = b and `rank` < `ranks`.
    fn before(self, a: Self::F32, b: Self::F32, rank: u32, ranks: &[u32; LANES]) -> u32;
    /// The largest of numbers none of which is NaN.
    fn largest(self, v: Self::F32) -> f32;
    /// Of the lanes in `mask`, which is not 0, that of the smallest key. All keys differ in their
    /// last 4 bits, which are the number of their lane.
    fn first(self, keys: &[u32; LANES], mask: u32) -> usize;
    /// Eight numbers of an array.
    fn load_eight(self, from: &[f64; EIGHT]) -> Self::F64;
    /// Eight numbers as an array.
    fn store_eight(self, v: Self::F64) -> [f64; EIGHT];
    /// Sorts lists side by side, row i being the i-th numbers of all: smallest first, none NaN.
    fn sort(self, rows: &mut [Row; LANES]);
    /// Sorts lists side by side, as [`sort`](Lanes::sort) does, and puts the smallest of them and
    /// of the sorted lists in `best` there, sorted.
    fn merge(self, best: &mut [Row; LANES], rows: &mut [Row; LANES]);
    /// Merges numbers into an ascending list, of which the smallest stay: for each lane in `hits`
    /// the one with the bits of `high` above those of `low`. All are positive and finite. The list
    /// goes down the first column, then the second, and so on: the number before each is in the row
    /// above, but for the first row.
    fn insert<const ROWS: usize>(
        self,
        list: &mut [[f64; COLUMNS]; ROWS],
        high: &[f32; LANES],
        low: &[u32; LANES],
        hits: u32,
    );
}

/// Code that is worth compiling for wider vectors.
pub trait Kernel {
    /// What it computes.
    type Output;

    /// Computes it. Implementations, and what they call in their inner loops, are `inline(always)`:
    /// only what is inlined is compiled for the instruction set chosen, and closures around `lanes`
    /// are not. Loops over arrays of numbers become vector instructions by themselves; `lanes` is
    /// for what they do not.
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}

/// What every processor can do.
#[derive(Debug, Clone, Copy)]
pub struct Portable;

impl Lanes for Portable {
    type F32 = [f32; LANES];
    type F64 = Eight;

    #[inline(always)]
    fn load(self, from: &[f32; LANES]) -> Self::F32 {
        *from
    }

    #[inline(always)]
    fn store(self, v: Self::F32) -> [f32; LANES] {
        v
    }

    #[inline(always)]
    fn splat(self, v: f32) -> Self::F32 {
        [v; LANES]
    }

    #[inline(always)]
    fn add(self, a: Self::F32, b: Self::F32) -> Self::F32 {
        std::array::from_fn(|i| a[i] + b[i])
    }

    #[inline(always)]
    fn sub(self, a: Self::F32, b: Self::F32) -> Self::F32 {
        std::array::from_fn(|i| a[i] - b[i])
    }

    #[inline(always)]
    fn mul(self, a: Self::F32, b: Self::F32) -> Self::F32 {
        std::array::from_fn(|i| a[i] * b[i])
    }

    #[inline(always)]
    fn larger(self, a: Self::F32, b: Self::F32) -> Self::F32 {
        std::array::from_fn(|i| if a[i] > b[i] { a[i] } else { b[i] })
    }

    #[inline(always)]
    fn at_most(self, a: Self::F32, b: Self::F32) -> u32 {
        (0..LANES).fold(0, |mask, i| mask | u32::from(a[i] <= b[i]) << i)
    }

    #[inline(always)]
    fn before(self, a: Self::F32, b: Self::F32, rank: u32, ranks: &[u32; LANES]) -> u32 {
        (0..LANES).fold(0, |mask, i| {
            let before = (a[i] < b[i]) | ((a[i] == b[i]) & (rank < ranks[i]));
            mask | u32::from(before) << i
        })
    }

    #[inline(always)]
    fn largest(self, v: Self::F32) -> f32 {
        // Halves against halves: a plain fold would wait for every comparison.
        let mut all = v;
        for half in [8, 4, 2, 1] {
            for i in 0..half {
                all[i] = if all[i] > all[i + half] { all[i] } else { all[i + half] };
            }
        }
        all[0]
    }

    #[inline(always)]
    fn first(self, keys: &[u32; LANES], mut mask: u32) -> usize {
        let mut least = u32::MAX;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize & (LANES - 1);
            mask &= mask - 1;
            least = least.min(keys[lane]);
        }
        least as usize & (LANES - 1)
    }

    #[inline(always)]
    fn load_eight(self, from: &[f64; EIGHT]) -> Eight {
        Eight(*from)
    }

    #[inline(always)]
    fn store_eight(self, v: Eight) -> [f64; EIGHT] {
        v.0
    }

    #[inline(always)]
    fn sort(self, rows: &mut [Row; LANES]) {
        for first in (0..LANES).step_by(2) {
            let mut lists = rows.map(|row| [row[first], row[first + 1]]);
            rows::sort(&mut lists);
            for (row, list) in rows.iter_mut().zip(lists) {
                [row[first], row[first + 1]] = list;
            }
        }
    }

    #[inline(always)]
    fn merge(self, best: &mut [Row; LANES], rows: &mut [Row; LANES]) {
        for first in (0..LANES).step_by(2) {
            let mut lists = rows.map(|row| [row[first], row[first + 1]]);
            rows::sort(&mut lists);
            let mut kept = best.map(|row| [row[first], row[first + 1]]);
            rows::merge(&mut kept, &lists);
            for (row, list) in best.iter_mut().zip(kept) {
                [row[first], row[first + 1]] = list;
            }
        }
    }

    #[inline(always)]
    fn insert<const ROWS: usize>(
        self,
        list: &mut [[f64; COLUMNS]; ROWS],
        high: &[f32; LANES],
        low: &[u32; LANES],
        mut hits: u32,
    ) {
        while hits != 0 {
            let lane = hits.trailing_zeros() as usize & (LANES - 1);
            hits &= hits - 1;
            let new = joined(high[lane], low[lane]);
            let last = list[ROWS - 1];
            let mut before = [0.0, last[0], last[1], last[2]];
            for row in list.iter_mut() {
                let old = *row;
                for i in 0..COLUMNS {
                    row[i] = smaller(old[i], larger(before[i], new));
                }
                before = old;
            }
        }
    }
}

/// The number with the bits of `high` above those of `low`. Positive floats sort like their bits,
/// so that 64 bits can be compared as an f64, for which vector minimum and maximum exist
/// everywhere.
#[inline(always)]
pub fn joined(high: f32, low: u32) -> f64 {
    f64::from_bits(u64::from(high.to_bits()) << 32 | u64::from(low))
}

#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// a where a < b, else b.
#[inline(always)]
pub fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}
