//! What all ways of orienting normals have in common.

use crate::point::{Column, names};

pub(super) const TIME: Column<f64> = Column::new(names::GPS_TIME, &[]);

/// A normal with the other sign.
pub(super) fn turned(normal: [f32; 3]) -> [f32; 3] {
    // −0 + 0 = 0
    normal.map(|c| -c + 0.0)
}
