//! What is told of a neighbourhood besides its normal.

use super::estimate::SurfaceShape;
use crate::Result;
use crate::point::{Column, TakenColumn};
use crate::stage::Needs;
use crate::tile::Tile;

/// The least eigenvalue of the covariance of a position and its neighbours, divided by the sum of
/// all three (the surface variation of Pauly, Gross and Kobbelt, Efficient Simplification of
/// Point-Sampled Surfaces, 2002): 0 of a plane, 1/3 at most. NaN where there is no normal.
const CURVATURE: Column<f32> = Column::new("Curvature", &[]).computed_by("normals");
/// Root mean square of the distances of a position and its neighbours to the fitted surface, in
/// world units. NaN where there is no normal.
const RESIDUAL: Column<f32> = Column::new("Residual", &[]).computed_by("normals");

/// Which of these columns are asked for.
#[derive(Debug, Clone, Copy)]
pub(super) struct AskedShapes {
    pub curvature: bool,
    pub residual: bool,
}

impl AskedShapes {
    /// Declares them.
    pub fn needs(self, needs: Needs) -> Needs {
        let needs = if self.curvature { needs.writes(&CURVATURE) } else { needs };
        if self.residual { needs.writes(&RESIDUAL) } else { needs }
    }

    /// Takes them out of `tile`; none if none is asked for.
    pub fn take(self, tile: &mut Tile) -> Result<Option<ShapeColumns>> {
        let mut take = |asked: bool, column: &Column<f32>| {
            asked.then(|| tile.columns.take(column)).transpose()
        };
        let curvature = take(self.curvature, &CURVATURE)?;
        let residual = take(self.residual, &RESIDUAL)?;
        let is_asked = curvature.is_some() || residual.is_some();
        Ok(is_asked.then_some(ShapeColumns { curvature, residual }))
    }
}

/// These columns, while they are computed.
pub(super) struct ShapeColumns {
    curvature: Option<TakenColumn<f32>>,
    residual: Option<TakenColumn<f32>>,
}

impl ShapeColumns {
    /// Enters those of position `i`, where a step of the lattice is `step` long.
    pub fn enter(&mut self, i: usize, shape: SurfaceShape, step: f64) {
        if let Some(curvature) = &mut self.curvature {
            curvature[i] = shape.curvature as f32;
        }
        if let Some(residual) = &mut self.residual {
            residual[i] = (shape.residual * step) as f32;
        }
    }

    /// Puts them back into the tile.
    pub fn put(self, tile: &mut Tile) {
        for column in [self.curvature, self.residual].into_iter().flatten() {
            tile.columns.put(column);
        }
    }
}
