//! Sums of floats that come out the same in any order. Knows no points.

use serde::{Deserialize, Serialize};

/// Bits behind the point of a [`FixedSum`].
const FRACTION: i32 = 64;
/// Binary exponent of the last bit of a normal f64 whose exponent field is 0.
const LAST_BIT: i32 = 1075;

/// A sum of figures ≥ 0, each rounded once to a multiple of 2^-64 and then added exactly, in 256
/// bits: any order and any split of the figures give the same sum.
///
/// Holds 2^64 figures below 2^128, and then stays at its largest value.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FixedSum {
    high: u128,
    low: u128,
}

impl FixedSum {
    /// The largest sum, where everything beyond ends.
    const FULL: FixedSum = FixedSum { high: u128::MAX, low: u128::MAX };

    /// Adds `figure` (finite, ≥ 0; its sign is not looked at) `times` times.
    pub fn add(&mut self, figure: f64, times: u32) {
        let bits = figure.to_bits();
        let field = (bits >> 52 & 0x7ff) as i32;
        let hidden = u64::from(field > 0) << 52;
        let mantissa = bits & ((1 << 52) - 1) | hidden;
        let shift = field.max(1) - LAST_BIT + FRACTION;
        let product = u128::from(rounded(mantissa, shift)) * u128::from(times);
        // A product has up to 85 bits: 43 more fit into 128.
        if shift <= 43 {
            self.plus(0, product << shift.max(0));
        } else if shift < 128 {
            self.plus(product >> (128 - shift), product << shift);
        } else if shift < 171 {
            self.plus(product << (shift - 128), 0);
        } else {
            *self = FixedSum::FULL;
        }
    }

    /// A figure in units of the last bit; None if that takes more than 96 bits.
    fn units(figure: f64) -> Option<u128> {
        let bits = figure.to_bits();
        let field = (bits >> 52 & 0x7ff) as i32;
        let hidden = u64::from(field > 0) << 52;
        let shift = field.max(1) - LAST_BIT + FRACTION;
        let mantissa = rounded(bits & ((1 << 52) - 1) | hidden, shift);
        (shift <= 43).then(|| u128::from(mantissa) << shift.max(0))
    }

    /// True if it is at its end.
    pub fn is_full(&self) -> bool {
        *self == FixedSum::FULL
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: &FixedSum) {
        self.plus(other.high, other.low);
    }

    /// Adds `last`, in units of the last bit, `times` times.
    fn plus_times(&mut self, last: u128, times: u32) {
        if times == 1 {
            return self.plus(0, last);
        }
        let upper = (last >> 64) * u128::from(times);
        self.plus(upper >> 64, upper << 64);
        self.plus(0, u128::from(last as u64) * u128::from(times));
    }

    fn plus(&mut self, high: u128, low: u128) {
        let (low, carry) = self.low.overflowing_add(low);
        let sum = self.high.checked_add(high).and_then(|h| h.checked_add(u128::from(carry)));
        *self = sum.map_or(FixedSum::FULL, |high| FixedSum { high, low });
    }

    /// The sum as an f64 near it, and another that is what it leaves.
    pub(super) fn parts(&self) -> [f64; 2] {
        let near = self.value();
        let mut sum = FixedSum::default();
        sum.add(near, 1);
        let is_above = (sum.high, sum.low) > (self.high, self.low);
        let (large, small) = if is_above { (&sum, self) } else { (self, &sum) };
        let (low, borrowed) = large.low.overflowing_sub(small.low);
        let high = large.high - small.high - u128::from(borrowed);
        let rest = FixedSum { high, low }.value();
        [near, if is_above { -rest } else { rest }]
    }

    /// The sum, rounded to f64 (relative error below 2^-51).
    pub fn value(&self) -> f64 {
        const TWO_64: f64 = (1u128 << 64) as f64;
        self.high as f64 * TWO_64 + self.low as f64 / TWO_64
    }
}

/// `mantissa` · 2^`shift` rounded half up where the shift is negative; else `mantissa` itself.
fn rounded(mantissa: u64, shift: i32) -> u64 {
    match shift {
        0.. => mantissa,
        -62..0 => (mantissa + (1 << (-shift - 1))) >> -shift,
        _ => 0,
    }
}

/// Figures for a [`FixedSum`] on the way there: up to 2^32 of them, added in fewer words.
#[derive(Debug, Default)]
pub(super) struct OpenSum(u128);

impl OpenSum {
    /// Adds `figure` once, to itself or, where it is too large, to `sum`.
    pub fn add(&mut self, figure: f64, sum: &mut FixedSum) {
        match FixedSum::units(figure) {
            Some(units) => self.0 += units,
            None => sum.add(figure, 1),
        }
    }

    /// Adds what it holds to `sum`.
    pub fn close(self, sum: &mut FixedSum) {
        sum.plus(0, self.0);
    }
}

/// Distances of records to a plane: their number, their sum and that of their squares. Each
/// distance is rounded to 2^-32 of a step first, so that positions on the plane have none.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Distances {
    count: u64,
    sum: FixedSum,
    squares: FixedSum,
}

impl Distances {
    /// Adds `copies` records at `distance` (any sign) in lattice steps.
    pub fn add(&mut self, distance: f64, copies: u32) {
        self.count += u64::from(copies);
        let distance = distance.abs();
        if distance < NEAR {
            let steps = u128::from(fine_steps(distance));
            self.sum.plus_times(steps << 32, copies);
            self.squares.plus_times(steps * steps, copies);
        } else {
            self.sum.add(distance, copies);
            self.squares.add(distance * distance, copies);
        }
    }

    /// Adds up to 2^24 distances, each with its copies.
    pub fn add_all(&mut self, distances: impl Iterator<Item = (f64, u32)>) {
        let (mut sum, mut squares) = (0, 0);
        for (distance, copies) in distances {
            if copies != 1 || distance.abs() >= NEAR {
                self.add(distance, copies);
                continue;
            }
            let steps = u128::from(fine_steps(distance.abs()));
            self.count += 1;
            // Below 2^51 and 2^102.
            sum += steps;
            squares += steps * steps;
        }
        self.sum.plus(0, sum << 32);
        self.squares.plus(0, squares);
    }

    /// Adds other distances.
    pub fn merge(&mut self, other: &Distances) {
        self.count += other.count;
        self.sum.merge(&other.sum);
        self.squares.merge(&other.squares);
    }

    /// Records.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// sqrt(Σd²/n) in lattice steps; None without records.
    pub fn rms(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.squares.value() / self.count as f64).sqrt())
    }

    /// Σ|d|/n in lattice steps; None without records.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum.value() / self.count as f64)
    }
}

/// Below this, a distance is a whole number of 2^-32 steps; beyond, an f64 has hardly finer digits.
const NEAR: f64 = (1u64 << 19) as f64;

/// A distance in 0..[`NEAR`] in units of 2^-32, rounded half to even.
fn fine_steps(distance: f64) -> u64 {
    // The last bit of an f64 from 2^20 to 2^21 is worth 2^-32, so that its mantissa is the answer.
    (distance + (1u64 << 20) as f64).to_bits() & ((1 << 52) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum_of(figures: &[f64]) -> FixedSum {
        let mut sum = FixedSum::default();
        figures.iter().for_each(|&f| sum.add(f, 1));
        sum
    }

    #[test]
    fn whole_figures_are_summed_exactly() {
        assert_eq!(sum_of(&[1.0, 2.0, 3.5]).value(), 6.5);
        let big = 2f64.powi(100);
        assert_eq!(sum_of(&[big, 0.5, big]).value(), 2.0 * big);
        let mut difference = sum_of(&[big, 0.5]);
        difference.merge(&sum_of(&[big]));
        assert_eq!(difference, sum_of(&[0.5, big, big]));
    }

    #[test]
    fn tiny_figures_round_to_the_nearest_step() {
        let step = 2f64.powi(-64);
        assert_eq!(sum_of(&[step]).value(), step);
        assert_eq!(sum_of(&[0.75 * step]).value(), step);
        assert_eq!(sum_of(&[0.25 * step]).value(), 0.0);
        assert_eq!(sum_of(&[f64::MIN_POSITIVE, f64::from_bits(1)]).value(), 0.0);
    }

    #[test]
    fn what_rounding_leaves_of_a_distance_of_zero_is_dropped() {
        let step = 2f64.powi(-32);
        for (distance, kept) in [
            (1e-16, 0.0),
            (-0.4 * step, 0.0),
            (0.6 * step, step),
            (-7.25, 7.25),
            (524_287.0 + step, 524_287.0 + step),
            (-524_288.0, 524_288.0),
            (2f64.powi(63), 2f64.powi(63)),
        ] {
            let mut distances = Distances::default();
            distances.add(distance, 3);
            assert_eq!(distances.mean(), Some(kept), "{distance}");
            let mut thrice = Distances::default();
            (0..3).for_each(|_| thrice.add(distance, 1));
            assert_eq!(distances, thrice);
        }
    }

    #[test]
    fn a_sum_that_is_full_stays_full_in_any_order() {
        let big = 2f64.powi(500);
        assert_eq!(sum_of(&[big, 1.0]), FixedSum::FULL);
        assert_eq!(sum_of(&[1.0, big]), FixedSum::FULL);
        let mut twice = FixedSum::FULL;
        twice.merge(&FixedSum::FULL);
        assert_eq!(twice, FixedSum::FULL);
    }

    proptest::proptest! {
        #[test]
        fn sums_of_many_are_those_of_each(
            figures in proptest::collection::vec((0f64..1.0, -90i32..70, 1u32..3), 0..50),
        ) {
            let figures = figures.iter().map(|&(f, e, n)| (f * 2f64.powi(e), n));
            let (mut each, mut all) = (Distances::default(), Distances::default());
            let (mut one_by_one, mut open, mut sum) =
                (FixedSum::default(), OpenSum::default(), FixedSum::default());
            for (figure, copies) in figures.clone() {
                each.add(-figure, copies);
                one_by_one.add(figure, 1);
                open.add(figure, &mut sum);
            }
            all.add_all(figures.map(|(figure, copies)| (-figure, copies)));
            open.close(&mut sum);
            proptest::prop_assert_eq!(each, all);
            proptest::prop_assert_eq!(one_by_one, sum);
        }

        #[test]
        fn one_add_is_the_rounded_figure(
            mantissa in 1f64..2.0, exponent in -11i32..127, times in 1u32..,
        ) {
            let figure = mantissa * 2f64.powi(exponent);
            let mut sum = FixedSum::default();
            sum.add(figure, 1);
            proptest::prop_assert_eq!(sum.value(), figure);
            let mut many = FixedSum::default();
            many.add(figure, times);
            let expected = figure * f64::from(times);
            proptest::prop_assert!((many.value() - expected).abs() <= expected * 2f64.powi(-51));
        }

        #[test]
        fn order_split_and_copies_change_no_bit(
            figures in proptest::collection::vec((0f64..1e12, -30i32..60), 1..40),
            cut in 0usize..40,
        ) {
            let figures: Vec<f64> = figures.iter().map(|(f, e)| f * 2f64.powi(*e)).collect();
            let whole = sum_of(&figures);
            let (a, b) = figures.split_at(cut.min(figures.len()));
            let mut merged = sum_of(&b.iter().rev().copied().collect::<Vec<_>>());
            merged.merge(&sum_of(a));
            proptest::prop_assert_eq!(merged, whole);
            let (mut thrice, mut once) = (FixedSum::default(), whole);
            figures.iter().for_each(|&f| thrice.add(f, 3));
            once.merge(&whole);
            once.merge(&whole);
            proptest::prop_assert_eq!(thrice, once);
        }
    }
}
