//! Floats with twice the digits.

use std::ops::{Add, Mul, Sub};

use crate::report::sums::FixedSum;

/// A number as the sum of two floats, the second of which is what the first leaves: the difference
/// of two squares of large numbers keeps the digits that it is about.
#[derive(Debug, Clone, Copy)]
pub(super) struct Twofold(f64, f64);

impl Twofold {
    pub fn of(whole: i128) -> Twofold {
        let near = whole as f64;
        Twofold(near, (whole - near as i128) as f64)
    }

    pub fn of_sums(plus: &FixedSum, minus: &FixedSum) -> Twofold {
        let [plus, minus] = [plus, minus].map(FixedSum::parts).map(|[a, b]| Twofold(a, b));
        plus - minus
    }

    pub fn value(self) -> f64 {
        self.0 + self.1
    }

    /// The sum of two floats and what its rounding leaves (Knuth).
    fn sum(a: f64, b: f64) -> Twofold {
        let sum = a + b;
        let part = sum - a;
        Twofold(sum, (a - (sum - part)) + (b - part))
    }
}

impl Add for Twofold {
    type Output = Twofold;

    fn add(self, other: Twofold) -> Twofold {
        let Twofold(sum, rest) = Twofold::sum(self.0, other.0);
        Twofold::sum(sum, rest + self.1 + other.1)
    }
}

impl Sub for Twofold {
    type Output = Twofold;

    fn sub(self, other: Twofold) -> Twofold {
        self + Twofold(-other.0, -other.1)
    }
}

impl Mul for Twofold {
    type Output = Twofold;

    fn mul(self, other: Twofold) -> Twofold {
        let product = self.0 * other.0;
        let rest = libm::fma(self.0, other.0, -product);
        Twofold::sum(product, rest + self.0 * other.1 + self.1 * other.0)
    }
}

impl Mul<f64> for Twofold {
    type Output = Twofold;

    fn mul(self, factor: f64) -> Twofold {
        self * Twofold(factor, 0.0)
    }
}
