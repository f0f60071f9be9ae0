//! Which of the formats a file is of.

/// Which format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum VerticesKind {
    Obj,
    Off,
    Stl,
}

impl VerticesKind {
    /// The name of the family, and what messages call a file of it.
    pub fn names(self) -> [&'static str; 2] {
        match self {
            VerticesKind::Obj => ["OBJ", "an OBJ file"],
            VerticesKind::Off => ["OFF", "an OFF file"],
            VerticesKind::Stl => ["STL", "an STL file"],
        }
    }
}
