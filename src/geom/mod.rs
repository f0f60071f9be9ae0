//! Geometry on plain slices: the lattice, nearest neighbours, the star of a point, planes and
//! angles. Knows no tiles, no files.

pub mod angle;
mod decimal;
pub mod delaunay;
pub mod depth;
pub mod hash;
pub mod lattice;
pub mod morton;
pub mod nearest;
pub mod plane;
pub mod planes;
pub mod polygon;
pub mod rows;
pub mod select;
pub mod simd;
pub mod star;
pub mod surface;
pub mod wide;
