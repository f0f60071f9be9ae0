//! What the numbers of a dimension come to: extremes, mean, deviation and a histogram, the same in
//! any order.
//!
//! A histogram needs its range before its first number, and one walk does not know it. So its bins
//! are as wide as a power of two, from multiples of it: when a number falls outside, neighbours are
//! joined, and a bin of the wider ones is exactly two of the narrower. The width in the end is a
//! function of the smallest and the largest number alone, whoever counted what first.

use std::collections::BTreeMap;
use std::ops::{Add, Mul, Sub};

use serde::{Deserialize, Serialize, Serializer};

use super::sums::FixedSum;

/// Bins that a histogram has at most: as many as there are classes.
pub const BINS: usize = 256;
/// Binary digits of a number that bins tell apart at most, so that their numbers fit in words.
const DIGITS: i32 = 40;
/// Exponent of the narrowest bins.
const NARROWEST: i32 = -1000;

/// Numbers as a dimension stores them: world value = stored · scale + origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Numbers<'a> {
    /// As they are stored.
    pub stored: &'a [f64],
    /// World units of a stored one.
    pub scale: f64,
    /// World value of a stored 0.
    pub origin: f64,
    /// True if all are whole and below 2^32.
    pub whole: bool,
}

/// What is counted of the numbers of a dimension. Numbers that are not finite are only counted.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct DimensionTally {
    count: u64,
    not_finite: u64,
    /// Smallest and largest world value; none without numbers.
    extremes: Option<FloatPair>,
    /// Scale and origin.
    units: FloatPair,
    /// Sums of whole numbers and of their squares.
    whole: [i128; 2],
    /// Sums of other numbers and of their squares: what is added, and what is taken away.
    sums: [FixedSum; 2],
    squares: [FixedSum; 2],
    bins: Bins,
}

/// Two floats, written down as their bits, since decimals may lose the last.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(into = "[u64; 2]", from = "[u64; 2]")]
struct FloatPair([f64; 2]);

impl From<FloatPair> for [u64; 2] {
    fn from(FloatPair(pair): FloatPair) -> Self {
        pair.map(f64::to_bits)
    }
}

impl From<[u64; 2]> for FloatPair {
    fn from(bits: [u64; 2]) -> Self {
        FloatPair(bits.map(f64::from_bits))
    }
}

/// What the numbers of a dimension come to, in world units.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DimensionFigures {
    /// Finite numbers.
    pub count: u64,
    /// Those that are not finite.
    pub not_finite: u64,
    /// The smallest; none without numbers.
    pub min: Option<f64>,
    /// The largest.
    pub max: Option<f64>,
    /// Their mean; none without numbers, or where one is so large that its square overflows.
    pub mean: Option<f64>,
    /// sqrt(Σ(v - mean)²/n); none likewise.
    pub deviation: Option<f64>,
    /// How they are spread.
    pub histogram: Option<Histogram>,
}

/// Counts of numbers in bins of one width, each from its lower end on, its upper end left out.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Histogram {
    /// Lower end of the first bin.
    pub from: f64,
    /// Width of a bin: a power of two.
    pub width: f64,
    /// How many numbers are in each.
    pub counts: Vec<u64>,
}

impl DimensionTally {
    /// Adds numbers of the dimension.
    pub fn add(&mut self, numbers: Numbers<'_>) {
        self.units = FloatPair([numbers.scale, numbers.origin]);
        let narrowest = if numbers.whole && numbers.scale == 1.0 { 0 } else { NARROWEST };
        let (mut sum, mut squares) = (0i128, 0i128);
        for &stored in numbers.stored {
            let world = stored * numbers.scale + numbers.origin;
            if !world.is_finite() {
                self.not_finite += 1;
                continue;
            }
            self.count += 1;
            let FloatPair([min, max]) = self.extremes.get_or_insert(FloatPair([world; 2]));
            (*min, *max) = (min.min(world), max.max(world));
            if numbers.whole {
                let stored = stored as i64;
                sum += i128::from(stored);
                squares += i128::from(stored) * i128::from(stored);
            } else {
                self.add_float(stored);
            }
            self.bins.add(world, narrowest);
        }
        self.whole[0] += sum;
        self.whole[1] += squares;
    }

    /// A square of two floats is the float nearest to it and what that leaves, exactly.
    fn add_float(&mut self, number: f64) {
        self.sums[usize::from(number < 0.0)].add(number, 1);
        let square = number * number;
        // What is infinite fills the sum, and nothing is said of it.
        self.squares[0].add(square, 1);
        if square.is_finite() {
            let rest = libm::fma(number, number, -square);
            self.squares[usize::from(rest < 0.0)].add(rest, 1);
        }
    }

    /// Adds what was counted of other numbers of the same dimension.
    pub fn merge(&mut self, other: &DimensionTally) {
        if other.count + other.not_finite == 0 {
            return;
        }
        self.units = other.units;
        self.count += other.count;
        self.not_finite += other.not_finite;
        let all = [self.extremes, other.extremes].into_iter().flatten();
        self.extremes =
            all.reduce(|FloatPair(a), FloatPair(b)| FloatPair([a[0].min(b[0]), a[1].max(b[1])]));
        for n in 0..2 {
            self.whole[n] += other.whole[n];
            self.sums[n].merge(&other.sums[n]);
            self.squares[n].merge(&other.squares[n]);
        }
        self.bins.merge(&other.bins);
    }

    /// What they come to.
    pub fn figures(&self) -> DimensionFigures {
        let (n, FloatPair([scale, origin])) = (self.count as f64, self.units);
        let extremes = self.extremes.map(|FloatPair(extremes)| extremes);
        let mut all = self.sums.iter().chain(&self.squares);
        let is_any = self.count > 0 && !all.any(FixedSum::is_full);
        let [sum, squares] = [(0, &self.sums), (1, &self.squares)].map(|(n, [plus, minus])| {
            // Sums of both kinds are never there at once.
            Twofold::of(self.whole[n]) + Twofold::of_sums(plus, minus)
        });
        let mean = sum.value() / n;
        let variance = (squares * n - sum * sum).value() / n / n;
        let deviation = variance.max(0.0).sqrt() * scale.abs();
        DimensionFigures {
            count: self.count,
            not_finite: self.not_finite,
            min: extremes.map(|[min, _]| min),
            max: extremes.map(|[_, max]| max),
            mean: is_any.then_some(mean * scale + origin),
            deviation: is_any.then_some(deviation),
            histogram: self.bins.histogram(),
        }
    }
}

/// What a stage counts of the points that come by.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct StatsTally {
    /// Points.
    pub points: u64,
    /// What is counted of each dimension, in the order in which they are asked for.
    pub dimensions: Vec<(String, DimensionTally)>,
    /// The same of the points of each class.
    pub classes: BTreeMap<u8, StatsTally>,
}

impl StatsTally {
    /// What is counted of the dimension that is number `number` of those that are asked for.
    pub fn dimension(&mut self, number: usize, name: &str) -> &mut DimensionTally {
        if number >= self.dimensions.len() {
            self.dimensions.push((name.to_owned(), DimensionTally::default()));
        }
        let at = number.min(self.dimensions.len() - 1);
        &mut self.dimensions[at].1
    }

    /// Adds what was counted of other points.
    pub fn merge(&mut self, other: &StatsTally) {
        self.points += other.points;
        for (number, (name, dimension)) in other.dimensions.iter().enumerate() {
            self.dimension(number, name).merge(dimension);
        }
        for (class, stats) in &other.classes {
            self.classes.entry(*class).or_default().merge(stats);
        }
    }

    /// What it comes to; `name` is that of the stage.
    pub fn figures(&self, name: &str) -> StatsFigures {
        let figures = |(name, tally): &(String, DimensionTally)| (name.clone(), tally.figures());
        let class = |(class, stats): (&u8, &StatsTally)| (*class, stats.figures(""));
        StatsFigures {
            name: name.to_owned(),
            points: self.points,
            dimensions: self.dimensions.iter().map(figures).collect(),
            classes: self.classes.iter().map(class).collect(),
        }
    }
}

/// What a stage counted of the points that came by.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct StatsFigures {
    /// The name of the stage, or its kind where it has none.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Points.
    pub points: u64,
    /// By dimension.
    #[serde(serialize_with = "by_name", skip_serializing_if = "Vec::is_empty")]
    pub dimensions: Vec<(String, DimensionFigures)>,
    /// Of the points of each class, where that was asked for.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub classes: BTreeMap<u8, StatsFigures>,
}

fn by_name<S: Serializer>(
    dimensions: &[(String, DimensionFigures)],
    into: S,
) -> Result<S::Ok, S::Error> {
    into.collect_map(dimensions.iter().map(|(name, figures)| (name, figures)))
}

/// Counts of numbers in bins of 2^`exponent`, the first of which begins at its `first` multiple.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
struct Bins {
    exponent: i32,
    first: i64,
    counts: Vec<u64>,
}

/// 2^`exponent`, for exponents of normal numbers.
fn power(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

impl Bins {
    /// Adds a finite number; bins of whole numbers are no narrower than 2^`narrowest`.
    fn add(&mut self, number: f64, narrowest: i32) {
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
            let at = ((self.first + n as i64 >> by) - first) as usize;
            if at >= counts.len() {
                counts.resize(at + 1, 0);
            }
            counts[at] += count;
        }
        (self.exponent, self.first, self.counts) = (exponent, first, counts);
    }

    fn merge(&mut self, other: &Bins) {
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

    fn histogram(&self) -> Option<Histogram> {
        let width = power(self.exponent);
        let from = self.first as f64 * width;
        let counts = self.counts.clone();
        (!counts.is_empty()).then_some(Histogram { from, width, counts })
    }
}

/// A number as the sum of two floats, the second of which is what the first leaves: the difference
/// of two squares of large numbers keeps the digits that it is about.
#[derive(Debug, Clone, Copy)]
struct Twofold(f64, f64);

impl Twofold {
    fn of(whole: i128) -> Twofold {
        let near = whole as f64;
        Twofold(near, (whole - near as i128) as f64)
    }

    fn of_sums(plus: &FixedSum, minus: &FixedSum) -> Twofold {
        let [plus, minus] = [plus, minus].map(FixedSum::parts).map(|[a, b]| Twofold(a, b));
        plus - minus
    }

    fn value(self) -> f64 {
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn floats(stored: &[f64]) -> Numbers<'_> {
        Numbers { stored, scale: 1.0, origin: 0.0, whole: false }
    }

    fn tally(numbers: Numbers<'_>) -> DimensionTally {
        let mut tally = DimensionTally::default();
        tally.add(numbers);
        tally
    }

    #[test]
    fn the_figures_are_those_of_the_numbers() {
        let stored: Vec<f64> = (0..1000).map(|n| f64::from(n % 10)).collect();
        let figures =
            tally(Numbers { stored: &stored, scale: 0.5, origin: 100.0, whole: true }).figures();
        assert_eq!((figures.min, figures.max), (Some(100.0), Some(104.5)));
        assert_eq!(figures.mean, Some(102.25));
        assert!((figures.deviation.unwrap() - 8.25f64.sqrt() / 2.0).abs() < 1e-15);
        let Histogram { from, width, counts } = figures.histogram.unwrap();
        assert_eq!(counts.iter().sum::<u64>(), 1000);
        assert_eq!(from + width * (counts.len() as f64 - 1.0), 104.5, "the last bin");
        let classes =
            tally(Numbers { stored: &[2.0, 6.0, 2.0], scale: 1.0, origin: 0.0, whole: true });
        let Histogram { from, width, counts } = classes.figures().histogram.unwrap();
        assert_eq!((from, width, counts), (2.0, 1.0, vec![2, 0, 0, 0, 1]));
    }

    #[test]
    fn small_deviations_far_from_zero_keep_their_digits() {
        // A northing in metres, a hair's breadth apart.
        let stored: Vec<f64> =
            (0..2000).map(|n| 4_812_345.5 + f64::from(n % 2) * 2f64.powi(-20)).collect();
        let figures = tally(floats(&stored)).figures();
        let half = 2f64.powi(-21);
        assert!((figures.deviation.unwrap() / half - 1.0).abs() < 1e-9, "{figures:?}");
        let negative: Vec<f64> = stored.iter().map(|v| -v).collect();
        let mirrored = tally(floats(&negative)).figures();
        assert_eq!(mirrored.deviation, figures.deviation);
        assert_eq!(mirrored.mean, figures.mean.map(|mean| -mean));
    }

    #[test]
    fn what_is_not_finite_is_only_counted() {
        let figures = tally(floats(&[f64::NAN, 1.0, f64::INFINITY])).figures();
        assert_eq!((figures.count, figures.not_finite), (1, 2));
        assert_eq!(
            (figures.min, figures.max, figures.deviation),
            (Some(1.0), Some(1.0), Some(0.0))
        );
        let none = tally(floats(&[])).figures();
        assert_eq!((none.count, none.mean, none.histogram), (0, None, None));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]
        #[test]
        fn order_and_split_change_nothing(
            numbers in prop::collection::vec(
                prop_oneof![
                    -1e3..1e3f64, Just(0.0), Just(1e-300), -1e300..1e300f64,
                    (-300i32..300).prop_map(f64::from), Just(f64::NAN),
                ],
                1..60,
            ),
            cuts in prop::collection::vec(0usize..60, 2),
        ) {
            let whole = tally(floats(&numbers));
            let [a, b] = [cuts[0].min(numbers.len()), cuts[1].min(numbers.len())];
            let (low, high) = (a.min(b), a.max(b));
            let mut merged = DimensionTally::default();
            for part in [&numbers[high..], &numbers[..low], &numbers[low..high]] {
                let reversed: Vec<f64> = part.iter().rev().copied().collect();
                merged.merge(&tally(floats(&reversed)));
            }
            prop_assert_eq!(&merged, &whole);
            let counted: u64 = whole.bins.counts.iter().sum();
            prop_assert_eq!(counted, whole.count);
            prop_assert!(whole.bins.counts.len() <= BINS);
            if let Some(FloatPair([min, _])) = whole.extremes {
                prop_assert!(whole.bins.counts[0] > 0 && *whole.bins.counts.last().unwrap() > 0);
                let width = power(whole.bins.exponent);
                prop_assert_eq!((min / width).floor() * width, whole.bins.first as f64 * width);
            }
            let written = serde_json::to_string(&whole).unwrap();
            prop_assert_eq!(serde_json::from_str::<DimensionTally>(&written).unwrap(), whole);
        }
    }
}
