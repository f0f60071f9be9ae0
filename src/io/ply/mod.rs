//! PLY: the vertices of polygon files, text or binary, of any scalar type.
//!
//! A record is a vertex in its file's own binary form; text is held as little-endian binary of the
//! declared types. Properties become dimensions by their names ([`crate::point::names`]); a name
//! that formats do not share is kept as it is. Format: Greg Turk, "The PLY Polygon File Format",
//! 1994.

mod agree;
mod ascii;
mod binary;
mod faces;
mod file;
pub(crate) mod header;
mod headings;
pub(crate) mod info;
mod names;
pub(crate) mod registered;
pub(crate) mod sink;
mod source;
mod walk;

pub use registered::{PLY, PlyFormat};
pub use source::open;
