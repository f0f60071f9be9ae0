//! How far removed records are from the surface of the points that stand for them.

use serde::{Deserialize, Serialize};

use std::cmp::Ordering;

use super::lot::Lot;
use super::sums::{FixedSum, OpenSum};
use crate::point::Position;
use crate::store::morton_cmp;

/// Deviations of removed records, in lattice steps: number, sum of squares, the largest and where.
/// Merged in any order and by any split they are the same.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Deviations {
    count: u64,
    squares: FixedSum,
    largest: Option<(f32, Position)>,
    undefined: u64,
}

impl Deviations {
    /// Adds `copies` removed records at `position`, `deviation` (any sign) from the surface.
    pub fn add(&mut self, deviation: f32, position: Position, copies: u32) {
        if copies == 0 {
            return;
        }
        if !deviation.is_finite() {
            self.undefined += u64::from(copies);
            return;
        }
        self.count += u64::from(copies);
        let deviation = deviation.abs();
        let wide = f64::from(deviation);
        self.squares.add(wide * wide, copies);
        self.reach(deviation, position);
    }

    /// Adds the deviations of removed records at `positions`, as their lots tell.
    pub(super) fn add_all(&mut self, positions: &[Position], lots: &[Lot]) {
        let mut squares = OpenSum::default();
        for (&position, lot) in positions.iter().zip(lots) {
            let Some(deviation) = lot.deviation else { continue };
            if lot.removed() != 1 || !deviation.is_finite() {
                self.add(deviation, position, lot.removed());
                continue;
            }
            self.count += 1;
            let wide = f64::from(deviation);
            squares.add(wide * wide, &mut self.squares);
            self.reach(deviation.abs(), position);
        }
        squares.close(&mut self.squares);
    }

    /// Of equal deviations the first in Morton order is named.
    fn reach(&mut self, deviation: f32, position: Position) {
        let further = self.largest.is_none_or(|(most, at)| {
            deviation > most || deviation == most && morton_cmp(&position, &at) == Ordering::Less
        });
        if further {
            self.largest = Some((deviation, position));
        }
    }

    /// Adds other deviations.
    pub fn merge(&mut self, other: &Deviations) {
        self.count += other.count;
        self.undefined += other.undefined;
        self.squares.merge(&other.squares);
        if let Some((deviation, position)) = other.largest {
            self.reach(deviation, position);
        }
    }

    /// Removed records.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Records whose deviation was no finite number, which no stage may report; in no other figure.
    pub fn undefined(&self) -> u64 {
        self.undefined
    }

    /// sqrt(Σd²/n) in lattice steps; None without records.
    pub fn rms(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.squares.value() / self.count as f64).sqrt())
    }

    /// The largest in lattice steps and its position; None without records.
    pub fn largest(&self) -> Option<(f32, Position)> {
        self.largest
    }
}

/// Bins that [`Histogram::eighths`] joins.
const JOINED: usize = 16;

/// Bits of an f32 below those that number its bin: 128 bins between a power of two and the next.
const BELOW_BIN: u32 = 16;
/// Number of the bin that ends at 2^-32 steps; everything smaller is in it too.
const FIRST: u32 = (127 - 32) << 7;
/// 96 powers of two and the first bin: up to 2^64 steps, which no distance on the lattice reaches.
const BINS: usize = 96 * 128 + 1;

/// A histogram of deviations in bins at most 1 % wide (128 between a power of two and the next, by
/// the leading bits of the figure), with a bin of its own for zero. A bin includes its upper edge.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Histogram {
    zero: u64,
    bins: Box<[u64]>,
}

impl Default for Histogram {
    fn default() -> Self {
        Histogram { zero: 0, bins: vec![0; BINS].into_boxed_slice() }
    }
}

impl Histogram {
    /// Bytes that a histogram holds.
    pub const BYTES: u64 = (BINS * size_of::<u64>()) as u64;

    /// Adds `copies` records of `deviation` (finite, any sign) in lattice steps.
    pub fn add(&mut self, deviation: f32, copies: u32) {
        let bits = deviation.abs().to_bits();
        if bits == 0 {
            self.zero += u64::from(copies);
            return;
        }
        // One less, so that an edge is in the bin below it.
        let bin = ((bits - 1) >> BELOW_BIN).saturating_sub(FIRST - 1) as usize;
        if let Some(count) = self.bins.get_mut(bin.min(BINS - 1)) {
            *count += u64::from(copies);
        }
    }

    /// Adds another histogram.
    pub fn merge(&mut self, other: &Histogram) {
        self.zero += other.zero;
        for (mine, theirs) in self.bins.iter_mut().zip(other.bins.iter()) {
            *mine += theirs;
        }
    }

    /// The records by eighths of a power of two: upper edge in lattice steps, 0 for the bin of
    /// zero, and how many; in ascending order, without bins of no record.
    pub fn eighths(&self) -> impl Iterator<Item = (f32, u64)> {
        let first = [(0.0, self.zero), (upper_edge(0), self.bins[0])];
        let joined = self.bins[1..].chunks(JOINED).enumerate();
        let joined = joined.map(|(n, bins)| (upper_edge((n + 1) * JOINED), bins.iter().sum()));
        first.into_iter().chain(joined).filter(|(_, records)| *records > 0)
    }

    /// Records.
    pub fn count(&self) -> u64 {
        self.zero + self.bins.iter().sum::<u64>()
    }

    /// The upper edge, in lattice steps, of the bin in which the `percent`-th percentile is: at
    /// least that share of the records is no larger. None without records.
    pub fn percentile(&self, percent: u32) -> Option<f32> {
        let count = self.count();
        if count == 0 {
            return None;
        }
        let rank = (u128::from(count) * u128::from(percent)).div_ceil(100).max(1);
        let mut below = u128::from(self.zero);
        if below >= rank {
            return Some(0.0);
        }
        for (bin, &n) in self.bins.iter().enumerate() {
            below += u128::from(n);
            if below >= rank {
                return Some(upper_edge(bin));
            }
        }
        None
    }
}

fn upper_edge(bin: usize) -> f32 {
    f32::from_bits((bin as u32 + FIRST) << BELOW_BIN)
}

/// Deviations with their histogram. Merged in any order and by any split they are the same.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasuredDeviations {
    pub deviations: Deviations,
    pub histogram: Histogram,
}

impl MeasuredDeviations {
    /// Adds `records` at `position`, `deviation` (any sign) from the surface.
    pub fn add(&mut self, deviation: f32, position: Position, records: u32) {
        if records > 0 {
            self.deviations.add(deviation, position, records);
            self.histogram.add(deviation, records);
        }
    }

    /// Adds other deviations.
    pub fn merge(&mut self, other: &MeasuredDeviations) {
        self.deviations.merge(&other.deviations);
        self.histogram.merge(&other.histogram);
    }

    /// What `percent` of the records deviate no more than, in lattice steps; no bin's edge is told
    /// that is beyond the largest. None without records.
    pub fn percentile(&self, percent: u32) -> Option<f32> {
        let (largest, _) = self.deviations.largest()?;
        Some(self.histogram.percentile(percent).unwrap_or(largest).min(largest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_start_at_2_to_the_minus_32_and_are_at_most_one_percent_wide() {
        assert_eq!(upper_edge(0), 2f32.powi(-32));
        assert_eq!(upper_edge(BINS - 1), 2f32.powi(64));
        for bin in 1..BINS {
            let ratio = f64::from(upper_edge(bin)) / f64::from(upper_edge(bin - 1));
            assert!(ratio > 1.0 && ratio <= 1.01, "{bin}: {ratio}");
        }
    }

    #[test]
    fn figures_beyond_the_bins_are_counted_in_the_outermost() {
        let mut histogram = Histogram::default();
        histogram.add(f32::from_bits(1), 1);
        assert_eq!(histogram.percentile(50), Some(2f32.powi(-32)));
        let mut histogram = Histogram::default();
        histogram.add(f32::MAX, 1);
        assert_eq!(histogram.percentile(50), Some(2f32.powi(64)));
    }

    #[test]
    fn zeros_have_a_bin_of_their_own() {
        let mut histogram = Histogram::default();
        histogram.add(0.0, 94);
        histogram.add(-0.0, 1);
        histogram.add(1.0, 5);
        assert_eq!(histogram.percentile(95), Some(0.0));
        assert_eq!(histogram.percentile(96), Some(1.0));
        assert_eq!(Histogram::default().percentile(50), None);
    }

    #[test]
    fn eighths_of_powers_of_two_have_all_records() {
        let mut histogram = Histogram::default();
        for (figure, copies) in [(0.0, 3), (1.0, 4), (1.05, 1), (1.0905, 1), (1.2, 5), (2.0, 2)] {
            histogram.add(figure, copies);
        }
        let eighths: Vec<(f32, u64)> = histogram.eighths().collect();
        let edges = [0.0, 1.0, 1.125, 1.25, 2.0];
        assert_eq!(eighths, std::iter::zip(edges, [3, 4, 2, 5, 2]).collect::<Vec<_>>());
        assert_eq!(eighths.iter().map(|(_, n)| n).sum::<u64>(), histogram.count());
    }

    #[test]
    fn of_equal_deviations_the_first_in_morton_order_is_named() {
        let mut deviations = Deviations::default();
        deviations.add(2.0, [0, 0, 1], 1);
        deviations.add(-2.0, [1, 0, 0], 3);
        deviations.add(2.0, [0, 1, 0], 1);
        assert_eq!(deviations.largest(), Some((2.0, [1, 0, 0])));
        assert_eq!((deviations.count(), deviations.rms()), (5, Some(2.0)));
    }

    #[test]
    fn a_deviation_that_is_no_number_is_counted_apart() {
        let mut deviations = Deviations::default();
        deviations.add(f32::NAN, [0; 3], 2);
        deviations.add(f32::INFINITY, [0; 3], 1);
        assert_eq!((deviations.undefined(), deviations.count(), deviations.rms()), (3, 0, None));
    }

    proptest::proptest! {
        #[test]
        fn percentiles_are_within_one_percent_above_the_sorted_figure(
            figures in proptest::collection::vec((0f32..1.0, -30i32..30, 1u32..4), 1..300),
        ) {
            let mut histogram = Histogram::default();
            let mut sorted = Vec::new();
            for (f, e, copies) in figures {
                let figure = (f * 2f32.powi(e)).max(0.0);
                let figure = if figure < 2f32.powi(-31) { 0.0 } else { figure };
                histogram.add(figure, copies);
                sorted.extend((0..copies).map(|_| figure));
            }
            sorted.sort_by(f32::total_cmp);
            for percent in [1, 50, 95, 99, 100] {
                let rank = (sorted.len() * percent).div_ceil(100);
                let exact = f64::from(sorted[rank - 1]);
                let told = f64::from(histogram.percentile(percent as u32).unwrap());
                proptest::prop_assert!(exact <= told && told <= exact * 1.01, "{exact} {told}");
            }
        }
    }
}
