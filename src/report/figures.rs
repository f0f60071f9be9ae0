//! The figures of the report's `result`, in world units, as they are written to JSON.

use std::io::{self, Write};

use serde::{Deserialize, Serialize};

use crate::geom::lattice::Lattice;
use crate::point::Position;

/// A figure before and after the reduction.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pair<T> {
    /// Of the records read.
    pub before: T,
    /// Of the records kept.
    pub after: T,
}

/// How far records are from the plane fitted to them, in world units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PlaneFigures {
    /// sqrt(Σd²/n).
    pub rms: f64,
    /// Σ|d|/n.
    pub mean: f64,
}

/// How far removed records are from the plane of the point that stands for them, in world units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct DeviationFigures {
    /// Removed records of which it was measured.
    pub points: u64,
    /// sqrt(Σd²/n).
    pub rms: f64,
    /// The largest.
    pub max: f64,
    /// World coordinates of the record that has it.
    pub at: [f64; 3],
}

/// [`DeviationFigures`] of the whole scan, with percentiles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DeviationTotals {
    /// Removed records of which it was measured.
    pub points: u64,
    /// sqrt(Σd²/n).
    pub rms: f64,
    /// Half of the records deviate no more; at most 1 % above the true percentile.
    pub p50: f64,
    /// 95 % deviate no more.
    pub p95: f64,
    /// 99 % deviate no more.
    pub p99: f64,
    /// The largest.
    pub max: f64,
    /// World coordinates of the record that has it.
    pub at: [f64; 3],
}

/// The removed records of one stretch of deviations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DeviationBin {
    /// Its largest deviation, in world units; 0 for those that do not deviate. Others are eighths
    /// of what is between two powers of two of lattice steps.
    pub to: f64,
    /// Removed records.
    pub points: u64,
}

/// One report tile.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct TileFigures {
    /// World coordinates of the smallest corner of its cube.
    pub corner: [f64; 3],
    /// Records.
    pub points: Pair<u64>,
    /// Distances to the planes fitted in this tile; None where no record is left.
    pub plane: Pair<Option<PlaneFigures>>,
    /// Of the removed records; None where there are none.
    pub deviation: Option<DeviationFigures>,
}

impl TileFigures {
    /// Writes the tile as one line of JSON: what [`Report::write`](super::Report::write) reads.
    /// Tiles are written in Morton order.
    ///
    /// # Errors
    ///
    /// Those of `out`.
    pub(crate) fn write_line(&self, out: &mut impl Write) -> io::Result<()> {
        serde_json::to_writer(&mut *out, self)?;
        out.write_all(b"\n")
    }
}

/// The deviation of a voxel grid that keeps as many points, in world units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct BaselineFigures {
    /// Side of the cubes of a grid of that many points.
    pub side: f64,
    /// Removed records whose deviation was measured for it.
    pub points: u64,
    /// sqrt(Σd²/n).
    pub rms: f64,
    /// Half of the records deviate no more.
    pub p50: f64,
    /// 95 % deviate no more.
    pub p95: f64,
    /// 99 % deviate no more.
    pub p99: f64,
}

/// The whole scan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Totals {
    /// Occupied report tiles.
    pub tiles: u64,
    /// Records.
    pub points: Pair<u64>,
    /// Distances of all records, each to the plane of its report tile: ΣΣd²/Σn.
    pub tile_plane: Pair<Option<PlaneFigures>>,
    /// Distances of all records to one plane.
    pub scan_plane: Pair<Option<PlaneFigures>>,
    /// Of the removed records; None where there are none.
    pub deviation: Option<DeviationTotals>,
    /// That of a voxel grid of as many points; None where no pass decides by normals and no stage
    /// says how many it keeps.
    pub baseline: Option<BaselineFigures>,
}

/// What a pass over the scan left.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PassFigures {
    /// Kinds of its stages, in order.
    pub stages: Vec<String>,
    /// Records that it found.
    pub before: u64,
    /// Records that it left for the next: neither removed nor marked as what would be removed.
    pub after: u64,
    /// Distances of these to planes fitted to them, as in [`Totals`]: each in its report tile.
    /// Measured where a reduction is repeated, behind each time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tile_plane: Option<PlaneFigures>,
    /// The same to one plane.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scan_plane: Option<PlaneFigures>,
}

/// The records of one class.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct ClassFigures {
    /// The class, as the records have it: LAS 1.4 R15, Tables 9 and 17.
    pub class: u8,
    /// Records read.
    pub before: u64,
    /// Records kept.
    pub after: u64,
}

/// World coordinates of a position of the scan. Where positions are rounded they are the shortest
/// decimals within half a step, which say all that the position tells.
pub(super) fn world_point(position: Position, lattice: &Lattice) -> [f64; 3] {
    let world = lattice.world(position);
    if lattice.rounds() { world.map(|at| shortest(at, lattice.step / 2.0)) } else { world }
}

/// The shortest decimal nearer to `at` than `within`.
fn shortest(at: f64, within: f64) -> f64 {
    let decimal = |digits: usize| format!("{at:.digits$}").parse::<f64>().ok();
    let near = |d: &f64| (d - at).abs() < within;
    (0..=12).filter_map(decimal).find(near).unwrap_or(at)
}

/// A length in lattice steps as one in world units.
pub(super) fn world_length(steps: f32, lattice: &Lattice) -> f64 {
    f64::from(steps) * lattice.step
}

#[cfg(test)]
mod tests {
    use super::shortest;

    #[test]
    fn a_rounded_coordinate_is_the_shortest_decimal_within_half_a_step() {
        let step = 1.0 / f64::from(1 << 30);
        for at in [12.346, -31.35136, 5_600_018.349, 1e-9, 0.0, 4e9] {
            let rounded = (at / step).round_ties_even() * step;
            assert_eq!(shortest(rounded, step / 2.0), at);
        }
        assert_eq!(shortest(0.123_456_789_012_345_6, 0.0), 0.123_456_789_012_345_6);
    }
}
