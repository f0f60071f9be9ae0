//! How many neighbours a normal takes where the noise of the scan decides.

use crate::ops::scatter::SMOOTH;

/// Neighbours that the noise is measured with: those of the paper.
pub(super) const FIRST: usize = 10;
/// Neighbours beyond: as good as 30 on every scene of `cargo bench --bench quality`, and cheaper. A
/// plan's memory is for these.
pub(super) const MOST: usize = 20;
/// Positions that cubes hold on average of which samples are a few times as wide.
pub(super) const POSITIONS_PER_CUBE: u64 = 32;

/// Chooses by the median scatter; where nothing is planar, nothing tells noise from shape, and the
/// paper's number stays.
pub(super) fn neighbors(scatter: Option<f64>) -> usize {
    if scatter.is_some_and(|scatter| scatter > SMOOTH) { MOST } else { FIRST }
}
