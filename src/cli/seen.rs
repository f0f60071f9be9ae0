//! How pictures are asked for: from where scans are seen and what they are coloured by.

use clap::ValueEnum;

use crate::picture::{ColorBy, View};

/// From where scans are seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum SeenFrom {
    Above,
    South,
    North,
    East,
    West,
}

impl SeenFrom {
    /// The same for the library.
    pub fn view(self) -> View {
        match self {
            SeenFrom::Above => View::Above,
            SeenFrom::South => View::South,
            SeenFrom::North => View::North,
            SeenFrom::East => View::East,
            SeenFrom::West => View::West,
        }
    }
}

/// What points are coloured by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum ColoredBy {
    Height,
    Class,
    #[value(alias = "colour")]
    Color,
    Intensity,
}

impl ColoredBy {
    /// The same for the library.
    pub fn shown(self) -> ColorBy {
        match self {
            ColoredBy::Height => ColorBy::Height,
            ColoredBy::Class => ColorBy::Class,
            ColoredBy::Color => ColorBy::Color,
            ColoredBy::Intensity => ColorBy::Intensity,
        }
    }
}
