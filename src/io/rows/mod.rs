//! Rows: a record as numbers side by side, in binary or in text, below a header that says which
//! they are. PLY, PCD and texts are written and named by it; how their headers look is theirs.

pub(crate) mod colors;
pub(crate) mod comments;
pub(crate) mod facts;
pub(crate) mod fields;
pub(crate) mod file;
pub(crate) mod lines;
pub(crate) mod names;
pub(crate) mod noted;
pub(crate) mod number;
pub(crate) mod parts;
pub(crate) mod plan;
pub(crate) mod print;
pub(crate) mod schema;

use serde::{Deserialize, Serialize};

use crate::point::{Endian, Layout};

/// How the numbers of a file are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Encoding {
    /// As text, one record a line.
    Ascii,
    /// As bytes, the lowest first.
    BinaryLittleEndian,
    /// As bytes, the highest first.
    BinaryBigEndian,
}

impl Encoding {
    /// Byte order in which records of such a file are held.
    pub fn endian(self) -> Endian {
        match self {
            Encoding::Ascii | Encoding::BinaryLittleEndian => Endian::Little,
            Encoding::BinaryBigEndian => Endian::Big,
        }
    }
}

/// What a format takes for a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RowForm {
    /// What its records are.
    pub layout: Layout,
    /// True if it has integers of 64 bits.
    pub holds_long: bool,
    /// True if colours of 8 bits are one number of 32: blue in its lowest byte, then green and red.
    pub packs_colors: bool,
    /// True if numbers that are steps of a scale stay what they are, to be printed with the
    /// decimals that the scale has.
    pub keeps_steps: bool,
    /// True if a point of which a coordinate is no number is a point for those who read it.
    pub holds_nan: bool,
}
