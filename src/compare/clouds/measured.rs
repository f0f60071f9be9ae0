//! Figures of one kind of all points of a scan: their distances, or angles. Merged in any order
//! they are the same.

use serde::{Deserialize, Serialize};

use crate::point::Position;
use crate::report::deviations::MeasuredDeviations;
use crate::report::sums::FixedSum;

/// Distances of one kind.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasuredKind {
    pub deviations: MeasuredDeviations,
    pub sum: FixedSum,
}

impl MeasuredKind {
    /// Adds a distance at so many points.
    pub fn add(&mut self, distance: f64, position: Position, copies: u32) {
        let distance = distance as f32;
        self.deviations.add(distance, position, copies);
        self.sum.add(f64::from(distance), copies);
    }

    /// Adds the distances of other points.
    pub fn merge(&mut self, other: &MeasuredKind) {
        self.deviations.merge(&other.deviations);
        self.sum.merge(&other.sum);
    }
}
