//! Files of triangles: OBJ and STL, which hold places and nothing else of a point.
//!
//! OBJ has the points of the output as its vertices, in their order, and triangles that refer to
//! them. Format: Wavefront, "Object Files (.obj)", appendix B1 of the Advanced Visualizer manual.
//! STL has triangles alone, each with its three corners as 32-bit floats, and nothing for a point
//! that is no corner. Format: 3D Systems, "StereoLithography Interface Specification", 1988.

mod obj;
mod stl;

pub(crate) use obj::ObjSink;
pub(crate) use stl::{SinglePlaces, StlSink};

/// Points of one chunk.
pub(crate) const CHUNK_POINTS: usize = 65_536;
