//! Whole numbers of 256 bits, as far as exact distances and sums need them. Knows no points.

/// A whole number from 0 to 2^256 − 1; sums and products beyond end there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Wide {
    high: u128,
    low: u128,
}

impl Wide {
    /// 0.
    pub const ZERO: Wide = Wide { high: 0, low: 0 };
    /// The largest.
    pub const MAX: Wide = Wide { high: u128::MAX, low: u128::MAX };

    /// The product of two numbers of 128 bits.
    pub fn product(a: u128, b: u128) -> Wide {
        const LOW: u128 = u64::MAX as u128;
        if (a | b) >> 64 == 0 {
            return Wide { high: 0, low: a * b };
        }
        let (a1, a0, b1, b0) = (a >> 64, a & LOW, b >> 64, b & LOW);
        let (cross, carry) = (a1 * b0).overflowing_add(a0 * b1);
        let upper = a1 * b1 + (cross >> 64) + (u128::from(carry) << 64);
        let (low, carry) = (a0 * b0).overflowing_add(cross << 64);
        Wide { high: upper + u128::from(carry), low }
    }

    /// The square of a number of 128 bits.
    pub fn square(v: u128) -> Wide {
        Wide::product(v, v)
    }

    /// The sum.
    #[must_use]
    pub fn plus(self, other: Wide) -> Wide {
        let (low, carry) = self.low.overflowing_add(other.low);
        let high = self.high.checked_add(other.high);
        let high = high.and_then(|high| high.checked_add(u128::from(carry)));
        high.map_or(Wide::MAX, |high| Wide { high, low })
    }

    /// The difference; 0 where `other` is larger.
    #[must_use]
    pub fn minus(self, other: Wide) -> Wide {
        if self <= other {
            return Wide::ZERO;
        }
        let (low, borrow) = self.low.overflowing_sub(other.low);
        Wide { high: self.high - other.high - u128::from(borrow), low }
    }

    /// The product with a number of 64 bits.
    #[must_use]
    pub fn times(self, n: u64) -> Wide {
        let low = Wide::product(self.low, u128::from(n));
        let high = self.high.checked_mul(u128::from(n));
        high.map_or(Wide::MAX, |high| low.plus(Wide { high, low: 0 }))
    }

    /// The nearest f64, up to two roundings.
    pub fn value(self) -> f64 {
        // 2^128 has no name among the integers.
        const TWO_127: f64 = (1u128 << 127) as f64;
        self.high as f64 * TWO_127 * 2.0 + self.low as f64
    }

    /// Its four words of 64 bits, the least first.
    pub fn words(self) -> [u64; 4] {
        [self.low as u64, (self.low >> 64) as u64, self.high as u64, (self.high >> 64) as u64]
    }

    /// The number of these words, the least first.
    pub fn of_words([a, b, c, d]: [u64; 4]) -> Wide {
        let pair = |low, high| u128::from(low) | u128::from(high) << 64;
        Wide { high: pair(c, d), low: pair(a, b) }
    }
}

impl From<u128> for Wide {
    fn from(low: u128) -> Wide {
        Wide { high: 0, low }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A product in pieces of 32 bits, by hand.
    fn plain(a: &[u128], b: &[u128]) -> [u64; 4] {
        let mut pieces = [0u128; 17];
        for (i, a) in a.iter().enumerate() {
            for (j, b) in b.iter().enumerate() {
                pieces[i + j] += a * b;
            }
        }
        for i in 0..16 {
            pieces[i + 1] += pieces[i] >> 32;
            pieces[i] &= 0xffff_ffff;
        }
        std::array::from_fn(|i| (pieces[2 * i] | pieces[2 * i + 1] << 32) as u64)
    }

    fn digits(words: &[u64]) -> Vec<u128> {
        words.iter().flat_map(|w| [u128::from(w & 0xffff_ffff), u128::from(w >> 32)]).collect()
    }

    fn number([low, high]: [u64; 2]) -> u128 {
        u128::from(low) | u128::from(high) << 64
    }

    proptest::proptest! {
        #[test]
        fn products_and_sums_are_exact(
            a: [u64; 2], b: [u64; 2], n: u64,
            c in proptest::array::uniform3(proptest::num::u64::ANY),
        ) {
            let product = Wide::product(number(a), number(b));
            proptest::prop_assert_eq!(product.words(), plain(&digits(&a), &digits(&b)));
            let three = Wide::of_words([c[0], c[1], c[2], 0]);
            proptest::prop_assert_eq!(three.times(n).words(), plain(&digits(&c), &digits(&[n])));
            let half = Wide::of_words(product.words().map(|w| w >> 1));
            let sum = half.plus(three);
            proptest::prop_assert_eq!(sum.minus(three), half);
            proptest::prop_assert_eq!(sum.minus(half), three);
            proptest::prop_assert_eq!(half.minus(sum.plus(Wide::from(1))), Wide::ZERO);
            proptest::prop_assert_eq!(half.plus(half), half.times(2));
        }

        #[test]
        fn the_float_is_near(a: [u64; 4]) {
            let expected = a.iter().rev().fold(0.0, |sum, &w| sum * 2f64.powi(64) + w as f64);
            let value = Wide::of_words(a).value();
            proptest::prop_assert!((value - expected).abs() <= expected * 2f64.powi(-50));
        }
    }

    #[test]
    fn what_is_too_large_stays_the_largest() {
        assert_eq!(Wide::MAX.plus(Wide::from(1)), Wide::MAX);
        assert_eq!(Wide::of_words([0, 0, 0, 1 << 63]).times(2), Wide::MAX);
        assert_eq!(Wide::square(u128::MAX).plus(Wide::MAX), Wide::MAX);
        assert_eq!(Wide::square(u128::MAX).words(), [1, 0, u64::MAX - 1, u64::MAX]);
    }
}
