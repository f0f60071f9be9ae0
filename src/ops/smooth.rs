//! The stage `smooth`: every point goes to the mean or the median of its neighbourhood.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::lengths::Square;
use crate::point::{Position, SHIFT, Units, distance2, names};
use crate::quantity::{Length, Whole};
use crate::report::Tally;
use crate::stage::{Needs, Role, RoleName, ScanFacts, StageKind, StagePlace, TileOp};
use crate::tile::Tile;
use crate::{Error, Result};

/// Most neighbours that the stage takes.
const MOST: usize = 64;
const NEIGHBORS: Whole<1, { MOST as u64 }> = Whole::of(10);

/// The two filters for noise that the paper begins with: neighbourhood averaging, and the sliding
/// median.
///
/// A point's neighbourhood is its own position and the `neighbors` nearest others, copies not
/// counted. With `pick = "mean"` the point goes to the centre of mass of these; with
/// `pick = "median"` to the lower medians of their x, of their y and of their z. All are computed
/// from the positions that were read, whatever the order, and no point is removed.
///
/// "When a point is not too far from it" is `max_distance`: what would go farther stays where it
/// is, with all bytes of its record; the report counts it as `smooth_too_far`, what moved as
/// `smooth_moved`, by records. Means are rounded to whole steps of the lattice, half to even.
///
/// Moved records have their synthetic flag set where the format has one, and the columns `ShiftX`,
/// `ShiftY` and `ShiftZ`, which outputs can have by `write.dimensions`, tell how far they went (NaN
/// for points that the stage is not limited to). The report measures planes after the reduction
/// where points have gone. Stages that work on tiles work by the positions that were read, so none
/// stands behind this one: what it leaves is written, and a second run goes on from there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Smooth {
    /// How many nearest other positions are in a neighbourhood, 1 to 64.
    pub neighbors: Whole<1, { MOST as u64 }>,
    /// How far away they may be, a length above 0; none by default.
    pub within: Option<Length>,
    /// Where a point goes.
    pub pick: Average,
    /// How far a point may be moved, a length above 0; none by default.
    pub max_distance: Option<Length>,
    /// The two lengths in steps, once the lattice is known.
    #[serde(skip)]
    settled: Option<Settled>,
}

/// Where a point goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Average {
    /// To the centre of mass of its neighbourhood.
    #[default]
    Mean,
    /// To the lower medians of the x, of the y and of the z of its neighbourhood.
    Median,
}

/// The shift of what would go too far, until it is counted.
const TOO_FAR: [f64; 3] = [f64::INFINITY; 3];

/// What follows from the lattice.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Settled {
    within: u128,
    max_distance: u128,
    /// World units of a step.
    step: f64,
}

impl Default for Smooth {
    fn default() -> Self {
        Smooth {
            neighbors: NEIGHBORS,
            within: None,
            pick: Average::Mean,
            max_distance: None,
            settled: None,
        }
    }
}

impl StageKind for Smooth {
    const KIND: &'static str = "smooth";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Moves every point to the mean or the median of its neighbourhood.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::TileOp(Box::new(self)))
    }
}

impl TileOp for Smooth {
    fn needs(&self) -> Needs {
        let neighbors = self.neighbors.get() as usize;
        Needs::none().looks_at(names::XYZ).neighbors(neighbors).moves()
    }

    fn convert(&mut self, units: &Units) -> Result<()> {
        let lengths =
            [(&mut self.within, "smooth.within"), (&mut self.max_distance, "smooth.max_distance")];
        for (length, key) in lengths {
            *length = length.map(|length| length.in_scan(units, key)).transpose()?;
        }
        Ok(())
    }

    fn lengths(&self) -> Vec<(&'static str, Length)> {
        let lengths = [("smooth.within", self.within), ("smooth.max_distance", self.max_distance)];
        lengths.into_iter().filter_map(|(key, length)| Some((key, length?))).collect()
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        let step = scan.lattice.step;
        let square = |length: Length| Square::of(length.value() / step).at_most();
        let square = |length: Option<Length>| length.map_or(u128::MAX, square);
        let (within, max_distance) = (square(self.within), square(self.max_distance));
        self.settled = Some(Settled { within, max_distance, step });
        Ok(())
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let Settled { within, max_distance, step } = self
            .settled
            .ok_or_else(|| Error::internal("the stage smooth ran before it was settled"))?;
        let mut shifts = tile.columns.take(&SHIFT)?;
        shifts.fill([0.0; 3]);
        let mut hood = Vec::with_capacity(MOST + 1);
        tile.each_neighborhood(self.neighbors.get() as usize, |i, found| {
            hood.clear();
            hood.push([0; 3]);
            match within {
                u128::MAX => hood.extend_from_slice(found.offsets()),
                within => hood.extend_from_slice(found.within(within).offsets()),
            }
            let shift = self.pick.of(&mut hood);
            shifts[i] = match distance2([0; 3], shift) > max_distance {
                true => TOO_FAR,
                false => shift.map(|steps| steps as f64 * step),
            };
        })?;
        let (mut moved, mut too_far) = (0, 0);
        for (i, shift) in shifts.iter_mut().enumerate() {
            let records = if tile.core.contains(&i) { u64::from(tile.copies[i]) } else { 0 };
            if shift[0].is_infinite() {
                *shift = [0.0; 3];
                too_far += records;
            } else if *shift != [0.0; 3] {
                moved += records;
            }
        }
        tile.columns.put(shifts);
        tally.count("smooth_moved", moved);
        if self.max_distance.is_some() {
            tally.count("smooth_too_far", too_far);
        }
        Ok(())
    }
}

impl Average {
    /// Where a neighbourhood has its centre; `hood` has the offsets of all that is in it.
    fn of(self, hood: &mut [Position]) -> Position {
        let mut center = [0; 3];
        for (axis, center) in center.iter_mut().enumerate() {
            *center = match self {
                Average::Mean => {
                    let sum: i128 = hood.iter().map(|offset| i128::from(offset[axis])).sum();
                    rounded_mean(sum, hood.len() as i128)
                }
                Average::Median => {
                    let middle = (hood.len() - 1) / 2;
                    hood.select_nth_unstable_by_key(middle, |offset| offset[axis]).1[axis]
                }
            };
        }
        center
    }
}

/// A sum of positions over their number, rounded half to even.
pub(super) fn rounded_mean(sum: i128, count: i128) -> i64 {
    // Hardly any sum needs more than 64 bits, and those divide many times as fast.
    if let (Ok(sum), Ok(count)) = (i64::try_from(sum), i64::try_from(count)) {
        let (whole, rest) = (sum.div_euclid(count), sum.rem_euclid(count));
        let up = rest > count - rest || rest == count - rest && whole % 2 != 0;
        return whole + i64::from(up);
    }
    let (whole, twice) = (sum.div_euclid(count), 2 * sum.rem_euclid(count));
    let up = twice > count || twice == count && whole % 2 != 0;
    (whole + i128::from(up)) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shifts(stage: Smooth, positions: Vec<Position>) -> (Vec<[f64; 3]>, Tally) {
        let (mut tile, mut tally) = (Tile::of(positions), Tally::default());
        tile.columns.set(&SHIFT, &vec![[0.0; 3]; tile.positions.len()]);
        stage.run(&mut tile, &mut tally).unwrap();
        (tile.columns.get(&SHIFT).unwrap().to_vec(), tally)
    }

    fn settled(text: &str, max_distance: u128) -> Smooth {
        let settled = Some(Settled { within: u128::MAX, max_distance, step: 0.5 });
        Smooth { settled, ..toml::from_str(text).unwrap() }
    }

    #[test]
    fn means_are_rounded_half_to_even() {
        for (sum, count, mean) in
            [(5, 2, 2), (7, 2, 4), (-5, 2, -2), (-7, 2, -4), (8, 3, 3), (-8, 3, -3), (0, 7, 0)]
        {
            assert_eq!(rounded_mean(sum, count), mean, "{sum} / {count}");
            // The same with both so much larger that 64 bits do not hold them.
            assert_eq!(rounded_mean(sum << 70, count << 70), mean, "{sum} / {count}");
        }
    }

    #[test]
    fn a_point_goes_to_the_mean_or_the_median_or_stays() {
        let row = || vec![[0, 0, 0], [1, 0, 0], [2, 0, 30], [3, 0, 0]];
        let (mean, tally) = shifts(settled("neighbors = 3", u128::MAX), row());
        // The mean of all four is (1.5, 0, 7.5), rounded from each: steps of half a unit.
        assert_eq!(mean, [[1.0, 0.0, 4.0], [0.0, 0.0, 4.0], [0.0, 0.0, -11.0], [-1.0, 0.0, 4.0]]);
        assert_eq!(tally.counts["smooth_moved"], 4);
        let (near, tally) = shifts(settled("neighbors = 3\nmax_distance = 1", 100), row());
        assert_eq!(near[2], [0.0; 3], "22 steps are too far");
        assert_eq!((tally.counts["smooth_moved"], tally.counts["smooth_too_far"]), (3, 1));
        let (median, _) = shifts(settled("neighbors = 3\npick = 'median'", u128::MAX), row());
        assert_eq!(median[2], [-0.5, 0.0, -15.0]);
    }

    #[test]
    fn keys_out_of_bounds_are_refused() {
        assert_eq!(toml::from_str::<Smooth>("").unwrap(), Smooth::default());
        for wrong in
            ["neighbors = 0", "neighbors = 65", "pick = 'mode'", "max_distance = 0", "within = -1"]
        {
            assert!(toml::from_str::<Smooth>(wrong).is_err(), "{wrong}");
        }
    }
}
