//! The vertices of OBJ, OFF and STL, as points.
//!
//! Faces are not read: who has a mesh and wants its points has them. STL has no vertices but the
//! three corners of each facet; one that facets share comes as often as they do.

mod kind;
mod lines;
mod registered;
mod source;
mod stl;

pub use registered::{OBJ, OFF, STL, VerticesFormat};
