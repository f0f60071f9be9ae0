//! Sides of cubes and how many of them are occupied, between the powers of two of which the scan
//! knows: there numbers are straight lines over sides, both in logarithms.

use crate::point::Bounds;
use crate::stage::{GridBeside, SoFar};
use crate::store::Levels;

/// No distance is larger, in steps.
pub(super) const LONGEST: f64 = (1i64 << 58) as f64;

/// The side in steps of the voxel grid that keeps `count` positions.
pub(super) fn voxel_side(levels: &Levels, bounds: &Bounds, count: u64) -> f64 {
    let mut level = extent(bounds).ilog2() + 1;
    let mut above = None;
    while level > 0 && levels.occupied(level) < count {
        above = Some(levels.occupied(level));
        level -= 1;
    }
    let (side, here) = (2f64.powi(level as i32), levels.occupied(level) as f64);
    match above.map(|above| above as f64) {
        Some(above) if here > above => {
            side * 2f64.powf((here / count as f64).ln() / (here / above).ln())
        }
        _ => side,
    }
}

/// The voxel grid that keeps as many positions; none where all stay.
pub(super) fn grid_beside(keeps: u64, so_far: &SoFar<'_>) -> Option<GridBeside> {
    let is_some = keeps > 0 && keeps < so_far.levels.positions();
    let side = || voxel_side(so_far.levels, &so_far.bounds, keeps).clamp(1.0, LONGEST);
    is_some.then(|| GridBeside { keeps, side: side() })
}

/// Occupied cubes of a side in steps.
pub(super) fn occupied(levels: &Levels, side: f64) -> f64 {
    let level = side.max(1.0).log2();
    let (below, part) = (level.floor() as u32, level.fract());
    let [more, fewer] = [below, below + 1].map(|level| levels.occupied(level).max(1) as f64);
    more * (fewer / more).powf(part)
}

/// So many positions as a share of all, 1 at most.
pub(super) fn share_of(positions: f64, so_far: &SoFar<'_>) -> f64 {
    (positions / so_far.levels.positions().max(1) as f64).min(1.0)
}

/// A distance as whole steps.
pub(super) fn steps(side: f64) -> i64 {
    side.round().clamp(1.0, LONGEST) as i64
}

/// The longest side of the scan, at least 1.
pub(super) fn extent(bounds: &Bounds) -> u64 {
    bounds.extent().into_iter().max().unwrap_or(0).max(1)
}
