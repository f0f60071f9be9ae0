//! PLY: the vertices of polygon files, text or binary, of any scalar type.
//!
//! A record is a vertex in its file's own binary form; text is held as little-endian binary of the
//! declared types. Properties become dimensions by their names ([`crate::point::names`]); a name
//! that formats do not share is kept as it is. Format: Greg Turk, "The PLY Polygon File Format",
//! 1994.

mod ascii;
mod binary;
mod colors;
mod comments;
mod encode;
mod file;
mod header;
mod headings;
mod info;
mod names;
mod registered;
mod sink;
mod source;
mod text;
mod vertex;
mod walk;

pub use encode::PlyOptions;
pub use header::Encoding;
pub use info::{ElementInfo, PlyInfo, PropertyInfo, describe};
pub use names::RECORDS;
pub use registered::{PLY, PlyFormat};
pub use sink::create;
pub use source::open;
pub use vertex::ply_schema;
