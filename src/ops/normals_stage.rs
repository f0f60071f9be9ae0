//! The stage `normals` on tiles.

use super::normals::{Estimate, Estimator, Fallback, Normals};
use crate::Result;
use crate::report::Tally;
use crate::stage::{Needs, TileOp};
use crate::tile::Tile;

/// Positions in the core without a normal.
pub const NO_NORMAL: &str = "no_normal";
/// Positions in the core where `pca` stood in because the star had no triangle.
pub const FALLBACK_NO_TRIANGLE: &str = "fallback_no_triangle";
/// Positions in the core where `pca` stood in because the first estimate lay in the plane.
pub const FALLBACK_PERPENDICULAR: &str = "fallback_perpendicular";

impl TileOp for Normals {
    fn needs(&self) -> Needs {
        Needs {
            reads: vec!["X".into(), "Y".into(), "Z".into()],
            writes: vec!["Normal".into()],
            neighbors: self.neighbors,
            bytes_per_point: size_of::<[f32; 3]>(),
            ..Needs::default()
        }
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let mut estimator = Estimator::new(self.method);
        // The column is out of the tile while the tile hands out neighbourhoods.
        let mut normals = std::mem::take(&mut tile.normals);
        normals.clear();
        normals.resize(tile.positions.len(), [f32::NAN; 3]);
        let core = tile.core.clone();
        let (mut none, mut no_triangle, mut perpendicular) = (0, 0, 0);
        tile.each_neighborhood(self.neighbors, |i, offsets| {
            let (estimate, fallback) = estimator.estimate(offsets);
            if let Estimate::Normal(normal) = estimate {
                normals[i] = normal;
            }
            if core.contains(&i) {
                none += u64::from(estimate == Estimate::None);
                no_triangle += u64::from(fallback == Some(Fallback::NoTriangle));
                perpendicular += u64::from(fallback == Some(Fallback::Perpendicular));
            }
        })?;
        tile.normals = normals;
        tally.count(NO_NORMAL, none);
        tally.count(FALLBACK_NO_TRIANGLE, no_triangle);
        tally.count(FALLBACK_PERPENDICULAR, perpendicular);
        Ok(())
    }
}
