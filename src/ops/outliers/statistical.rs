//! Outliers by the mean distance to their neighbours, against mean and σ of the whole scan: two
//! phases.

use serde_json::Value;

use super::super::removal::{RemovalAccount, remove};
use super::neighbors::checked;
use crate::geom::wide::Wide;
use crate::point::{Column, Mark, Position, distance2, names};
use crate::report::Tally;
use crate::stage::{Gathered, Needs, ScanFacts, ScanOp, Summary, TileOp};
use crate::tile::Tile;
use crate::{Error, Result};

/// Units of a figure in a lattice step: 2^16. A figure below 2^63 steps and its square then stay
/// whole numbers that are summed exactly.
const UNITS: f64 = 65_536.0;

/// Mean distance of a position to its neighbours in lattice steps; NaN where it has none.
const MEAN_DISTANCE: Column<f64> = Column::new("MeanDistance", &[]);

/// `outliers` by statistics of the scan.
#[derive(Debug, Clone)]
pub struct StatisticalOutliers {
    neighbors: usize,
    multiplier: f64,
    mark: Option<Mark>,
    /// World units of a lattice step.
    step: f64,
    concluded: Option<Conclusion>,
}

impl StatisticalOutliers {
    /// Outliers are what is farther from its `neighbors` (1 to 64) nearest than the scan's mean and
    /// `multiplier` (0 or more) times its σ.
    ///
    /// # Errors
    ///
    /// A number out of bounds, with the key to blame.
    pub fn new(
        neighbors: usize,
        multiplier: f64,
        mark: Option<Mark>,
    ) -> Result<Self, (&'static str, Error)> {
        let neighbors = checked("neighbors", neighbors)?;
        if !(multiplier.is_finite() && multiplier >= 0.0) {
            let told = format!("`outliers.multiplier` must be a number from 0, not {multiplier}");
            return Err(("multiplier", Error::pipeline(told)));
        }
        Ok(StatisticalOutliers { neighbors, multiplier, mark, step: 1.0, concluded: None })
    }
}

impl TileOp for StatisticalOutliers {
    fn needs(&self) -> Needs {
        Needs::none().reads(&MEAN_DISTANCE).removes(self.mark)
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        self.step = scan.lattice.step;
        Ok(())
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let concluded = self.concluded.ok_or_else(|| {
            Error::internal("the stage outliers ran before its threshold was known")
        })?;
        let mut records = 0;
        let figures = tile.columns.take(&MEAN_DISTANCE)?;
        for i in tile.core.clone() {
            if tile.is_chosen(i) && units(figures[i]).is_some_and(|u| u > concluded.most) {
                records += remove(tile, i);
            }
        }
        tile.columns.put(figures);
        RemovalAccount::of_outliers(self.mark).enter(tally, "outlier", records);
        Ok(())
    }

    fn decisions(&self) -> Vec<(String, Value)> {
        self.concluded.map_or(Vec::new(), |concluded| {
            let named = [
                ("mean_distance", concluded.mean),
                ("sigma", concluded.sigma),
                ("threshold", concluded.threshold),
            ];
            named.map(|(name, v)| (name.to_owned(), (v / UNITS * self.step).into())).to_vec()
        })
    }
}

impl ScanOp for StatisticalOutliers {
    type Summary = Sums;

    fn gather_needs(&self) -> Needs {
        Needs::none().looks_at(names::XYZ).writes(&MEAN_DISTANCE).neighbors(self.neighbors)
    }

    fn gather(&self, tile: &mut Tile, _: &mut Tally) -> Result<Sums> {
        let mut figures = tile.columns.take(&MEAN_DISTANCE)?;
        tile.each_neighborhood(self.neighbors, |i, neighbors| {
            figures[i] = figure(neighbors.offsets());
        })?;
        let mut sums = Sums::default();
        for i in tile.core.clone() {
            match units(figures[i]) {
                Some(units) if tile.is_chosen(i) => sums.add(units),
                _ => figures[i] = f64::NAN,
            }
        }
        tile.columns.put(figures);
        Ok(sums)
    }

    fn conclude(&mut self, gathered: &dyn Gathered<Sums>) -> Result<Option<String>> {
        let mut sums = Sums::default();
        gathered.each(&mut |tile| {
            sums.merge(&tile);
            Ok(())
        })?;
        self.concluded = Some(Conclusion::of(&sums, self.multiplier));
        Ok(None)
    }
}

/// Mean length of `offsets` in steps, rounded half to even to whole [`UNITS`]; NaN if there are
/// none.
fn figure(offsets: &[Position]) -> f64 {
    let sum = offsets.iter().fold(0.0, |sum, &o| sum + (distance2([0; 3], o) as f64).sqrt());
    (sum / offsets.len() as f64 * UNITS).round_ties_even() / UNITS
}

/// A figure in whole [`UNITS`]; none if it is NaN.
fn units(figure: f64) -> Option<u128> {
    figure.is_finite().then_some((figure * UNITS) as u128)
}

/// Number of figures, their sum and that of their squares, in [`UNITS`].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sums {
    count: u64,
    sum: u128,
    squares: Wide,
}

impl Sums {
    fn add(&mut self, units: u128) {
        self.count += 1;
        self.sum = self.sum.saturating_add(units);
        self.squares = self.squares.plus(Wide::square(units));
    }

    fn merge(&mut self, other: &Sums) {
        self.count = self.count.saturating_add(other.count);
        self.sum = self.sum.saturating_add(other.sum);
        self.squares = self.squares.plus(other.squares);
    }
}

impl Summary for Sums {
    fn store(&self, bytes: &mut Vec<u8>) {
        let [a, b, c, d] = self.squares.words();
        let words = [self.count, self.sum as u64, (self.sum >> 64) as u64, a, b, c, d];
        bytes.extend_from_slice(bytemuck::bytes_of(&words));
    }

    fn load(bytes: &[u8]) -> Result<Sums> {
        let words = bytemuck::try_pod_read_unaligned::<[u64; 7]>(bytes);
        let cut_off = |_| Error::internal("the sums that outliers gathered are cut off");
        let [count, low, high, a, b, c, d] = words.map_err(cut_off)?;
        let sum = u128::from(low) | u128::from(high) << 64;
        Ok(Sums { count, sum, squares: Wide::of_words([a, b, c, d]) })
    }
}

/// What the second phase decides by, in [`UNITS`].
#[derive(Debug, Clone, Copy, PartialEq)]
struct Conclusion {
    /// The largest figure that stays.
    most: u128,
    mean: f64,
    sigma: f64,
    threshold: f64,
}

impl Conclusion {
    /// The mean is a whole number and a remainder, so that equal figures are never above it,
    /// however large: only what is above the whole number is rounded.
    fn of(sums: &Sums, multiplier: f64) -> Conclusion {
        let count = u128::from(sums.count.max(1));
        let (sum, n) = (sums.sum, count as f64);
        // n²σ² = n·Σd² − (Σd)²: no digit is lost where σ is small beside the mean.
        let variance = sums.squares.times(sums.count).minus(Wide::square(sum));
        let sigma = variance.value().sqrt() / n;
        let (whole, rest) = (sum / count, (sum % count) as f64 / n);
        let above = rest + multiplier * sigma;
        Conclusion {
            most: whole.saturating_add(above as u128),
            mean: whole as f64 + rest,
            sigma,
            threshold: whole as f64 + above,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sums(figures: &[u128]) -> Sums {
        let mut sums = Sums::default();
        figures.iter().for_each(|&f| sums.add(f));
        sums
    }

    #[test]
    fn equal_figures_have_no_outlier_however_large() {
        for figure in [0, 1, 3, (1 << 53) + 1, (1 << 79) + 12_345] {
            for count in [1, 3, 7, 1000] {
                for multiplier in [0.0, 2.0] {
                    let concluded = Conclusion::of(&sums(&vec![figure; count]), multiplier);
                    assert_eq!((concluded.most, concluded.sigma), (figure, 0.0));
                }
            }
        }
        let one_above = Conclusion::of(&sums(&[(1 << 60) + 1, 1 << 60]), 0.0);
        assert_eq!(one_above.most, 1 << 60, "the larger one is above the mean");
    }

    #[test]
    fn mean_and_sigma_are_those_of_the_population() {
        let concluded = Conclusion::of(&sums(&[2, 4, 4, 4, 5, 5, 7, 9]), 1.5);
        assert_eq!((concluded.mean, concluded.sigma, concluded.threshold), (5.0, 2.0, 8.0));
        assert_eq!(concluded.most, 8);
        let none = Conclusion::of(&Sums::default(), 2.0);
        assert_eq!((none.mean, none.sigma), (0.0, 0.0));
    }

    #[test]
    fn a_figure_is_the_mean_distance_in_small_whole_units() {
        assert_eq!(figure(&[[3, 4, 0], [0, 0, 2]]), 3.5);
        let third = figure(&[[1, 0, 0], [1, 0, 0], [2, 0, 0]]);
        assert_eq!(third, 87381.0 / 65536.0);
        assert_eq!(units(third), Some(87381));
        assert!(figure(&[]).is_nan());
        assert_eq!(units(f64::NAN), None);
        assert_eq!(units(figure(&[[i64::MAX, 0, 0]])), Some(1 << 79));
    }

    proptest::proptest! {
        #[test]
        fn sums_come_back_however_they_are_split(
            figures in proptest::collection::vec(0u128..1 << 80, 0..40), cut in 0usize..40,
        ) {
            let whole = sums(&figures);
            let (a, b) = figures.split_at(cut.min(figures.len()));
            let stored = |part: &[u128]| {
                let mut bytes = Vec::new();
                sums(part).store(&mut bytes);
                Sums::load(&bytes).unwrap()
            };
            let mut merged = stored(b);
            merged.merge(&stored(a));
            proptest::prop_assert_eq!(merged, whole);
        }
    }
}
