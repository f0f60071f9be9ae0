//! How many neighbours a normal takes where the noise of the scan decides.

use super::Normals;
use crate::Result;
use crate::ops::scatter::{SMOOTH, scatter, typical};
use crate::quantity::Setting;
use crate::report::Tally;
use crate::stage::{Forecast, TileOp};
use crate::tile::Tile;

/// Neighbours that the noise is measured with: those of the paper.
const FIRST: usize = 10;
/// Neighbours beyond: as good as 30 on every scene of `cargo bench --bench quality`, and cheaper. A
/// plan's memory is for these.
pub(super) const MOST: usize = 20;
/// Positions that cubes hold on average of which samples are a few times as wide.
pub(super) const POSITIONS_PER_CUBE: u64 = 32;

/// The scatter of normals of ten neighbours in a sample, NaN if it is not planar.
pub(super) fn sample(stage: &Normals, tile: &mut Tile) -> Result<Vec<f64>> {
    let first = Normals { neighbors: Setting::Given(FIRST), ..*stage };
    first.run(tile, &mut Tally::default())?;
    Ok(vec![scatter(tile).unwrap_or(f64::NAN)])
}

/// Chooses by the median scatter; where nothing is planar, nothing tells noise from shape, and the
/// paper's number stays.
pub(super) fn forecast(stage: &mut Normals, samples: &[Vec<f64>]) -> Forecast {
    let scatter = typical(samples.iter().flatten().copied());
    let found = if scatter.is_some_and(|scatter| scatter > SMOOTH) { MOST } else { FIRST };
    stage.found = Some(found);
    let told = scatter.map(|scatter| ("scatter_of_10".into(), scatter.into()));
    Forecast {
        decisions: told.into_iter().collect(),
        chosen: vec![("neighbors".into(), found.into())],
        warning: None,
    }
}
