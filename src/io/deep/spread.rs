//! The share of numbers below others: counts of numbers in bins that are joined when there are too
//! many, as the squares of points are.

use std::collections::HashMap;

use super::cells::{exponent_of, power};
use crate::geom::hash::PlaceHashes;

/// Bins that are held.
const MOST: usize = 1 << 12;
/// Bytes that they take in a table that grows.
pub const SPREAD_BYTES: u64 = 25 * 4 * MOST as u64;
/// Width of the narrowest bins: 2 to this power.
const NARROWEST: i32 = -24;
/// Binary digits of a number that bins tell apart at most.
const DIGITS: i32 = 40;

/// How numbers are spread.
#[derive(Debug, Clone)]
pub struct ValueSpread {
    exponent: i32,
    /// How many numbers there are in each bin, and the smallest.
    bins: HashMap<i64, (u64, f64), PlaceHashes>,
    count: u64,
}

impl Default for ValueSpread {
    fn default() -> Self {
        ValueSpread { exponent: NARROWEST, bins: HashMap::default(), count: 0 }
    }
}

impl ValueSpread {
    /// Adds a finite number.
    pub fn add(&mut self, number: f64) {
        let least = exponent_of(number) - DIGITS;
        if least > self.exponent {
            self.join(least);
        }
        self.count += 1;
        let bin = (number * power(-self.exponent)).floor() as i64;
        put(&mut self.bins, bin, (1, number));
        self.thin();
    }

    fn thin(&mut self) {
        while self.bins.len() > MOST {
            self.join(self.exponent + 1);
        }
    }

    /// Makes bins as wide as 2 to this power.
    fn join(&mut self, exponent: i32) {
        let by = (exponent - self.exponent).clamp(0, 63);
        let mut wider = HashMap::default();
        self.bins.drain().for_each(|(bin, counted)| put(&mut wider, bin >> by, counted));
        (self.exponent, self.bins) = (exponent, wider);
    }

    /// Adds other numbers.
    pub fn merge(&mut self, mut other: ValueSpread) {
        let exponent = self.exponent.max(other.exponent);
        self.join(exponent);
        other.join(exponent);
        self.count += other.count;
        other.bins.into_iter().for_each(|(bin, counted)| put(&mut self.bins, bin, counted));
        self.thin();
    }

    /// The numbers below which these shares of all are, 0 to 1, to the width of a bin: each is a
    /// number that there is. None without numbers.
    pub fn quantiles(&self, shares: &[f64]) -> Option<Vec<f64>> {
        let mut bins: Vec<(i64, (u64, f64))> =
            self.bins.iter().map(|(bin, counted)| (*bin, *counted)).collect();
        bins.sort_unstable_by_key(|(bin, _)| *bin);
        let last = self.count.checked_sub(1)?;
        let quantile = |share: &f64| {
            let mut below = 0;
            let rank = (last as f64 * share).round() as u64;
            let found = bins.iter().find(|(_, (count, _))| {
                below += count;
                below > rank
            });
            found.or(bins.last()).map(|(_, (_, least))| *least)
        };
        shares.iter().map(quantile).collect()
    }
}

fn put(bins: &mut HashMap<i64, (u64, f64), PlaceHashes>, bin: i64, (more, number): (u64, f64)) {
    let (count, least) = bins.entry(bin).or_insert((0, number));
    *count += more;
    // Of a 0 and a -0 always the same.
    if number.total_cmp(least).is_lt() {
        *least = number;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(numbers: &[f64]) -> ValueSpread {
        let mut spread = ValueSpread::default();
        numbers.iter().for_each(|&v| spread.add(v));
        spread
    }

    #[test]
    fn quantiles_of_few_numbers_are_exact() {
        let numbers: Vec<f64> = (0..1001).map(|n| f64::from(n) * 0.01 - 2.0).rev().collect();
        let quantiles = spread(&numbers).quantiles(&[0.0, 0.25, 0.5, 1.0]).unwrap();
        assert_eq!(quantiles, [-2.0, 0.5, 3.0, 8.0]);
        assert_eq!(spread(&[]).quantiles(&[0.5]), None);
    }

    #[test]
    fn an_outlier_costs_no_digits() {
        let mut numbers: Vec<f64> = (0..100_000).map(|n| f64::from(n) * 1e-4).collect();
        numbers.push(1e9);
        let whole = spread(&numbers);
        let median = whole.quantiles(&[0.5]).unwrap()[0];
        assert!((median - 5.0).abs() < 0.01, "{median}");
        let (one, two) = numbers.split_at(70_000);
        let mut merged = spread(two);
        merged.merge(spread(one));
        let shares = [0.0, 0.01, 0.5, 0.99, 1.0];
        assert_eq!(merged.quantiles(&shares), whole.quantiles(&shares));
        assert_eq!(merged.exponent, whole.exponent);
    }
}
