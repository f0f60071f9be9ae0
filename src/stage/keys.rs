//! What users ask of the files that are read and written, as far as formats need to know.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::quantity::CropBox;

/// How inputs are to be read, as far as formats need to know: keys of `read`.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct ReadKeys {
    /// What the columns of a text are, in order; `_` for one that is not read.
    pub columns: Option<Vec<String>>,
    /// Which scans of each file are read, by their numbers from 1.
    pub scans: Option<Vec<u64>>,
    /// The coordinate reference system of all inputs, whatever they say: WKT, or `EPSG:code` with a
    /// vertical code behind `+`.
    pub crs: Option<String>,
    /// What is taken for granted of inputs that do not say it.
    pub assume: Vec<Assumption>,
    /// What is done about damage.
    pub on_error: OnError,
    /// The box that points are read from, both of whose corners belong to it; none: everywhere.
    pub bounds: Option<CropBox>,
    /// Distance between points, in world units, down to which levels of an octree are read.
    pub resolution: Option<f64>,
    /// Scale that LAS inputs of different scales or offsets are brought to.
    pub scale: Option<[f64; 3]>,
    /// Offset that they are brought to.
    pub offset: Option<[f64; 3]>,
    /// Point data record format that LAS inputs of different ones are brought to.
    pub point_format: Option<u8>,
}

impl ReadKeys {
    /// The keys that are given and that not every format has.
    pub fn given(&self) -> impl Iterator<Item = &'static str> {
        let all = [
            ("columns", self.columns.is_some()),
            ("scans", self.scans.is_some()),
            ("on_error", self.on_error != OnError::Fail),
            ("box", self.bounds.is_some()),
            ("resolution", self.resolution.is_some()),
            ("scale", self.scale.is_some()),
            ("offset", self.offset.is_some()),
            ("point_format", self.point_format.is_some()),
        ];
        all.into_iter().filter(|(_, is_given)| *is_given).map(|(key, _)| key)
    }
}

/// What is taken for granted of inputs that do not say it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Assumption {
    /// They are in the coordinate reference system that the other inputs name.
    Crs,
}

/// What is done about damage in an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum OnError {
    /// The run fails.
    #[default]
    Fail,
    /// What is damaged is left out, of LAZ whole chunks; what is lost is told.
    Skip,
    /// What can be read of it is read, of a damaged chunk the points before the damage shows, of
    /// which the last may be wrong; what is lost is told.
    Salvage,
}

/// What an output is to be, as far as formats need to know: keys of `write`.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct WriteKeys {
    /// The final path, for messages.
    pub path: PathBuf,
    /// The computed dimensions that are written. What they are comes with
    /// [`Metadata::computed`](crate::point::Metadata::computed).
    pub computed: Vec<String>,
    /// Dimensions that the output need not hold.
    pub drop: Vec<String>,
    /// Scale of stored coordinates.
    pub scale: Option<[f64; 3]>,
    /// Offset of stored coordinates.
    pub offset: Option<[f64; 3]>,
    /// Point data record format of LAS.
    pub point_format: Option<u8>,
    /// Text or bytes.
    pub encoding: Option<OutputEncoding>,
    /// Bits of a colour.
    pub colors: Option<Colors>,
    /// What stands between two numbers of a text.
    pub separator: Option<Separator>,
    /// Decimals of coordinates in a text.
    pub decimals: Option<u8>,
    /// True for a text whose first line names the columns.
    pub header: Option<bool>,
}

impl WriteKeys {
    /// The keys that are given and that not every format has.
    pub fn given(&self) -> impl Iterator<Item = &'static str> {
        let all = [
            ("scale", self.scale.is_some()),
            ("offset", self.offset.is_some()),
            ("point_format", self.point_format.is_some()),
            ("encoding", self.encoding.is_some()),
            ("colors", self.colors.is_some()),
            ("separator", self.separator.is_some()),
            ("decimals", self.decimals.is_some()),
            ("header", self.header.is_some()),
        ];
        all.into_iter().filter(|(_, is_given)| *is_given).map(|(key, _)| key)
    }
}

/// Encoding of a PLY file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum OutputEncoding {
    /// Numbers as text, shortest form that reads back equal.
    Ascii,
    /// Numbers as bytes.
    Binary,
}

/// How many bits the colours of LAS records have in a PLY file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub enum Colors {
    /// 8 where that loses nothing, else 16.
    #[default]
    #[serde(rename = "auto")]
    Auto,
    /// The upper 8 bits, as `uchar`.
    #[serde(rename = "8bit")]
    Eight,
    /// All 16 bits, as `ushort`.
    #[serde(rename = "16bit")]
    Sixteen,
}

/// What stands between two numbers of a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Separator {
    /// A blank.
    Blank,
    /// `,`
    Comma,
    /// `;`
    Semicolon,
    /// A tab.
    Tab,
}
