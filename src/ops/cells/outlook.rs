//! What is known of the scan before a sample is looked at.

use crate::stage::ScanFacts;
use crate::store::Levels;

/// How many records and positions there are, and how many cubes of every side they occupy.
#[derive(Debug, Clone)]
pub(super) struct Outlook {
    levels: Levels,
    records: u64,
    /// World units of a lattice step.
    step: f64,
}

impl Outlook {
    pub(super) fn of(scan: &ScanFacts) -> Self {
        Outlook { levels: scan.levels.clone(), records: scan.points, step: scan.lattice.step }
    }

    /// Records of the scan.
    pub(super) fn records(&self) -> u64 {
        self.records
    }

    /// Positions of the scan.
    pub(super) fn positions(&self) -> u64 {
        self.levels.positions()
    }

    /// World units of a lattice step.
    pub(super) fn step(&self) -> f64 {
        self.step
    }

    /// Side in steps of the cubes of a grid that keeps `count` positions: between the two octree
    /// levels that keep more and fewer, by powers.
    pub(super) fn grid_side(&self, count: u64) -> f64 {
        let count = count.clamp(self.levels.occupied(62).max(1), self.levels.positions());
        let level = (0..62).find(|&j| self.levels.occupied(j + 1) <= count).unwrap_or(62);
        let log = |cubes: u64| libm::log2(cubes as f64);
        let (fine, coarse) = (self.levels.occupied(level), self.levels.occupied(level + 1));
        let between = match fine > coarse {
            true => (log(fine) - log(count)) / (log(fine) - log(coarse)),
            false => 0.0,
        };
        libm::exp2(f64::from(level) + between.max(0.0))
    }
}
