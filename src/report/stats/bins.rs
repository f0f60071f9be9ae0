//! Counts of numbers in bins of one width.
//!
//! A histogram needs its range before its first number, and one walk does not know it. So its bins
//! are as wide as a power of two, from multiples of it: when a number falls outside, neighbours are
//! joined, and a bin of the wider ones is exactly two of the narrower. The width in the end is a
//! function of the smallest and the largest number alone, whoever counted what first.

use serde::{Deserialize, Serialize};

/// Counts of numbers in bins of one width, each from its lower end on, its upper end left out.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DimensionHistogram {
    /// Lower end of the first bin.
    pub from: f64,
    /// Width of a bin: a power of two.
    pub width: f64,
    /// How many numbers are in each.
    pub counts: Vec<u64>,
}

/// Bins that a histogram has at most: as many as there are classes.
pub(super) const BINS: usize = 256;
/// Binary digits of a number that bins tell apart at most, so that their numbers fit in words.
const DIGITS: i32 = 40;
/// Exponent of the narrowest bins.
pub(super) const NARROWEST: i32 = -1000;

/// Counts of numbers in bins of 2^`exponent`, the first of which begins at its `first` multiple.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Bins {
    pub exponent: i32,
    pub first: i64,
    pub counts: Vec<u64>,
}

/// 2^`exponent`, for exponents of normal numbers.
pub(super) fn power(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

impl Bins {
    /// Adds a finite number; bins of whole numbers are no narrower than 2^`narrowest`.
    pub fn add(&mut self, number: f64, narrowest: i32) {
        let exponent = (number.to_bits() >> 52 & 0x7ff) as i32 - 1023;
        let least = (exponent - DIGITS).max(narrowest);
        if self.counts.is_empty() {
            self.exponent = least;
        } else if least > self.exponent {
            self.join(least);
        }
        let mut at = (number * power(-self.exponent)).floor() as i64;
        if self.counts.is_empty() {
            self.first = at;
        }
        if let Some(count) = self.counts.get_mut((at - self.first) as usize) {
            *count += 1;
            return;
        }
        at = self.reach(at, at);
        self.counts[(at - self.first) as usize] += 1;
    }

    /// Sees to it that there are bins from `low` to `high`, multiples of the width that it has now;
    /// what `low` is a multiple of then.
    fn reach(&mut self, mut low: i64, mut high: i64) -> i64 {
        loop {
            let last = self.first + self.counts.len().max(1) as i64 - 1;
            let (begin, end) = (low.min(self.first), high.max(last));
            if end - begin < BINS as i64 {
                let before = std::iter::repeat_n(0, (self.first - begin) as usize);
                self.counts.splice(0..0, before);
                self.counts.resize((end - begin) as usize + 1, 0);
                self.first = begin;
                return low;
            }
            self.join(self.exponent + 1);
            (low, high) = (low >> 1, high >> 1);
        }
    }

    /// Makes bins as wide as 2^`exponent`.
    fn join(&mut self, exponent: i32) {
        let by = (exponent - self.exponent).clamp(0, 63);
        let first = self.first >> by;
        let mut counts = Vec::new();
        for (n, count) in self.counts.iter().enumerate() {
            let at = (((self.first + n as i64) >> by) - first) as usize;
            if at >= counts.len() {
                counts.resize(at + 1, 0);
            }
            counts[at] += count;
        }
        (self.exponent, self.first, self.counts) = (exponent, first, counts);
    }

    pub fn merge(&mut self, other: &Bins) {
        if other.counts.is_empty() {
            return;
        }
        if self.counts.is_empty() {
            *self = other.clone();
            return;
        }
        let mut other = other.clone();
        let exponent = self.exponent.max(other.exponent);
        self.join(exponent);
        other.join(exponent);
        self.reach(other.first, other.first + other.counts.len() as i64 - 1);
        other.join(self.exponent);
        let begin = (other.first - self.first) as usize;
        self.counts[begin..].iter_mut().zip(&other.counts).for_each(|(mine, n)| *mine += n);
    }

    pub fn histogram(&self) -> Option<DimensionHistogram> {
        let width = power(self.exponent);
        let from = self.first as f64 * width;
        let counts = self.counts.clone();
        (!counts.is_empty()).then_some(DimensionHistogram { from, width, counts })
    }
}
