//! Outliers with too few neighbours within a radius: a tile at a time.

use super::super::removal::{RemovalAccount, remove};
use super::neighbors::checked;
use crate::point::{Mark, Units, distance2, names};
use crate::quantity::Length;
use crate::report::Tally;
use crate::stage::{Needs, ScanFacts, TileOp};
use crate::tile::Tile;
use crate::{Error, Result};

/// A radius that differs from whole steps by less than this part of it is whole: decimals are
/// seldom exact in binary, and who asks for 0.3 means three steps of 0.1.
const WHOLE: f64 = 1e-9;

/// `outliers` by radius.
#[derive(Debug, Clone)]
pub struct RadiusOutliers {
    radius: Length,
    min_neighbors: usize,
    mark: Option<Mark>,
    /// The largest squared distance within the radius, in steps; settled by the scan's lattice.
    within: Option<u128>,
}

impl RadiusOutliers {
    /// Outliers are what has fewer than `min_neighbors` (1 to 64) other positions within `radius`.
    ///
    /// # Errors
    ///
    /// A number out of bounds, with the key to blame.
    pub fn new(
        radius: Length,
        min_neighbors: usize,
        mark: Option<Mark>,
    ) -> Result<Self, (&'static str, Error)> {
        let min_neighbors = checked("min_neighbors", min_neighbors)?;
        Ok(RadiusOutliers { radius, min_neighbors, mark, within: None })
    }
}

/// The largest whole squared distance that is at most `steps`².
fn square(steps: f64) -> u128 {
    let whole = steps.round();
    if (steps - whole).abs() <= WHOLE * whole {
        let whole = whole as u128;
        whole.saturating_mul(whole)
    } else {
        (steps * steps) as u128
    }
}

impl TileOp for RadiusOutliers {
    fn needs(&self) -> Needs {
        let looks = Needs::none().looks_at(names::XYZ).neighbors(self.min_neighbors);
        looks.bytes_per_point(size_of::<bool>()).removes(self.mark)
    }

    fn convert(&mut self, units: &Units) -> Result<()> {
        self.radius = self.radius.in_scan(units, "outliers.radius")?;
        Ok(())
    }

    fn lengths(&self) -> Vec<(&'static str, f64)> {
        vec![("outliers.radius", self.radius.value())]
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        self.within = Some(square(self.radius.value() / scan.lattice.step));
        Ok(())
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let within = self.within.ok_or_else(|| {
            Error::internal("the stage outliers ran before its radius was settled")
        })?;
        let mut lonely = vec![false; tile.positions.len()];
        tile.each_neighborhood(self.min_neighbors, |i, neighbors| {
            let near =
                neighbors.offsets().iter().filter(|o| distance2([0; 3], **o) <= within).count();
            lonely[i] = near < self.min_neighbors;
        })?;
        let mut records = 0;
        for i in tile.core.clone() {
            if lonely[i] && tile.is_chosen(i) {
                records += remove(tile, i);
            }
        }
        RemovalAccount::of_outliers(self.mark).enter(tally, "outlier", records);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_radius_of_whole_steps_is_whole_despite_binary_fractions() {
        // 0.3 / 0.1 is less than 3: rounding would lose the points at 0.3.
        assert_eq!(square(0.3 / 0.1), 9);
        assert_eq!(square(2.5), 6);
        assert_eq!(square(0.4), 0);
        assert_eq!(square(0.999_999), 0);
        assert_eq!(square(1e15), 10u128.pow(30), "exact beyond the digits of a float");
        assert_eq!(square(1e30), u128::MAX);
        assert_eq!(square(f64::INFINITY), u128::MAX);
    }
}
