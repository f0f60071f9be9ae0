//! How scans are drawn: from where, coloured by what, and how large.

use crate::point::{Dimension, Schema, names};
use crate::{Error, Result};

/// Pixels that a picture is wide and high, at most: its memory is 11 bytes a pixel.
pub const WIDEST: u32 = 4096;
/// Pixels that it is wide and high, at least.
pub(super) const NARROWEST: u32 = 64;

/// How scans are drawn.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// From where.
    pub view: View,
    /// Coloured by what.
    pub by: ColorBy,
    /// Pixels that the picture is wide, all panels together: 64 to [`WIDEST`].
    pub width: u32,
    /// Threads that decode and draw.
    pub threads: usize,
}

/// From where a scan is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum View {
    /// From above: x to the right, y up.
    #[default]
    Above,
    /// From the south: x to the right, z up.
    South,
    /// From the north: −x to the right, z up.
    North,
    /// From the east: y to the right, z up.
    East,
    /// From the west: −y to the right, z up.
    West,
}

impl View {
    /// To the right, up, and towards the viewer.
    pub(super) fn seen(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        match self {
            View::Above => [x, y, z],
            View::South => [x, z, -y],
            View::North => [-x, z, y],
            View::East => [y, z, x],
            View::West => [-y, z, -x],
        }
    }
}

/// What points are coloured by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum ColorBy {
    /// Their height: from dark blue through green and yellow to red.
    #[default]
    Height,
    /// Their class: ground brown, vegetation green, buildings red, water blue, noise magenta.
    Class,
    /// Their own colour.
    Color,
    /// Their intensity: from black to light grey.
    Intensity,
}

impl ColorBy {
    /// The names of the dimensions that it looks at, and what they are in words.
    fn names(self) -> (&'static [&'static str], &'static str) {
        match self {
            ColorBy::Height => (&["Z"], "heights"),
            ColorBy::Class => (&[names::CLASSIFICATION], "classes"),
            ColorBy::Color => (&[names::RED, names::GREEN, names::BLUE], "colours"),
            ColorBy::Intensity => (&[names::INTENSITY], "intensities"),
        }
    }

    /// True if records of `schema` can be coloured by it.
    pub fn is_in(self, schema: &Schema) -> bool {
        self.names().0.iter().all(|name| schema.find(name).is_some())
    }

    /// The dimensions that it looks at.
    ///
    /// # Errors
    ///
    /// A scan that does not have them.
    pub fn dimensions(self, schema: &Schema) -> Result<Vec<&Dimension>> {
        let (names, what) = self.names();
        let missing = || Error::pipeline(format!("the scan has no {what}"));
        names.iter().map(|name| schema.find(name).ok_or_else(missing)).collect()
    }
}
