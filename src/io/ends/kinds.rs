//! The stage kinds at both ends of a pipeline, `read`, `synth` and `write`: their keys.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::values::{
    names_once, offset_or_auto, one_or_more, one_or_three, some_code, some_columns, some_crs,
    some_positive, some_scale, some_scans, texts, three_or_auto,
};
use crate::quantity::{CropBox, Length, Setting, SizeText, Whole, some_bytes};
use crate::stage::{
    Assumption, Colors, FloatIntensity, FormatName, OnError, OutputEncoding, Renamed, Retyped,
    Separator,
};

/// The source of most pipelines. Several files are one scan, all of one format; LAS and LAZ count
/// as one, and so do texts.
///
/// The path `-` is standard input. What a pipe gives is set down first, in a file of no name in the
/// folder that `TMPDIR` names, or `/tmp`, which needs room for all of it: a scan is read at many
/// places. A file that the shell opens (`< scan.laz`) is read where it is. The first bytes say the
/// format, of a text `format` does.
///
/// Headers are read, compared and held against the files' lengths before any point is. Files that
/// do not fit together are refused by name: their points hold the same. LAS inputs agree in point
/// format, record length, extra bytes, scales, GPS time type and coordinate reference system, PLY
/// inputs in vertex properties, GPS time type and coordinate reference system. Systems agree if
/// they mean the same: in WKT of one wording, spaces and zeros aside, or by equal EPSG codes; the
/// output has the WKT. LAS offsets may differ by whole steps; the output has the smallest. PLY
/// properties may differ in type, where some type holds all numbers of both.
///
/// What differs is brought to one form where that is asked for: point formats by `point_format`,
/// scales and offsets by `scale` and `offset` (coordinates that these round are told), systems by
/// `crs` or `assume`, dimensions that some lack by `assume`.
///
/// A number of a PLY text is held in the type that its header says, but coordinates and GPS times
/// are held as `double` where one of them has more digits than the `float` of its header has room
/// for: a text is looked through for such before it is read. `scalar_Intensity` and other scalar
/// fields, as CloudCompare writes them, are the dimensions that they are named after. A text that
/// ends within a line is told, since its last number may be cut short.
///
/// # Reprojection
///
/// With `reproject` the points are brought to another coordinate reference system as they are read,
/// and all that a pipeline does happens there; `box` and `resolution` speak of the inputs still.
/// Systems and the operations between their datums are those of EPSG. Of the operations that are
/// meant for all of the place where the scan is, the most accurate that needs no file of a grid is
/// taken. A warning names it with its accuracy, and a better one that needs such a file, where
/// there is one; `run.reprojection` of a report has them, too. Systems between which there is none
/// without a file are refused, and none are ever treated as one because they are alike. Between
/// systems on one datum it is exact but for the steps of coordinates, and nothing is told. Nobody
/// looks whether points lie where a system is meant to be used. Files that are converted one by one
/// may have an operation each, where they lie in places of several; files that are read as one scan
/// have one.
///
/// Where the scan is, headers say; where they do not, or the first points of some parts are
/// elsewhere, all points are read once for it.
///
/// Heights stay as they are where the system that is asked for names none, and the output still
/// says whose they are. `"EPSG:25832+7837"` changes their unit, or depths to heights; heights of
/// another datum would take a grid and are refused. Heights above the ellipsoid (`"EPSG:4979"`, and
/// the three axes of `"EPSG:4978"`) change with the place. Where nothing names the heights, their
/// unit is taken for that of x and y, metres above degrees, and systems of another unit are
/// refused.
///
/// Steps of coordinates become those of the largest power of ten that is no longer on the ground,
/// or of `scale` and `offset`, which are those of the new coordinates then; longer ones are told.
/// Other coordinates become `f64`. Normals and directions of waveforms are not turned, which is
/// told. Sines and the like are those of the machine: their last bit may differ from one kind of
/// machine to another, and in rare cases a step with it.
///
/// # Formats
///
/// - LAS 1.0 to 1.5, and LAZ; COPC (`.copc.laz`) is read as the LAZ that it is, whole or by `box`
///   and `resolution`.
/// - PLY, whatever its vertices hold; lists of theirs are passed over, and told.
/// - PCD as text, as bytes or packed (`binary_compressed`). A cell of a grid (`HEIGHT` above 1) has
///   its `Row` and `Column`. A point of which a coordinate is NaN is none, as the library has it:
///   it is left out, and how many there were is told.
/// - E57: all scans of a file, or those that `scans` names, each brought by its pose to the
///   coordinates that all share. Where there are several, `PointSourceId` has the number of the
///   scan. Points that the file says are invalid are left out and counted; what one scan lacks and
///   another has is 0 there. Colours are scaled by the limits that the scan gives. Images are
///   dropped, and it is said.
/// - Texts with a point a line (`.xyz`, `.txt`, `.csv`, `.asc`, `.pts`): numbers between blanks,
///   tabs, commas or semicolons, below a heading or not; lines that begin with `#` or `//` are
///   comments. `columns` says what the columns are, else a heading does, in any spelling; a text of
///   three columns without one has coordinates, and one of six whose last three are whole numbers
///   up to 255, or cosines, has colours or normals, which is told. Others are refused: nothing says
///   what their columns are. PTS has them by format. A text is looked through before it is read:
///   numbers of a column are held in the smallest integer that holds all of them, or as `f64`.
/// - PTX: scans with a pose each, as in E57; a cell `0 0 0` has no point.
/// - The vertices of OBJ and OFF, with their colours and normals; the corners of the facets of STL,
///   with the facets' normals, each as often as facets share it.
///
/// # What a path means
///
/// Paths mean files, in their order. Each path:
///
/// - a file that exists means itself, whatever characters its name has;
/// - a folder means every file of points in it, by its extension, sorted by the bytes of their
///   names, hidden ones left out; `.txt`, `.csv`, `.asc`, `.obj`, `.off` and `.stl` are not taken
///   out of folders, for what else may have them;
/// - else `*`, `?`, `[…]` and `**` make it a pattern: the files that match, sorted by the bytes of
///   their paths; one that matches none is an error, like a file that is not there;
/// - else `@` and a name mean what each line of that text means: thousands of paths in a file, from
///   the folder that you are in; blank lines and those that begin with `#` mean nothing;
/// - else it is a file that does not exist (yet): opening it will tell.
///
/// Names that are not UTF-8 text are refused, however they are meant. A pattern
/// looks at a million names at most.
///
/// Upper and lower case differ, and `*` and `?` do not match a dot at the beginning of a name, as
/// in a shell. A file meant twice, by whatever names, is an error: its points would be read twice.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Read {
    /// A file, a pattern, a folder, `-` for standard input, or a list of them.
    #[serde(deserialize_with = "one_or_more")]
    #[schemars(schema_with = "texts")]
    pub path: Vec<String>,
    /// Format of all of them; none: as their extensions say, else as their first bytes do.
    #[serde(default)]
    pub format: Option<FormatName>,
    /// What the columns of a text are, in order: `"x,y,z,intensity"`, or a list of names. A column
    /// called `_` is not read and may hold words; none: as a heading names them, or as their number
    /// tells.
    #[serde(default, deserialize_with = "some_columns")]
    #[schemars(schema_with = "texts")]
    pub columns: Option<Vec<String>>,
    /// Numbers of the scans of an E57 file that are read, from 1; none: all of them.
    #[serde(default, deserialize_with = "some_scans")]
    pub scans: Option<Vec<ScanNumber>>,
    /// The coordinate reference system that all inputs are in, whatever they say of it: WKT, or
    /// `"EPSG:25832"`, or `"EPSG:25832+7837"` with that of the heights; none: as they say. Points
    /// stay where they are: `reproject` moves them.
    #[serde(default, deserialize_with = "some_crs")]
    pub crs: Option<String>,
    /// The coordinate reference system that points are brought to as they are read, by its EPSG
    /// code, with another for heights where these change their unit, such as `"EPSG:25832"`; none:
    /// they stay in theirs.
    #[serde(default, deserialize_with = "some_code", skip_serializing_if = "Option::is_none")]
    pub reproject: Option<String>,
    /// What is taken for granted: `"crs"`, that inputs which name no coordinate reference system
    /// are in the one that the others name; `"dimensions"`, that dimensions which not all inputs
    /// have, of PLY, PCD and texts any and of LAS extra bytes, hold nothing in the points of the
    /// others: the no-data value that extra bytes may have, else 0; `"extra-bytes"`, the same of
    /// LAS alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub assume: Vec<Assumption>,
    /// What is done about damage: `"fail"`; `"skip"`, which leaves out what is damaged, of LAZ
    /// whole chunks; `"salvage"`, which reads what can be read, also of a damaged chunk the points
    /// before the damage shows, of which the last may be wrong. A file that ends too early has as
    /// many points as it holds; LAS and LAZ whose header counts too few have those behind them as
    /// well, and variable length records that are cut off are left out. Of a text a line that is no
    /// point is left out, of an E57 file the rest of the scan; so are scans of PTX whose first
    /// lines are wrong, and cells that it counts and does not have. PCD whose counts contradict
    /// each other has as many points as its length holds; without rows and columns, if the counts
    /// of these are what is wrong. Packed points of PCD that are damaged and an E57 file that is
    /// cut off are not mended. What is lost is told, and counted in the report.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub on_error: Option<OnError>,
    /// Where points of LAS, LAZ and COPC are read: `[x0, y0, x1, y1]`, or
    /// `[x0, y0, z0, x1, y1, z1]`, both of whose corners belong to it; none: everywhere. Of COPC
    /// only the nodes that meet it are read.
    #[serde(default, rename = "box")]
    pub bounds: Option<CropBox>,
    /// Distance between points, in the unit of the coordinates, down to which COPC is read: levels
    /// of its octree up to the first that is as fine; none: all levels.
    #[serde(default, deserialize_with = "some_positive")]
    pub resolution: Option<f64>,
    /// Scale that LAS inputs are brought to as they are read, where their scales differ or their
    /// offsets are not whole steps apart; `"auto"`: the largest that rounds nothing; none: such
    /// inputs are refused.
    #[serde(default, deserialize_with = "some_scale")]
    #[schemars(schema_with = "one_or_three")]
    pub scale: Option<Setting<[f64; 3]>>,
    /// Offset that they are brought to; none: the smallest of theirs; `"auto"`: that, or one from
    /// which the steps reach all points.
    #[serde(default, deserialize_with = "offset_or_auto")]
    #[schemars(schema_with = "three_or_auto")]
    pub offset: Option<Setting<[f64; 3]>>,
    /// Point data record format that LAS inputs are brought to as they are read, where theirs
    /// differ: one that has the fields of all; `"auto"`: the smallest that has; none: such inputs
    /// are refused.
    #[serde(default)]
    pub point_format: Option<Setting<PointFormat>>,
}

/// The number of a scan in a file.
pub type ScanNumber = Whole<1, 65_535>;

/// The end of every pipeline. The file grows in a scratch folder beside its place and appears under
/// its name when it is complete; it never replaces an input.
///
/// The path `-` is standard output; `format` says what is written. The file grows in the folder
/// that `TMPDIR` names, or `/tmp`, and is sent when it is complete, so that every format can be
/// sent, and nothing of a run that fails is.
///
/// A record that is kept is the input's, byte for byte, wherever the format can hold it. From one
/// format to another every field keeps its name; one that cannot be held is an error unless `drop`
/// names it. A point of which a file tells no returns is return 1 of 1 in LAS. Variable length
/// records that other formats do not hold are named in a warning, and so is a coordinate reference
/// system that a text does not hold.
///
/// Colours keep their meaning: 255 of 8 bits in PLY is 65535 in LAS. From LAS to other formats they
/// become 8 bits where that loses nothing: where each is a multiple of 257 or of 256, or all are
/// below 256, as writers leave them that do not scale. Else they stay 16 bits, which many viewers
/// do not read; a warning says so, and `colors` can ask for either. The type depends on all colours
/// of the output, and on nothing else. Within one format colours are not touched.
///
/// PCD has colours of 8 bits in one number `rgb`, as the library's own points do. In E57
/// coordinates that are steps of a scale stay steps, normals are `nor:normalX` and so on, and what
/// the standard has no name for is an extension, `pm`; the points are one scan. Texts have
/// coordinates with the decimals that the scale has, other numbers with as few as read back equal;
/// a line that names the columns is there where they are more than coordinates (`header`). PTS has
/// coordinates, intensity and colours and nothing else, below their count. PTX, OBJ, OFF and STL
/// are not written; the stage `mesh` writes triangles.
///
/// COPC 1.0 (`.copc.laz`) is written from any pipeline that does not move points behind its tiles:
/// in point format 6, 7 or 8 (older ones become these; waveforms must be dropped). Each level of
/// its octree is a picture of the whole: of the points of a cell, of which a node has 128 a side,
/// one stands for the cell in the node or above it: the one that `graded` kept first, where the
/// points have its `KeepRank`, else one that a hash of the positions chooses. A subtree of up to
/// 65,536 points is one node. The bytes are a function of the points alone, and records within a
/// node are ordered by GPS time.
///
/// LAS header fields that depend on the points are computed again. The generating software is
/// pointmill and its version. Where records went through stages, the system identifier is
/// `EXTRACTION`, a variable length record (`pointmill`, 1) names the stages as JSON in the place of
/// what an earlier run said, and the ranges of extra bytes, which were those of all points, are
/// left out; where only `scale` or `offset` moved them, the identifier is `TRANSFORMATION`. All
/// else is carried, and what is wrong in it mended with a warning: the bit that says that the
/// system is WKT, and descriptors of extra bytes that the records do not have or that stand in
/// several variable length records. Waveforms in a `.wdp` file are copied beside the output, under
/// its name. From PLY, EPSG codes become GeoTIFF keys. No date but those of the inputs is written.
///
/// The file says how it was made, in a variable length record (`pointmill`, 2) or in comments of a
/// PLY header: the pipeline, the version of pointmill and the SHA-256 of each input, by which
/// `pointmill reproduce` makes it again; `run.provenance = false` leaves that out.
///
/// With `path` all inputs become one file. With `folder` each input becomes a file of its own
/// there: under its name, with its header, its records and its offset, holding those of its points
/// that are kept, even if that is none. `format = "copc"` makes each a COPC file; without it
/// `.copc.laz` becomes `.laz`. The inputs are one scan all the same: neighbourhoods and cells go on
/// from file to file, and the outputs together have the points that the one file would have.
///
/// # Splitting
///
/// An output may be split into several files, of which `path` is the pattern; the folder is made if
/// it does not exist. Records that are split have the order that they would have in one file, and
/// the files have all of them. There may be up to 16,384 files. Records are set down in scratch by
/// file before the files are written, so that the disk needs room for them once more.
///
/// With `side` there is a file for each square of the plane that has points:
/// `path = "tiles/{x}_{y}.laz"` with `side = "500 m"` writes `tiles/638000_4851500.laz` and so on,
/// named by the smallest x and y of each square. A point on a border is in the square of larger
/// coordinates. Squares begin at the origin of the coordinates, so that those of neighbouring scans
/// fit together.
///
/// With `by` there is a file for each value of a dimension whose numbers are whole:
/// `path = "lines/{value}.laz"` with `by = "PointSourceId"` writes a file for each flight line, and
/// with `by = "Classification"` one for each class.
///
/// Each of such files may be COPC, as `path = "tiles/{x}_{y}.copc.laz"` with `side = "500 m"`: an
/// octree of its own around its points, byte for byte the one that these points alone would become,
/// whatever other files there are. With `points` COPC files hold so many points that follow each
/// other in canonical order, which keeps neighbours together; `bytes` is refused, since the length
/// of COPC is known when it is complete.
///
/// With `points` a file has so many points, and the last what is left: `path = "part_{number}.laz"`
/// with `points = "10M"` writes `part_0001.laz` and so on. With `bytes` a file is no longer than
/// that, as it lies on the disk: it has as many of the chunks that the format is written in (50,000
/// points of LAS and LAZ, fewer of others) as fit, with 256 KiB and a hundredth to spare. Chunks
/// are encoded twice for that: once to see how long they are.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Write {
    /// The file, which appears under this name when it is complete; `-` for standard output. Either
    /// this or `folder` is given.
    #[serde(default)]
    #[schemars(title = "a path")]
    pub path: Option<PathBuf>,
    /// The folder that gets a file for each input; it is made if it does not exist.
    #[serde(default)]
    #[schemars(title = "a path")]
    pub folder: Option<PathBuf>,
    /// Side of the squares that get a file each; none: one file. `path` has `{x}` and `{y}` where
    /// the corner of a square is to stand.
    #[serde(default)]
    pub side: Option<Length>,
    /// Dimension of the records whose values get a file each, such as `PointSourceId`; none: one
    /// file. `path` has `{value}` where the value is to stand.
    #[serde(default)]
    pub by: Option<String>,
    /// Points of a file, where there is to be one after another; none: one file. `path` has
    /// `{number}` where the number of the file is to stand, from 1.
    #[serde(default)]
    pub points: Option<FilePoints>,
    /// Bytes of a file at most, where there is to be one after another; none: one file. `path` has
    /// `{number}` where the number of the file is to stand, from 1.
    #[serde(default, deserialize_with = "some_bytes")]
    #[schemars(with = "Option<SizeText>")]
    pub bytes: Option<u64>,
    /// The format; none: as the extension says, in a folder that of the input. A file whose
    /// extension says another is written, with a warning.
    #[serde(default)]
    pub format: Option<FormatName>,
    /// Dimensions that the output need not hold. A field that every record of its point format has
    /// is 0 then.
    #[serde(default)]
    pub drop: Vec<String>,
    /// Dimensions that have another name in the output, as `"Amplitude=Intensity"`. One that the
    /// input has under that name must be named in `drop`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub map: Vec<Renamed>,
    /// Types that dimensions have in the output, as `"Intensity=f32"`: `u8` to `u64`, `i8` to
    /// `i64`, `f32` and `f64`. Values are rounded to it, which is told, whole numbers never; those
    /// beyond it are refused. Of LAS, extra bytes alone have a type to choose.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub types: Vec<Retyped>,
    /// Scale of LAS coordinates per axis, in world units; `"auto"`: the input's, or, of one that is
    /// not LAS, the largest power of ten that rounds no coordinate: all points are read once for
    /// that before the run; none: the input's.
    #[serde(default, deserialize_with = "some_scale")]
    #[schemars(schema_with = "one_or_three")]
    pub scale: Option<Setting<[f64; 3]>>,
    /// Offset of LAS coordinates per axis, in world units; `"auto"`: one from which the steps reach
    /// all points, 0 or the input's where that does; none: the input's, or 0.
    #[serde(default, deserialize_with = "offset_or_auto")]
    #[schemars(schema_with = "three_or_auto")]
    pub offset: Option<Setting<[f64; 3]>>,
    /// Point data record format of LAS, 0 to 10; none: the input's, or the smallest that holds the
    /// dimensions of an input that is not LAS. Fields that it lacks must be named in `drop`, and
    /// values that it has no room for are refused; whole degrees of a scan angle become the nearest
    /// of 0.006°, which read back as the same whole degrees. `"auto"`: as none, but the smallest
    /// that holds what `drop` leaves.
    #[serde(default)]
    pub point_format: Option<Setting<PointFormat>>,
    /// What intensities of floating-point numbers are in LAS: `"unit"`, parts of 65535; none: whole
    /// numbers, and others are refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intensity: Option<FloatIntensity>,
    /// Order of the records; none: canonical, in the chunks of LAZ (50,000 records) by GPS time and
    /// return number, which compresses better; or the input's where the pipeline streams.
    #[serde(default)]
    pub order: Option<OutputOrder>,
    /// Computed dimensions that are written besides those of the input: `NormalX`, `NormalY` and
    /// `NormalZ`, or what another stage computes. One that the input has, too, takes its place.
    #[serde(default, deserialize_with = "names_once")]
    pub dimensions: Vec<String>,
    /// Encoding of a PLY file; none: the input's.
    #[serde(default)]
    pub encoding: Option<OutputEncoding>,
    /// Bits of a colour in a file that is not LAS, of points from one of another format; none:
    /// `"auto"`.
    #[serde(default)]
    pub colors: Option<Colors>,
    /// What stands between two numbers of a text; none: a comma in CSV, else a blank.
    #[serde(default)]
    pub separator: Option<Separator>,
    /// Decimals of the coordinates in a text, which may round them; none: as many as it takes to
    /// read them back equal.
    #[serde(default)]
    pub decimals: Option<Decimals>,
    /// Whether a text begins with a line that names its columns; none: if it is CSV, or has more
    /// than coordinates and is not PTS.
    #[serde(default)]
    pub header: Option<bool>,
}

/// How many points a file gets.
pub type FilePoints = Whole<1, 1_000_000_000_000>;

/// The number of a point data record format.
pub type PointFormat = Whole<0, 10>;

/// How many decimals a coordinate is written with.
pub type Decimals = Whole<0, 17>;

/// Order of the records of an output, as a file names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum OutputOrder {
    /// Morton order of the lattice, then record bytes.
    Canonical,
    /// The order of the inputs: by file, as they are given, then by record. So the output depends
    /// on the order of the inputs; a scan that is marked has its records where the input has them.
    /// For `path` alone.
    Input,
}
