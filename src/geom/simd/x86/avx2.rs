//! Vectors of 256 bits.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use crate::geom::rows::{self, Ordered};
use crate::geom::simd::lanes::{COLUMNS, LANES, Lanes, Row, joined};
use crate::geom::simd::real::{EIGHT, EXPONENT, Mask, Real};

// SAFETY, of every block here: a value of a type of this module comes from `witness` alone, which
// is called only in code that is compiled for the instructions and run where the processor has
// them; and arrays that are read or written have the numbers that the instruction touches.

/// Two vectors of 256 bits.
#[derive(Clone, Copy)]
pub struct Avx2(());

impl Avx2 {
    /// For code that is compiled for these instructions.
    pub(super) fn witness() -> Avx2 {
        Avx2(())
    }
}

impl Lanes for Avx2 {
    type F32 = [__m256; 2];
    type F64 = EightAvx2;

    #[inline(always)]
    fn load(self, from: &[f32; LANES]) -> Self::F32 {
        unsafe { [_mm256_loadu_ps(from.as_ptr()), _mm256_loadu_ps(from.as_ptr().add(8))] }
    }

    #[inline(always)]
    fn store(self, v: Self::F32) -> [f32; LANES] {
        let mut to = [0.0; LANES];
        unsafe {
            _mm256_storeu_ps(to.as_mut_ptr(), v[0]);
            _mm256_storeu_ps(to.as_mut_ptr().add(8), v[1]);
        }
        to
    }

    #[inline(always)]
    fn splat(self, v: f32) -> Self::F32 {
        unsafe { [_mm256_set1_ps(v); 2] }
    }

    #[inline(always)]
    fn add(self, a: Self::F32, b: Self::F32) -> Self::F32 {
        unsafe { [_mm256_add_ps(a[0], b[0]), _mm256_add_ps(a[1], b[1])] }
    }

    #[inline(always)]
    fn sub(self, a: Self::F32, b: Self::F32) -> Self::F32 {
        unsafe { [_mm256_sub_ps(a[0], b[0]), _mm256_sub_ps(a[1], b[1])] }
    }

    #[inline(always)]
    fn mul(self, a: Self::F32, b: Self::F32) -> Self::F32 {
        unsafe { [_mm256_mul_ps(a[0], b[0]), _mm256_mul_ps(a[1], b[1])] }
    }

    #[inline(always)]
    fn larger(self, a: Self::F32, b: Self::F32) -> Self::F32 {
        unsafe { [_mm256_max_ps(a[0], b[0]), _mm256_max_ps(a[1], b[1])] }
    }

    #[inline(always)]
    fn at_most(self, a: Self::F32, b: Self::F32) -> u32 {
        unsafe {
            let low = _mm256_cmp_ps::<_CMP_LE_OQ>(a[0], b[0]);
            mask(low, _mm256_cmp_ps::<_CMP_LE_OQ>(a[1], b[1]))
        }
    }

    #[inline(always)]
    fn before(self, a: Self::F32, b: Self::F32, rank: u32, ranks: &[u32; LANES]) -> u32 {
        unsafe {
            let low = before(a[0], b[0], rank, ranks.as_ptr());
            mask(low, before(a[1], b[1], rank, ranks.as_ptr().add(8)))
        }
    }

    #[inline(always)]
    fn largest(self, v: Self::F32) -> f32 {
        unsafe {
            let v = _mm256_max_ps(v[0], v[1]);
            let v = _mm_max_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
            let v = _mm_max_ps(v, _mm_movehl_ps(v, v));
            _mm_cvtss_f32(_mm_max_ss(v, _mm_movehdup_ps(v)))
        }
    }

    #[inline(always)]
    fn first(self, keys: &[u32; LANES], mask: u32) -> usize {
        unsafe {
            let low = least(keys.as_ptr(), mask);
            let v = _mm256_min_epu32(low, least(keys.as_ptr().add(8), mask >> 8));
            let v = _mm_min_epu32(_mm256_castsi256_si128(v), _mm256_extracti128_si256::<1>(v));
            let v = _mm_min_epu32(v, _mm_shuffle_epi32::<0b01_00_11_10>(v));
            let v = _mm_min_epu32(v, _mm_shuffle_epi32::<0b10_11_00_01>(v));
            _mm_cvtsi128_si32(v) as usize & (LANES - 1)
        }
    }

    #[inline(always)]
    fn load_eight(self, from: &[f64; EIGHT]) -> EightAvx2 {
        unsafe {
            EightAvx2([_mm256_loadu_pd(from.as_ptr()), _mm256_loadu_pd(from.as_ptr().add(4))])
        }
    }

    #[inline(always)]
    fn store_eight(self, v: EightAvx2) -> [f64; EIGHT] {
        let mut to = [0.0; EIGHT];
        unsafe {
            _mm256_storeu_pd(to.as_mut_ptr(), v.0[0]);
            _mm256_storeu_pd(to.as_mut_ptr().add(4), v.0[1]);
        }
        to
    }

    #[inline(always)]
    fn sort(self, rows: &mut [Row; LANES]) {
        // Four lists at a time: their numbers are as many vectors as there are registers.
        for first in (0..LANES).step_by(4) {
            let mut lists = [Four(unsafe { _mm256_setzero_pd() }); LANES];
            for i in 0..LANES {
                lists[i] = Four(unsafe { _mm256_loadu_pd(rows[i].as_ptr().add(first)) });
            }
            rows::sort(&mut lists);
            for i in 0..LANES {
                unsafe { _mm256_storeu_pd(rows[i].as_mut_ptr().add(first), lists[i].0) };
            }
        }
    }

    #[inline(always)]
    fn merge(self, best: &mut [Row; LANES], rows: &mut [Row; LANES]) {
        self.sort(rows);
        for first in (0..LANES).step_by(4) {
            let zero = Four(unsafe { _mm256_setzero_pd() });
            let (mut lists, mut kept) = ([zero; LANES], [zero; LANES]);
            for i in 0..LANES {
                lists[i] = Four(unsafe { _mm256_loadu_pd(rows[i].as_ptr().add(first)) });
                kept[i] = Four(unsafe { _mm256_loadu_pd(best[i].as_ptr().add(first)) });
            }
            rows::merge(&mut kept, &lists);
            for i in 0..LANES {
                unsafe { _mm256_storeu_pd(best[i].as_mut_ptr().add(first), kept[i].0) };
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

#[inline(always)]
unsafe fn mask(low: __m256, high: __m256) -> u32 {
    unsafe { _mm256_movemask_ps(low) as u32 | (_mm256_movemask_ps(high) as u32) << 8 }
}

/// [`Lanes::before`] for the eight lanes whose ranks begin at `ranks`.
#[inline(always)]
unsafe fn before(a: __m256, b: __m256, rank: u32, ranks: *const u32) -> __m256 {
    unsafe {
        let less = _mm256_cmp_ps::<_CMP_LT_OQ>(a, b);
        let equal = _mm256_cmp_ps::<_CMP_EQ_OQ>(a, b);
        let rank = _mm256_set1_epi32(rank as i32);
        // rank ≥ ranks where the larger of both is rank.
        let ranks = _mm256_loadu_si256(ranks.cast());
        let behind = _mm256_cmpeq_epi32(_mm256_max_epu32(rank, ranks), rank);
        _mm256_or_ps(less, _mm256_andnot_ps(_mm256_castsi256_ps(behind), equal))
    }
}

/// Eight keys, those not in the lowest bits of `mask` replaced by the largest.
#[inline(always)]
unsafe fn least(keys: *const u32, mask: u32) -> __m256i {
    unsafe {
        let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
        let chosen = _mm256_and_si256(_mm256_set1_epi32(mask as i32), bits);
        let out = _mm256_cmpeq_epi32(chosen, _mm256_setzero_si256());
        _mm256_or_si256(out, _mm256_loadu_si256(keys.cast()))
    }
}

/// [`Lanes::insert`]: one vector a row, of which the last alone is to be turned.
#[inline(always)]
pub(super) unsafe fn insert<const ROWS: usize>(
    list: &mut [[f64; COLUMNS]; ROWS],
    high: &[f32; LANES],
    low: &[u32; LANES],
    mut hits: u32,
) {
    let mut sorted = [unsafe { _mm256_setzero_pd() }; ROWS];
    for i in 0..ROWS {
        sorted[i] = unsafe { _mm256_loadu_pd(list[i].as_ptr()) };
    }
    while hits != 0 {
        let lane = hits.trailing_zeros() as usize & (LANES - 1);
        hits &= hits - 1;
        unsafe {
            let new = _mm256_set1_pd(joined(high[lane], low[lane]));
            let turned = _mm256_permute4x64_pd::<0b10_01_00_11>(sorted[ROWS - 1]);
            let mut before = _mm256_blend_pd::<1>(turned, _mm256_setzero_pd());
            for row in &mut sorted {
                let old = *row;
                *row = _mm256_min_pd(old, _mm256_max_pd(before, new));
                before = old;
            }
        }
    }
    for i in 0..ROWS {
        unsafe { _mm256_storeu_pd(list[i].as_mut_ptr(), sorted[i]) };
    }
}

/// One number of each of four lists.
#[derive(Clone, Copy)]
struct Four(__m256d);

impl Ordered for Four {
    #[inline(always)]
    fn ordered(self, other: Four) -> (Four, Four) {
        let (a, b) = (self.0, other.0);
        unsafe { (Four(_mm256_min_pd(a, b)), Four(_mm256_max_pd(a, b))) }
    }
}

/// Eight f64 in two vectors.
#[derive(Clone, Copy)]
pub struct EightAvx2([__m256d; 2]);

/// Where a condition holds: all bits of a lane, or none.
#[derive(Clone, Copy)]
pub struct WhereAvx2([__m256d; 2]);

macro_rules! by_vector {
    ($($operator:ident $method:ident $intrinsic:ident $type:ident)*) => {
        $(impl $operator for $type {
            type Output = $type;

            #[inline(always)]
            fn $method(self, other: $type) -> $type {
                unsafe {
                    $type([$intrinsic(self.0[0], other.0[0]), $intrinsic(self.0[1], other.0[1])])
                }
            }
        })*
    };
}

by_vector!(
    Add add _mm256_add_pd EightAvx2
    Sub sub _mm256_sub_pd EightAvx2
    Mul mul _mm256_mul_pd EightAvx2
    Div div _mm256_div_pd EightAvx2
    BitAnd bitand _mm256_and_pd WhereAvx2
    BitOr bitor _mm256_or_pd WhereAvx2
);

impl Not for WhereAvx2 {
    type Output = WhereAvx2;

    #[inline(always)]
    fn not(self) -> WhereAvx2 {
        unsafe {
            let all = _mm256_castsi256_pd(_mm256_set1_epi64x(-1));
            WhereAvx2([_mm256_xor_pd(self.0[0], all), _mm256_xor_pd(self.0[1], all)])
        }
    }
}

impl Mask for WhereAvx2 {
    #[inline(always)]
    fn bits(self) -> u32 {
        unsafe {
            _mm256_movemask_pd(self.0[0]) as u32 | (_mm256_movemask_pd(self.0[1]) as u32) << 4
        }
    }
}

impl Real for EightAvx2 {
    type Mask = WhereAvx2;

    #[inline(always)]
    fn of(self, v: f64) -> EightAvx2 {
        unsafe { EightAvx2([_mm256_set1_pd(v); 2]) }
    }

    #[inline(always)]
    fn root(self) -> EightAvx2 {
        unsafe { EightAvx2([_mm256_sqrt_pd(self.0[0]), _mm256_sqrt_pd(self.0[1])]) }
    }

    #[inline(always)]
    fn size(self) -> EightAvx2 {
        unsafe {
            let sign = _mm256_set1_pd(-0.0);
            EightAvx2([_mm256_andnot_pd(sign, self.0[0]), _mm256_andnot_pd(sign, self.0[1])])
        }
    }

    #[inline(always)]
    fn signed(self, sign: EightAvx2) -> EightAvx2 {
        unsafe {
            let bit = _mm256_set1_pd(-0.0);
            let size = self.size().0;
            EightAvx2([
                _mm256_or_pd(size[0], _mm256_and_pd(bit, sign.0[0])),
                _mm256_or_pd(size[1], _mm256_and_pd(bit, sign.0[1])),
            ])
        }
    }

    #[inline(always)]
    fn power(self) -> EightAvx2 {
        unsafe {
            let bits = _mm256_set1_pd(f64::from_bits(EXPONENT));
            EightAvx2([_mm256_and_pd(bits, self.0[0]), _mm256_and_pd(bits, self.0[1])])
        }
    }

    #[inline(always)]
    fn below(self, other: EightAvx2) -> WhereAvx2 {
        unsafe {
            WhereAvx2([
                _mm256_cmp_pd::<_CMP_LT_OQ>(self.0[0], other.0[0]),
                _mm256_cmp_pd::<_CMP_LT_OQ>(self.0[1], other.0[1]),
            ])
        }
    }

    #[inline(always)]
    fn equals(self, other: EightAvx2) -> WhereAvx2 {
        unsafe {
            WhereAvx2([
                _mm256_cmp_pd::<_CMP_EQ_OQ>(self.0[0], other.0[0]),
                _mm256_cmp_pd::<_CMP_EQ_OQ>(self.0[1], other.0[1]),
            ])
        }
    }

    #[inline(always)]
    fn choose(mask: WhereAvx2, a: EightAvx2, b: EightAvx2) -> EightAvx2 {
        unsafe {
            EightAvx2([
                _mm256_blendv_pd(b.0[0], a.0[0], mask.0[0]),
                _mm256_blendv_pd(b.0[1], a.0[1], mask.0[1]),
            ])
        }
    }
}
