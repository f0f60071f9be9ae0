//! The figures of the report's `result`, in world units, as they are written to JSON.

use std::io::{self, Write};

use serde::Serialize;

use crate::geom::lattice::Lattice;

/// A figure before and after the reduction.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Pair<T> {
    /// Of the records read.
    pub before: T,
    /// Of the records kept.
    pub after: T,
}

/// How far records are from the plane fitted to them, in world units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlaneFigures {
    /// sqrt(Σd²/n).
    pub rms: f64,
    /// Σ|d|/n.
    pub mean: f64,
}

/// How far removed records are from the plane of the point that stands for them, in world units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DeviationFigures {
    /// Removed records.
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
pub struct DeviationTotals {
    /// Removed records.
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

/// One report tile.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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
    pub fn write_line(&self, out: &mut impl Write) -> io::Result<()> {
        serde_json::to_writer(&mut *out, self)?;
        out.write_all(b"\n")
    }
}

/// The whole scan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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
}

/// A length in lattice steps as one in world units.
pub(super) fn world_length(steps: f32, lattice: &Lattice) -> f64 {
    f64::from(steps) * lattice.step
}
