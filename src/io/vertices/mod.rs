//! The vertices of OBJ, OFF and STL, as points.
//!
//! Faces are not read: who has a mesh and wants its points has them. STL has no vertices but the
//! three corners of each facet; one that facets share comes as often as they do.

mod lines;
mod registered;
mod source;
mod stl;

pub use registered::{OBJ, OFF, STL, VerticesFormat};

/// Which format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum VerticesKind {
    Obj,
    Off,
    Stl,
}

impl VerticesKind {
    /// The name of the family, and what messages call a file of it.
    fn names(self) -> [&'static str; 2] {
        match self {
            VerticesKind::Obj => ["OBJ", "an OBJ file"],
            VerticesKind::Off => ["OFF", "an OFF file"],
            VerticesKind::Stl => ["STL", "an STL file"],
        }
    }
}
