//! One source compiled for several instruction sets, of which the fastest that the processor has
//! runs. Knows nothing of what is computed.
//!
//! A kernel is plain code over lanes: without fused multiply-adds and without reordering of sums it
//! gives the same bits whatever it is compiled for, so no result depends on the choice.

mod lanes;
mod real;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use lanes::{COLUMNS, Kernel, LANES, Lanes, Portable, Row, joined, smaller};
pub use real::{EIGHT, Mask, Real};
#[cfg(target_arch = "x86_64")]
use x86::{has_avx2, has_avx512};

/// An instruction set that kernels are compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// What every processor of the architecture has.
    Portable,
    /// 256-bit vectors of x86-64 (AVX2, BMI).
    Avx2,
    /// 512-bit vectors of x86-64 (AVX-512 F, BW, CD, DQ and VL).
    Avx512,
}

impl Level {
    /// As in `run.simd`.
    pub fn name(self) -> &'static str {
        match self {
            Level::Portable => "portable",
            Level::Avx2 => "avx2",
            Level::Avx512 => "avx512",
        }
    }
}

/// An instruction set that this processor has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Simd(Level);

impl Default for Simd {
    fn default() -> Self {
        Simd::best()
    }
}

impl Simd {
    /// The one that every processor has.
    pub const PORTABLE: Simd = Simd(Level::Portable);

    /// The widest that this processor has.
    pub fn best() -> Simd {
        let levels = [Level::Avx512, Level::Avx2];
        levels.into_iter().find_map(Simd::of).unwrap_or(Simd::PORTABLE)
    }

    /// The one asked for, if this processor has it.
    pub fn of(level: Level) -> Option<Simd> {
        let there = match level {
            Level::Portable => true,
            Level::Avx2 => has_avx2(),
            Level::Avx512 => has_avx512(),
        };
        there.then_some(Simd(level))
    }

    /// All that this processor has, the narrowest first.
    pub fn all() -> impl Iterator<Item = Simd> {
        [Level::Portable, Level::Avx2, Level::Avx512].into_iter().filter_map(Simd::of)
    }

    /// Which one it is.
    pub fn level(self) -> Level {
        self.0
    }

    /// Runs a kernel as compiled for this instruction set.
    #[inline(always)]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            Level::Portable => kernel.run(Portable),
            // SAFETY: `of` is the only way to a value of these levels, and gives one only where the
            // processor has what the functions are compiled for.
            #[cfg(target_arch = "x86_64")]
            Level::Avx2 => unsafe { x86::avx2(kernel) },
            #[cfg(target_arch = "x86_64")]
            Level::Avx512 => unsafe { x86::avx512(kernel) },
            #[cfg(not(target_arch = "x86_64"))]
            Level::Avx2 | Level::Avx512 => kernel.run(Portable),
        }
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn has_avx2() -> bool {
    false
}

#[cfg(not(target_arch = "x86_64"))]
fn has_avx512() -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Halves<'a>(&'a [f32]);

    impl Kernel for Halves<'_> {
        type Output = f32;

        #[inline(always)]
        fn run<L: Lanes>(self, _: L) -> f32 {
            self.0.iter().map(|v| v * 0.5).sum()
        }
    }

    #[test]
    fn every_instruction_set_runs_the_same_kernel() {
        let values: Vec<f32> = (0..1000).map(|i| i as f32 / 7.0).collect();
        let portable = Simd::PORTABLE.run(Halves(&values));
        assert!(portable > 0.0);
        for simd in Simd::all() {
            assert_eq!(simd.run(Halves(&values)).to_bits(), portable.to_bits(), "{simd:?}");
        }
    }

    /// Every test that compares instruction sets compares those that the processor has; this one
    /// says that there was something to compare.
    #[test]
    #[ignore = "needs a processor with AVX2"]
    fn tests_compare_more_than_the_portable_kernels() {
        assert!(Simd::all().any(|simd| simd.level() == Level::Avx2), "{:?}", Simd::best());
    }

    #[test]
    fn the_best_is_the_last_of_all() {
        assert_eq!(Simd::all().last(), Some(Simd::best()));
        assert_eq!(Simd::all().next(), Some(Simd::PORTABLE));
    }
}
