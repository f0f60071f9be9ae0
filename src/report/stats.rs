//! What the numbers of a dimension come to: extremes, mean, deviation and a histogram, the same in
//! any order.

mod bins;
mod twofold;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize, Serializer};

use super::sums::FixedSum;
use bins::{Bins, NARROWEST};

pub use bins::DimensionHistogram;
use twofold::Twofold;

/// Numbers as a dimension stores them: world value = stored · scale + origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StoredNumbers<'a> {
    /// As they are stored.
    pub stored: &'a [f64],
    /// World units of a stored one.
    pub scale: f64,
    /// World value of a stored 0.
    pub origin: f64,
    /// True if all are whole and below 2^32.
    pub whole: bool,
}

/// What is counted of the numbers of a dimension; those that are not finite are only counted.
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
    pub histogram: Option<DimensionHistogram>,
}

impl DimensionTally {
    /// Adds numbers of the dimension.
    pub fn add(&mut self, numbers: StoredNumbers<'_>) {
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::bins::{BINS, power};
    use super::*;

    fn floats(stored: &[f64]) -> StoredNumbers<'_> {
        StoredNumbers { stored, scale: 1.0, origin: 0.0, whole: false }
    }

    fn tally(numbers: StoredNumbers<'_>) -> DimensionTally {
        let mut tally = DimensionTally::default();
        tally.add(numbers);
        tally
    }

    #[test]
    fn the_figures_are_those_of_the_numbers() {
        let stored: Vec<f64> = (0..1000).map(|n| f64::from(n % 10)).collect();
        let figures =
            tally(StoredNumbers { stored: &stored, scale: 0.5, origin: 100.0, whole: true })
                .figures();
        assert_eq!((figures.min, figures.max), (Some(100.0), Some(104.5)));
        assert_eq!(figures.mean, Some(102.25));
        assert!((figures.deviation.unwrap() - 8.25f64.sqrt() / 2.0).abs() < 1e-15);
        let DimensionHistogram { from, width, counts } = figures.histogram.unwrap();
        assert_eq!(counts.iter().sum::<u64>(), 1000);
        assert_eq!(from + width * (counts.len() as f64 - 1.0), 104.5, "the last bin");
        let classes =
            tally(StoredNumbers { stored: &[2.0, 6.0, 2.0], scale: 1.0, origin: 0.0, whole: true });
        let DimensionHistogram { from, width, counts } = classes.figures().histogram.unwrap();
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
