//! What users ask of the files that are read and written, as far as formats need to know.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::renamed::{Renamed, Retyped};
use crate::point::Scalar;
use crate::quantity::{CropBox, Setting};

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
    /// The system that points are brought to, as EPSG codes; no matter of formats.
    pub reproject: Option<String>,
    /// What is taken for granted of inputs that do not say it.
    pub assume: Vec<Assumption>,
    /// What is done about damage.
    pub on_error: OnError,
    /// The box that points are read from, both of whose corners belong to it; none: everywhere.
    pub bounds: Option<CropBox>,
    /// Distance between points, in world units, down to which levels of an octree are read.
    pub resolution: Option<f64>,
    /// Scale that LAS inputs of different scales or offsets are brought to.
    pub scale: Option<Setting<[f64; 3]>>,
    /// Offset that they are brought to.
    pub offset: Option<Setting<[f64; 3]>>,
    /// Point data record format that LAS inputs of different ones are brought to.
    pub point_format: Option<Setting<u8>>,
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
    /// Extra dimensions that other inputs have hold nothing in their points: the no-data value that
    /// their description has, else 0.
    #[serde(rename = "extra-bytes")]
    ExtraBytes,
    /// The same of dimensions of any kind, in every format whose inputs may differ in them.
    Dimensions,
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
    /// Dimensions that have other names in the output. A format gets records under those names, and
    /// the other keys speak of them: it has nothing to do for these but to copy no records as they
    /// are.
    pub map: Vec<Renamed>,
    /// Types that dimensions have in the output, by their names there.
    pub types: Vec<Retyped>,
    /// Scale of stored coordinates. A format gets one that is given, or none.
    pub scale: Option<Setting<[f64; 3]>>,
    /// Offset of stored coordinates, likewise.
    pub offset: Option<Setting<[f64; 3]>>,
    /// Point data record format of LAS.
    pub point_format: Option<Setting<u8>>,
    /// What intensities of floating-point numbers mean.
    pub intensity: Option<FloatIntensity>,
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
    /// The scale, if one is given.
    pub fn given_scale(&self) -> Option<[f64; 3]> {
        self.scale.and_then(Setting::given)
    }

    /// The offset, if one is given.
    pub fn given_offset(&self) -> Option<[f64; 3]> {
        self.offset.and_then(Setting::given)
    }

    /// The point format, if one is given.
    pub fn given_point_format(&self) -> Option<u8> {
        self.point_format.and_then(Setting::given)
    }

    /// The type that a dimension of this name is to have in the output, if one is given.
    pub fn type_of(&self, name: &str) -> Option<Scalar> {
        self.types.iter().find(|retyped| retyped.name == name).map(|retyped| retyped.scalar)
    }

    /// The keys that are given and that not every format has.
    pub fn given(&self) -> impl Iterator<Item = &'static str> {
        let all = [
            ("types", !self.types.is_empty()),
            ("scale", self.scale.is_some()),
            ("offset", self.offset.is_some()),
            ("point_format", self.point_format.is_some()),
            ("intensity", self.intensity.is_some()),
            ("encoding", self.encoding.is_some()),
            ("colors", self.colors.is_some()),
            ("separator", self.separator.is_some()),
            ("decimals", self.decimals.is_some()),
            ("header", self.header.is_some()),
        ];
        all.into_iter().filter(|(_, is_given)| *is_given).map(|(key, _)| key)
    }
}

/// What intensities of floating-point numbers mean where they become whole ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum FloatIntensity {
    /// Parts of the largest: 1 is 65535.
    Unit,
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
