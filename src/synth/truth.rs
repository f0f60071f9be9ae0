//! Where a synthetic point should be.

/// The surface that a synthetic point was measured on.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Truth {
    /// Distance to the surface in world units.
    pub distance: f64,
    /// Unit normal of the surface at its nearest point, outward or upward.
    pub normal: [f64; 3],
}
