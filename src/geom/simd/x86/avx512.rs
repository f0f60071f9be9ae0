//! Vectors of 512 bits.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use super::avx2::insert;
use crate::geom::rows::{self, Ordered};
use crate::geom::simd::lanes::{COLUMNS, LANES, Lanes, Row};
use crate::geom::simd::real::{EIGHT, EXPONENT, Mask, Real};

// SAFETY, of every block here: a value of a type of this module comes from `witness` alone, which
// is called only in code that is compiled for the instructions and run where the processor has
// them; and arrays that are read or written have the numbers that the instruction touches.

/// One vector of 512 bits.
#[derive(Clone, Copy)]
pub struct Avx512(());

impl Avx512 {
    /// For code that is compiled for these instructions.
    pub(super) fn witness() -> Avx512 {
        Avx512(())
    }
}

impl Lanes for Avx512 {
    type F32 = __m512;
    type F64 = EightAvx512;

    #[inline(always)]
    fn load(self, from: &[f32; LANES]) -> Self::F32 {
        unsafe { _mm512_loadu_ps(from.as_ptr()) }
    }

    #[inline(always)]
    fn store(self, v: Self::F32) -> [f32; LANES] {
        let mut to = [0.0; LANES];
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), v) };
        to
    }

    #[inline(always)]
    fn splat(self, v: f32) -> Self::F32 {
        unsafe { _mm512_set1_ps(v) }
    }

    #[inline(always)]
    fn add(self, a: Self::F32, b: Self::F32) -> Self::F32 {
        unsafe { _mm512_add_ps(a, b) }
    }

    #[inline(always)]
    fn sub(self, a: Self::F32, b: Self::F32) -> Self::F32 {
        unsafe { _mm512_sub_ps(a, b) }
    }

    #[inline(always)]
    fn mul(self, a: Self::F32, b: Self::F32) -> Self::F32 {
        unsafe { _mm512_mul_ps(a, b) }
    }

    #[inline(always)]
    fn larger(self, a: Self::F32, b: Self::F32) -> Self::F32 {
        unsafe { _mm512_max_ps(a, b) }
    }

    #[inline(always)]
    fn at_most(self, a: Self::F32, b: Self::F32) -> u32 {
        unsafe { u32::from(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b)) }
    }

    #[inline(always)]
    fn before(self, a: Self::F32, b: Self::F32, rank: u32, ranks: &[u32; LANES]) -> u32 {
        unsafe {
            let less = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b);
            let equal = _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(a, b);
            let ranks = _mm512_loadu_si512(ranks.as_ptr().cast());
            let ahead = _mm512_cmplt_epu32_mask(_mm512_set1_epi32(rank as i32), ranks);
            u32::from(less | (equal & ahead))
        }
    }

    #[inline(always)]
    fn largest(self, v: Self::F32) -> f32 {
        unsafe { _mm512_reduce_max_ps(v) }
    }

    #[inline(always)]
    fn first(self, keys: &[u32; LANES], mask: u32) -> usize {
        unsafe {
            let keys = _mm512_loadu_si512(keys.as_ptr().cast());
            let rest = _mm512_set1_epi32(-1);
            let least = _mm512_mask_mov_epi32(rest, mask as u16, keys);
            _mm512_reduce_min_epu32(least) as usize & (LANES - 1)
        }
    }

    #[inline(always)]
    fn load_eight(self, from: &[f64; EIGHT]) -> EightAvx512 {
        unsafe { EightAvx512(_mm512_loadu_pd(from.as_ptr())) }
    }

    #[inline(always)]
    fn store_eight(self, v: EightAvx512) -> [f64; EIGHT] {
        let mut to = [0.0; EIGHT];
        unsafe { _mm512_storeu_pd(to.as_mut_ptr(), v.0) };
        to
    }

    #[inline(always)]
    fn sort(self, rows: &mut [Row; LANES]) {
        for first in (0..LANES).step_by(8) {
            let mut lists = [EightAvx512(unsafe { _mm512_setzero_pd() }); LANES];
            for i in 0..LANES {
                lists[i] = EightAvx512(unsafe { _mm512_loadu_pd(rows[i].as_ptr().add(first)) });
            }
            rows::sort(&mut lists);
            for i in 0..LANES {
                unsafe { _mm512_storeu_pd(rows[i].as_mut_ptr().add(first), lists[i].0) };
            }
        }
    }

    #[inline(always)]
    fn merge(self, best: &mut [Row; LANES], rows: &mut [Row; LANES]) {
        for first in (0..LANES).step_by(8) {
            let mut lists = [EightAvx512(unsafe { _mm512_setzero_pd() }); LANES];
            let mut kept = lists;
            for i in 0..LANES {
                lists[i] = EightAvx512(unsafe { _mm512_loadu_pd(rows[i].as_ptr().add(first)) });
            }
            rows::sort(&mut lists);
            for i in 0..LANES {
                kept[i] = EightAvx512(unsafe { _mm512_loadu_pd(best[i].as_ptr().add(first)) });
            }
            rows::merge(&mut kept, &lists);
            for i in 0..LANES {
                unsafe { _mm512_storeu_pd(best[i].as_mut_ptr().add(first), kept[i].0) };
            }
        }
    }

    #[inline(always)]
    fn insert<const ROWS: usize>(
        self,
        list: &mut [[f64; COLUMNS]; ROWS],
        high: &[f32; LANES],
        low: &[u32; LANES],
        hits: u32,
    ) {
        unsafe { insert(list, high, low, hits) }
    }
}

/// Eight f64.
#[derive(Clone, Copy)]
pub struct EightAvx512(__m512d);

impl Ordered for EightAvx512 {
    #[inline(always)]
    fn ordered(self, other: EightAvx512) -> (EightAvx512, EightAvx512) {
        let (a, b) = (self.0, other.0);
        unsafe { (EightAvx512(_mm512_min_pd(a, b)), EightAvx512(_mm512_max_pd(a, b))) }
    }
}

/// Where a condition holds.
#[derive(Clone, Copy)]
pub struct WhereAvx512(__mmask8);

macro_rules! by_vector {
    ($($operator:ident $method:ident $intrinsic:ident)*) => {
        $(impl $operator for EightAvx512 {
            type Output = EightAvx512;

            #[inline(always)]
            fn $method(self, other: EightAvx512) -> EightAvx512 {
                unsafe { EightAvx512($intrinsic(self.0, other.0)) }
            }
        })*
    };
}

by_vector!(
    Add add _mm512_add_pd
    Sub sub _mm512_sub_pd
    Mul mul _mm512_mul_pd
    Div div _mm512_div_pd
);

impl BitAnd for WhereAvx512 {
    type Output = WhereAvx512;

    #[inline(always)]
    fn bitand(self, other: WhereAvx512) -> WhereAvx512 {
        WhereAvx512(self.0 & other.0)
    }
}

impl BitOr for WhereAvx512 {
    type Output = WhereAvx512;

    #[inline(always)]
    fn bitor(self, other: WhereAvx512) -> WhereAvx512 {
        WhereAvx512(self.0 | other.0)
    }
}

impl Not for WhereAvx512 {
    type Output = WhereAvx512;

    #[inline(always)]
    fn not(self) -> WhereAvx512 {
        WhereAvx512(!self.0)
    }
}

impl Mask for WhereAvx512 {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self.0)
    }
}

impl Real for EightAvx512 {
    type Mask = WhereAvx512;

    #[inline(always)]
    fn of(self, v: f64) -> EightAvx512 {
        unsafe { EightAvx512(_mm512_set1_pd(v)) }
    }

    #[inline(always)]
    fn root(self) -> EightAvx512 {
        unsafe { EightAvx512(_mm512_sqrt_pd(self.0)) }
    }

    #[inline(always)]
    fn size(self) -> EightAvx512 {
        unsafe { EightAvx512(_mm512_abs_pd(self.0)) }
    }

    #[inline(always)]
    fn signed(self, sign: EightAvx512) -> EightAvx512 {
        unsafe {
            let bit = _mm512_and_pd(_mm512_set1_pd(-0.0), sign.0);
            EightAvx512(_mm512_or_pd(_mm512_abs_pd(self.0), bit))
        }
    }

    #[inline(always)]
    fn power(self) -> EightAvx512 {
        unsafe { EightAvx512(_mm512_and_pd(_mm512_set1_pd(f64::from_bits(EXPONENT)), self.0)) }
    }

    #[inline(always)]
    fn below(self, other: EightAvx512) -> WhereAvx512 {
        unsafe { WhereAvx512(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, other.0)) }
    }

    #[inline(always)]
    fn equals(self, other: EightAvx512) -> WhereAvx512 {
        unsafe { WhereAvx512(_mm512_cmp_pd_mask::<_CMP_EQ_OQ>(self.0, other.0)) }
    }

    #[inline(always)]
    fn choose(mask: WhereAvx512, a: EightAvx512, b: EightAvx512) -> EightAvx512 {
        unsafe { EightAvx512(_mm512_mask_blend_pd(mask.0, b.0, a.0)) }
    }
}
