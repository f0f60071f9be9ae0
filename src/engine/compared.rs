//! What a branch is compared with: a voxel grid that leaves as many of the records that its passes
//! decided about.

use super::rounds::MeasuredGrid;
use crate::geom::lattice::Lattice;
use crate::report::{Baseline, BaselineFigures};

/// What the first pass that removes points is compared with, and what it found.
pub(super) struct Compared {
    with: ComparedGrid,
    /// Records.
    found: u64,
}

/// What was measured of grids.
pub(super) enum ComparedGrid {
    /// Of several sides, on the way of a pass that decided about so many records by normals.
    Levels { baseline: Baseline, decided: u64 },
    /// Of one that keeps as many as a stage that chose in rounds.
    OfAsMany(MeasuredGrid),
}

impl Compared {
    /// A pass that found so many records.
    pub fn new(with: ComparedGrid, found: u64) -> Compared {
        Compared { with, found }
    }

    /// The figures of a grid that leaves as many records as there are `alive` now; none if nothing
    /// like it was measured.
    pub fn figures(&self, alive: u64, lattice: &Lattice) -> Option<BaselineFigures> {
        let removed = self.found.checked_sub(alive)?;
        match &self.with {
            ComparedGrid::Levels { baseline, decided } => {
                baseline.figures(decided.checked_sub(removed)?, *decided, lattice)
            }
            // Stages behind it may have removed more.
            ComparedGrid::OfAsMany(grid) => {
                (grid.removes == removed).then(|| grid.figures(lattice)).flatten()
            }
        }
    }
}
