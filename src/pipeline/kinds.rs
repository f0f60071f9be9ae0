//! The stage kinds at both ends of a pipeline, `read`, `synth` and `write`: their keys.

use std::fmt;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Deserializer, Serialize, de};

use super::outputs::Outputs;
use super::registry::{StageKind, StagePlace};
use super::{connect, inputs};
use crate::io::synthetic::Scene;
use crate::stage::{Order, Role};
use crate::{Error, Result, point::names};

/// A format of files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// ASPRS LAS, uncompressed.
    Las,
    /// LAS compressed by LASzip.
    Laz,
    /// PLY with a vertex element.
    Ply,
}

impl Format {
    /// The format that the extension of `path` names, its case aside.
    pub fn of(path: &Path) -> Option<Format> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        [Format::Las, Format::Laz, Format::Ply].into_iter().find(|f| f.extension() == extension)
    }

    /// The extension of its files, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Format::Las => "las",
            Format::Laz => "laz",
            Format::Ply => "ply",
        }
    }

    /// True if the two share their records: LAZ is LAS.
    pub fn same_records(self, other: Format) -> bool {
        (self == Format::Ply) == (other == Format::Ply)
    }
}

/// The source of most pipelines. Several files are one scan; all are LAS or LAZ, or all are PLY.
///
/// Headers are read, compared and held against the files' lengths before any point is. Files that
/// do not fit together are refused by name: LAS inputs agree in point format, record length, extra
/// bytes, scales, GPS time type and coordinate reference system, PLY inputs in encoding, vertex
/// properties and coordinate reference system. LAS offsets may differ by whole steps; the output has
/// the smallest.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Read {
    /// A file, a pattern, a folder, or a list of them.
    #[serde(deserialize_with = "one_or_more")]
    pub path: Vec<String>,
    /// Format of all of them; none: as their extensions say.
    #[serde(default)]
    pub format: Option<Format>,
}

impl StageKind for Read {
    const KIND: &'static str = "read";
    const ABOUT: &'static str = "Reads LAS, LAZ or PLY files.";
    const PLACES: &'static [&'static str] = &["path", "format"];

    fn build(self, at: &StagePlace) -> Result<Role> {
        let blame = |error| at.blame("path", error);
        let files = inputs::expand(&self.path).map_err(blame)?;
        let mut formats = Vec::new();
        for file in &files {
            formats.push(match self.format.or(Format::of(file)) {
                Some(format) => format,
                None => return Err(blame(unknown_extension(file))),
            });
        }
        if let Some(i) = formats.iter().position(|f| !f.same_records(formats[0])) {
            let (a, b) = (files[0].display(), files[i].display());
            let help = "read one of the two formats, or convert first";
            let told = format!("{a} and {b} cannot be read together: LAS and PLY records differ");
            return Err(blame(Error::pipeline(told).help(help)));
        }
        Ok(Role::Source(connect::read(files, &formats)))
    }
}

/// A source that needs no file: for trying, for tests, and to see what a setting does where the
/// truth is known. It streams at any size, and equal keys give equal bytes on every machine.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Synth {
    /// What is scanned.
    pub scene: Scene,
    /// How many points.
    pub points: u64,
    /// Equal seeds give equal scans.
    #[serde(default)]
    pub seed: u64,
    /// Standard deviation of the noise in world units; none: the scene's own.
    #[serde(default, deserialize_with = "some_length")]
    pub noise: Option<f64>,
}

impl StageKind for Synth {
    const KIND: &'static str = "synth";
    const ABOUT: &'static str =
        "Makes a scan up: of a simple surface, a machine part, projected squares or a landscape.";

    fn build(self, _at: &StagePlace) -> Result<Role> {
        Ok(Role::Source(connect::synth(&self)))
    }
}

/// The end of every pipeline. The file grows in a scratch folder beside its place and appears under
/// its name when it is complete; it never replaces an input.
///
/// A record that is kept is the input's, byte for byte, wherever the format can hold it; LAS header
/// fields that depend on the points are computed again and all others carried. From LAS to PLY or
/// back every field keeps its name; one that cannot be held is an error unless `drop` names it.
///
/// With `path` all inputs become one file. With `folder` each input becomes a file of its own there:
/// under its name, with its header, its records and its offset, holding those of its points that are
/// kept, even if that is none. The inputs are one scan all the same: neighbourhoods and cells go on
/// from file to file, and the outputs together have the points that the one file would have.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Write {
    /// The file; it appears under this name when it is complete. Either this or `folder` is given.
    #[serde(default)]
    pub path: Option<PathBuf>,
    /// The folder that gets a file for each input; it is made if it does not exist.
    #[serde(default)]
    pub folder: Option<PathBuf>,
    /// The format; none: as the extension says, in a folder that of the input.
    #[serde(default)]
    pub format: Option<Format>,
    /// Dimensions that the output need not hold.
    #[serde(default)]
    pub drop: Vec<String>,
    /// Scale of LAS coordinates per axis, in world units; none: the input's.
    #[serde(default, deserialize_with = "some_scale")]
    pub scale: Option<[f64; 3]>,
    /// Offset of LAS coordinates per axis, in world units; none: the input's, or 0.
    #[serde(default, deserialize_with = "some_offset")]
    pub offset: Option<[f64; 3]>,
    /// Order of the records; none: canonical, or the input's where the pipeline streams.
    #[serde(default)]
    pub order: Option<OutputOrder>,
    /// Computed dimensions that are written: none, or the three of the normal.
    #[serde(default, deserialize_with = "all_or_none")]
    pub dimensions: Vec<String>,
    /// Encoding of a PLY file; none: the input's.
    #[serde(default)]
    pub encoding: Option<Encoding>,
}

/// Order of the records of an output, as a file names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OutputOrder {
    /// Morton order of the lattice, then record bytes.
    Canonical,
    /// The order of the inputs.
    Input,
}

/// Encoding of a PLY file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Encoding {
    /// Numbers as text, shortest form that reads back equal.
    Ascii,
    /// Numbers as bytes.
    Binary,
}

impl Write {
    /// The order as stages know it.
    pub fn stage_order(&self) -> Order {
        match self.order {
            None => Order::Auto,
            Some(OutputOrder::Canonical) => Order::Canonical,
            Some(OutputOrder::Input) => Order::Input,
        }
    }
}

impl Write {
    /// Refuses keys that an output of `format` does not have; tells which.
    pub(super) fn check(&self, format: Format) -> Result<(), (&'static str, Error)> {
        let only = |key: &'static str, formats: &str| {
            let told = format!("`{key}` is for {formats}, the output is {}", format.extension());
            Err((key, Error::pipeline(told)))
        };
        match format {
            Format::Ply if self.scale.is_some() => only("scale", "las and laz"),
            Format::Ply if self.offset.is_some() => only("offset", "las and laz"),
            Format::Las | Format::Laz if self.encoding.is_some() => only("encoding", "ply"),
            _ if self.offset.is_some_and(|offset| offset.iter().any(|v| !v.is_finite())) => {
                Err(("offset", Error::pipeline("an offset is three finite numbers")))
            }
            _ => Ok(()),
        }
    }
}

impl StageKind for Write {
    const KIND: &'static str = "write";
    const ABOUT: &'static str = "Writes a LAS, LAZ or PLY file, or one for each input.";
    const PLACES: &'static [&'static str] = &["path", "folder"];
    const EITHER: &'static [&'static str] = &["path", "folder"];

    fn build(self, at: &StagePlace) -> Result<Role> {
        let check = |format| self.check(format).map_err(|(key, error)| at.blame(key, error));
        match (self.path.clone(), self.folder.clone()) {
            (Some(_), Some(_)) => {
                let told =
                    "`path` makes one file and `folder` one for each input: give one of them";
                Err(at.blame("folder", Error::pipeline(told)))
            }
            (None, None) => Err(Error::pipeline("`write` needs `path` or `folder`")
                .help("`path` is one file, `folder` gets one for each input")),
            (Some(path), None) if path.as_os_str().as_bytes().ends_with(b"/") || path.is_dir() => {
                let told = format!("`{}` is a folder, not a file to write", path.display());
                let help = format!(
                    "name a file in it, such as `{}`, or give the folder as `write.folder`, which gets \
                     a file for each input",
                    path.join("out.laz").display()
                );
                Err(at.blame("path", Error::pipeline(told).help(help)))
            }
            (Some(path), None) => {
                let Some(format) = self.format.or(Format::of(&path)) else {
                    return Err(at.blame("path", unknown_extension(&path)));
                };
                check(format)?;
                let output = connect::Output { write: self, path, format, of_one: false };
                Ok(Role::Sink(Box::new(output)))
            }
            (None, Some(folder)) => {
                self.format.map_or(Ok(()), check)?;
                Ok(Role::Sink(Box::new(Outputs { write: self, folder })))
            }
        }
    }
}

pub(super) fn unknown_extension(path: &Path) -> Error {
    Error::pipeline(format!("the extension of `{}` names no format", path.display()))
        .help("use .las, .laz or .ply, or add `format`")
}

fn one_or_more<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<String>, D::Error> {
    struct Paths;
    impl<'de> de::Visitor<'de> for Paths {
        type Value = Vec<String>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a path or a list of paths")
        }

        fn visit_str<E: de::Error>(self, path: &str) -> Result<Self::Value, E> {
            Ok(vec![path.to_owned()])
        }

        fn visit_seq<A: de::SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
            let mut paths = Vec::new();
            while let Some(path) = list.next_element()? {
                paths.push(path);
            }
            Ok(paths)
        }
    }
    from.deserialize_any(Paths)
}

fn some_length<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    let length = f64::deserialize(from)?;
    match length.is_finite() && length >= 0.0 {
        true => Ok(Some(length)),
        false => Err(de::Error::invalid_value(de::Unexpected::Float(length), &"a number from 0")),
    }
}

fn some_scale<'de, D: Deserializer<'de>>(from: D) -> Result<Option<[f64; 3]>, D::Error> {
    struct Scale;
    impl<'de> de::Visitor<'de> for Scale {
        type Value = [f64; 3];

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a number above 0, or three of them")
        }

        fn visit_i64<E: de::Error>(self, scale: i64) -> Result<Self::Value, E> {
            self.visit_f64(scale as f64)
        }

        fn visit_f64<E: de::Error>(self, scale: f64) -> Result<Self::Value, E> {
            match scale.is_finite() && scale > 0.0 {
                true => Ok([scale; 3]),
                false => Err(E::invalid_value(de::Unexpected::Float(scale), &self)),
            }
        }

        fn visit_seq<A: de::SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
            let mut scale = [0.0; 3];
            for (i, axis) in scale.iter_mut().enumerate() {
                let next: Option<Positive> = list.next_element()?;
                *axis = next.ok_or_else(|| de::Error::invalid_length(i, &Scale))?.0;
            }
            Ok(scale)
        }
    }
    from.deserialize_any(Scale).map(Some)
}

fn some_offset<'de, D: Deserializer<'de>>(from: D) -> Result<Option<[f64; 3]>, D::Error> {
    let offset = <[f64; 3]>::deserialize(from)?;
    match offset.iter().find(|v| !v.is_finite()) {
        Some(&v) => Err(de::Error::invalid_value(de::Unexpected::Float(v), &"finite numbers")),
        None => Ok(Some(offset)),
    }
}

/// A number above 0, refused at its own place.
struct Positive(f64);

impl<'de> Deserialize<'de> for Positive {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let number = f64::deserialize(from)?;
        match number.is_finite() && number > 0.0 {
            true => Ok(Positive(number)),
            false => {
                let found = de::Unexpected::Float(number);
                Err(de::Error::invalid_value(found, &"a number above 0"))
            }
        }
    }
}

fn all_or_none<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<String>, D::Error> {
    let mut given: Vec<String> = Vec::deserialize(from)?;
    given.sort();
    if given.is_empty() || given == names::NORMAL {
        return Ok(given);
    }
    Err(de::Error::custom(format!("takes [] or all of {}", names::NORMAL.join(", "))))
}
