//! How far the normals of planar neighbourhoods scatter, and what that means for the reduction.

use super::Cells;
use crate::Result;
use crate::stage::Forecast;
use crate::tile::Tile;

pub(super) fn sample(_cells: &Cells, _tile: &mut Tile) -> Result<Vec<f64>> {
    Ok(Vec::new())
}

pub(super) fn forecast(_cells: &Cells, _samples: &[Vec<f64>]) -> Forecast {
    Forecast::default()
}
