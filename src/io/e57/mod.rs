//! E57: scans with poses, packed, by the crate `e57`.
//!
//! All scans of the inputs are one: each is brought by its pose to the coordinates that they share,
//! and where there are several, `PointSourceId` has the number of the scan. What a scan lacks is 0.
//! A record is little-endian numbers of the types that hold the values of all scans.

mod fields;
mod file;
mod info;
mod part;
mod pose;
mod reading;
mod registered;
mod sink;
mod source;

pub use registered::{E57, E57Format};

use crate::point::Layout;

/// The family of E57 records.
const FAMILY: &str = "E57";

/// Numbers of a point.
const RECORDS: Layout = Layout::plain(FAMILY);

/// What messages call an E57 file.
const CALLED: &str = "an E57 file";

/// The first bytes of a file.
const MAGIC: &[u8] = b"ASTM-E57";
