//! Geometry on plain slices: the lattice, nearest neighbours, the star of a point, planes and angles.
//! Knows no tiles, no files.

pub mod angle;
pub mod few;
pub mod lattice;
pub mod nearest;
pub mod plane;
pub mod star;
pub mod wide;
