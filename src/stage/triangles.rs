//! Triangles between the points of an output.

/// A triangle of a mesh over a plane, counter-clockwise as it is seen from the side that the axis
/// across the plane points to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle {
    /// The numbers of its corners among the points of the output, from 0.
    pub corners: [u64; 3],
    /// Where these are, in world units.
    pub places: [[f64; 3]; 3],
}

/// How the points of an output are connected: their Delaunay triangulation in a plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangulation {
    /// The axis across the plane: 0, 1 or 2.
    pub axis: usize,
    /// The largest radius of a triangle's circle, in the unit of the scan; none: any.
    pub max_radius: Option<f64>,
}
