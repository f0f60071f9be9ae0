//! Formulas written once, for one number and for eight side by side.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

/// Numbers computed side by side where a formula is worth it.
pub const EIGHT: usize = 8;

/// A number, or several side by side for which a formula is computed alike: f64, or
/// [`Lanes::F64`](super::Lanes::F64). Every operation is that of f64, rounded as IEEE 754 says.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// What a comparison gives.
    type Mask: Mask;

    /// `v` in all lanes; `self` only says of which type.
    fn of(self, v: f64) -> Self;
    /// The square root.
    fn root(self) -> Self;
    /// The absolute value.
    fn size(self) -> Self;
    /// The absolute value with the sign of `sign`.
    fn signed(self, sign: Self) -> Self;
    /// The power of two with the same exponent, of a positive number.
    fn power(self) -> Self;
    /// Where self < other.
    fn below(self, other: Self) -> Self::Mask;
    /// Where self = other.
    fn equals(self, other: Self) -> Self::Mask;
    /// `a` where the mask holds, else `b`; both are computed.
    fn choose(mask: Self::Mask, a: Self, b: Self) -> Self;
}

/// Where a condition holds.
pub trait Mask: Copy + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    /// The lanes where it does, a bit each.
    fn bits(self) -> u32;
}

impl Mask for bool {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self)
    }
}

/// The exponent field of an f64.
pub(super) const EXPONENT: u64 = 0x7ff0_0000_0000_0000;

impl Real for f64 {
    type Mask = bool;

    #[inline(always)]
    fn of(self, v: f64) -> f64 {
        v
    }

    #[inline(always)]
    fn root(self) -> f64 {
        self.sqrt()
    }

    #[inline(always)]
    fn size(self) -> f64 {
        self.abs()
    }

    #[inline(always)]
    fn signed(self, sign: f64) -> f64 {
        self.copysign(sign)
    }

    #[inline(always)]
    fn power(self) -> f64 {
        f64::from_bits(self.to_bits() & EXPONENT)
    }

    #[inline(always)]
    fn below(self, other: f64) -> bool {
        self < other
    }

    #[inline(always)]
    fn equals(self, other: f64) -> bool {
        self == other
    }

    #[inline(always)]
    fn choose(mask: bool, a: f64, b: f64) -> f64 {
        if mask { a } else { b }
    }
}

/// Eight numbers in plain loops.
#[derive(Debug, Clone, Copy)]
pub struct Eight(pub(super) [f64; EIGHT]);

/// Eight conditions, a bit each.
#[derive(Debug, Clone, Copy)]
pub struct EightBits(u8);

impl Mask for EightBits {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self.0)
    }
}

impl BitAnd for EightBits {
    type Output = EightBits;

    #[inline(always)]
    fn bitand(self, other: EightBits) -> EightBits {
        EightBits(self.0 & other.0)
    }
}

impl BitOr for EightBits {
    type Output = EightBits;

    #[inline(always)]
    fn bitor(self, other: EightBits) -> EightBits {
        EightBits(self.0 | other.0)
    }
}

impl Not for EightBits {
    type Output = EightBits;

    #[inline(always)]
    fn not(self) -> EightBits {
        EightBits(!self.0)
    }
}

macro_rules! by_lane {
    ($($operator:ident $method:ident $symbol:tt)*) => {
        $(impl $operator for Eight {
            type Output = Eight;

            #[inline(always)]
            fn $method(self, other: Eight) -> Eight {
                let mut all = self.0;
                for i in 0..EIGHT {
                    all[i] = self.0[i] $symbol other.0[i];
                }
                Eight(all)
            }
        })*
    };
}

by_lane!(Add add + Sub sub - Mul mul * Div div /);

impl Eight {
    #[inline(always)]
    fn each(self, each: impl Fn(f64) -> f64) -> Eight {
        Eight(self.0.map(each))
    }

    #[inline(always)]
    fn holds(self, other: Eight, holds: impl Fn(f64, f64) -> bool) -> EightBits {
        EightBits((0..EIGHT).fold(0, |bits, i| bits | u8::from(holds(self.0[i], other.0[i])) << i))
    }
}

impl Real for Eight {
    type Mask = EightBits;

    #[inline(always)]
    fn of(self, v: f64) -> Eight {
        Eight([v; EIGHT])
    }

    #[inline(always)]
    fn root(self) -> Eight {
        self.each(f64::sqrt)
    }

    #[inline(always)]
    fn size(self) -> Eight {
        self.each(f64::abs)
    }

    #[inline(always)]
    fn signed(self, sign: Eight) -> Eight {
        Eight(std::array::from_fn(|i| self.0[i].copysign(sign.0[i])))
    }

    #[inline(always)]
    fn power(self) -> Eight {
        self.each(Real::power)
    }

    #[inline(always)]
    fn below(self, other: Eight) -> EightBits {
        self.holds(other, |a, b| a < b)
    }

    #[inline(always)]
    fn equals(self, other: Eight) -> EightBits {
        self.holds(other, |a, b| a == b)
    }

    #[inline(always)]
    fn choose(mask: EightBits, a: Eight, b: Eight) -> Eight {
        Eight(std::array::from_fn(|i| if mask.0 >> i & 1 == 1 { a.0[i] } else { b.0[i] }))
    }
}
