//! PLY: the vertices of polygon files, text or binary, of any scalar type.
//!
//! A record is a vertex in its file's own binary form; text is held as little-endian binary of the
//! declared types. Properties become dimensions by their names ([`crate::point::names`]); a name that
//! formats do not share is kept as it is. Format: Greg Turk, "The PLY Polygon File Format", 1994.

mod ascii;
mod colors;
mod encode;
mod file;
mod header;
mod headings;
mod info;
mod names;
mod sink;
mod source;
mod text;
mod walk;

use std::path::{Path, PathBuf};

pub use colors::Colors;
pub use header::Encoding;
pub use info::{ElementInfo, PlyInfo, PropertyInfo, describe};
pub(crate) use names::rank;

use crate::Result;
use crate::point::{GpsTime, Metadata, Schema};
use crate::stage::{ChunkSize, Sink, Source};

/// What begins the comment that holds the coordinate reference system, and its further pieces.
const CRS: &str = "crs: ";
const CRS_MORE: &str = "crs+ ";

/// What begins the comment that says what the values of `GpsTime` count, and how it goes on.
const GPS_TIME: &str = "gps_time: ";
const GPS_TIMES: [(GpsTime, &str); 2] = [
    (GpsTime::Week, "seconds of the GPS week"),
    (GpsTime::AdjustedStandard, "seconds of GPS time minus 1e9"),
];

/// How a PLY output is written.
#[derive(Debug, Clone, Default)]
pub struct PlyOptions {
    /// Text or binary; that of the input where it is PLY, else little-endian, when not said.
    pub encoding: Option<Encoding>,
    /// Writes the normals of the batches as `nx`, `ny` and `nz`: in place where the input has them
    /// as floating-point numbers, else as `float` behind the other properties.
    pub normals: bool,
    /// Dimensions that are left out.
    pub drop: Vec<String>,
    /// How many bits the colours of LAS records have; as for [`Colors::Auto`] when not said. From PLY
    /// to PLY they stay as they are, and saying it is an error.
    pub colors: Option<Colors>,
    /// Carries the other elements (faces) of a single binary input whose encoding is kept. To be set
    /// only where no vertex is removed, added or moved: it fails on a count that differs.
    pub carry_rest: bool,
}

/// Opens PLY files that agree in encoding, vertex properties and coordinate reference system: their
/// headers, and what stands before the vertices. Fails on a file that is no PLY, has no vertices
/// with `x`, `y` and `z`, has lists in them, or is too short for the count it claims.
pub fn open(paths: &[PathBuf]) -> Result<Box<dyn Source>> {
    Ok(Box::new(source::PlySource::open(paths)?))
}

/// Creates a PLY file at `staged` for records of `schema`. Records of another format are converted
/// to the properties of [`crate::io::convert::ply_schema`]. Fails if a dimension cannot be written
/// or `drop` names none, or if the file cannot be created.
pub fn create(
    staged: &Path,
    options: &PlyOptions,
    schema: &Schema,
    metadata: &Metadata,
) -> Result<Box<dyn Sink>> {
    Ok(Box::new(sink::PlySink::create(staged, options, schema, metadata)?))
}

/// The chunks of the sink that [`create`] would open; fails on what it would refuse of `schema` and
/// `options`.
pub fn chunk(options: &PlyOptions, schema: &Schema, metadata: &Metadata) -> Result<ChunkSize> {
    sink::PlySink::chunk(options, schema, metadata)
}

/// Bytes of a vertex in the file that [`create`] would write, at least, and those in its second copy,
/// where colours may turn out to have another number of bits when many points are written already.
pub fn disk_bytes(options: &PlyOptions, schema: &Schema, metadata: &Metadata) -> Result<[u64; 2]> {
    sink::PlySink::disk_bytes(options, schema, metadata)
}

/// What says who wrote a file, and with blanks behind it brings every header of one file to one length,
/// whatever its count of vertices.
const MADE: &str = "made by pointmill";

fn made(points: u64) -> String {
    format!("{MADE}{}", " ".repeat(20 - points.to_string().len()))
}

/// True for a comment of [`made`], or for what earlier versions had in its place.
fn is_made(comment: &str, points: u64) -> bool {
    let dots = || comment.len() == 21 - points.to_string().len();
    comment.trim_end() == MADE || (comment.bytes().all(|b| b == b'.') && dots())
}
