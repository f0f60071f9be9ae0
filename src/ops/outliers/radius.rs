//! Outliers with too few neighbours within a radius: a tile at a time.

use super::super::lengths::Square;
use super::super::removal::{RemovalAccount, remove};
use super::neighbors::checked;
use crate::point::{Mark, Units, distance2, names};
use crate::quantity::Length;
use crate::report::Tally;
use crate::stage::{Needs, ScanFacts, TileOp};
use crate::tile::Tile;
use crate::{Error, Result};

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

impl TileOp for RadiusOutliers {
    fn needs(&self) -> Needs {
        let looks = Needs::none().looks_at(names::XYZ).neighbors(self.min_neighbors);
        looks.bytes_per_point(size_of::<bool>()).removes(self.mark)
    }

    fn convert(&mut self, units: &Units) -> Result<()> {
        self.radius = self.radius.in_scan(units, "outliers.radius")?;
        Ok(())
    }

    fn lengths(&self) -> Vec<(&'static str, Length)> {
        vec![("outliers.radius", self.radius)]
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        self.within = Some(Square::of(self.radius.value() / scan.lattice.step).at_most());
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
