//! Outliers by the mean distance to their neighbours, against mean and σ of the whole scan: two
//! phases.

use serde_json::Value;

use super::super::removal::{RemovalAccount, remove};
use super::neighbors::checked;
use crate::geom::wide::Wide;
use crate::point::{Mark, Position, distance2, names};
use crate::report::Tally;
use crate::stage::{Gathered, Needs, ScanFacts, ScanOp, TileOp};
use crate::tile::Tile;
use crate::{Error, Result};

/// Units of a figure in a lattice step: 2^16. A figure below 2^63 steps and its square then stay
/// whole numbers that are summed exactly.
const UNITS: f64 = 65_536.0;

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
        Needs {
            reads: vec!["Figure".into()],
            removes: self.mark.is_none(),
            mark: self.mark,
            ..Needs::default()
        }
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        self.step = scan.lattice.step;
        Ok(())
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let concluded = self.concluded.ok_or_else(|| {
            Error::internal("the stage outliers ran before its threshold was known")
        })?;
        if tile.figures.len() != tile.positions.len() {
            return Err(Error::internal("the figures of a tile are not as many as its positions"));
        }
        let mut records = 0;
        for i in tile.core.clone() {
            if tile.is_chosen(i) && units(tile.figures[i]).is_some_and(|u| u > concluded.most) {
                records += remove(tile, i);
            }
        }
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
    fn gather_needs(&self) -> Needs {
        Needs {
            reads: names::XYZ.map(str::to_owned).to_vec(),
            writes: vec!["Figure".into()],
            neighbors: self.neighbors,
            bytes_per_point: size_of::<f64>(),
            ..Needs::default()
        }
    }

    fn gather(&self, tile: &mut Tile, found: &mut Vec<[u64; 2]>, _: &mut Tally) -> Result<()> {
        let mut figures = std::mem::take(&mut tile.figures);
        figures.clear();
        figures.resize(tile.positions.len(), f64::NAN);
        let outcome = tile.each_neighborhood(self.neighbors, |i, neighbors| {
            figures[i] = figure(neighbors.offsets());
        });
        tile.figures = figures;
        outcome?;
        let mut sums = Sums::default();
        for i in tile.core.clone() {
            match units(tile.figures[i]) {
                Some(units) if tile.is_chosen(i) => sums.add(units),
                _ => tile.figures[i] = f64::NAN,
            }
        }
        found.extend(sums.rows());
        Ok(())
    }

    fn conclude(&mut self, found: &dyn Gathered) -> Result<Option<String>> {
        let mut sums = Sums::default();
        let (mut rows, mut filled) = ([[0; 2]; Sums::ROWS], 0);
        found.each(&mut |stretch| {
            for &row in stretch {
                rows[filled] = row;
                filled += 1;
                if filled == Sums::ROWS {
                    sums.merge(&Sums::of_rows(rows));
                    filled = 0;
                }
            }
            Ok(())
        })?;
        if filled > 0 {
            return Err(Error::internal("the sums that outliers gathered are cut off"));
        }
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
struct Sums {
    count: u64,
    sum: u128,
    squares: Wide,
}

impl Sums {
    /// Rows that hold them.
    const ROWS: usize = 4;

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

    fn rows(&self) -> [[u64; 2]; Sums::ROWS] {
        let [a, b, c, d] = self.squares.words();
        [[self.count, 0], [self.sum as u64, (self.sum >> 64) as u64], [a, b], [c, d]]
    }

    fn of_rows([[count, _], [low, high], [a, b], [c, d]]: [[u64; 2]; Sums::ROWS]) -> Sums {
        let sum = u128::from(low) | u128::from(high) << 64;
        Sums { count, sum, squares: Wide::of_words([a, b, c, d]) }
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
        fn rows_hold_the_sums_however_they_are_split(
            figures in proptest::collection::vec(0u128..1 << 80, 0..40), cut in 0usize..40,
        ) {
            let whole = sums(&figures);
            let (a, b) = figures.split_at(cut.min(figures.len()));
            let mut merged = Sums::of_rows(sums(b).rows());
            merged.merge(&Sums::of_rows(sums(a).rows()));
            proptest::prop_assert_eq!(merged, whole);
        }
    }
}
