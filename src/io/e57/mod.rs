//! E57: scans with poses, packed, by the crate `e57`.
//!
//! All scans of the inputs are one: each is brought by its pose to the coordinates that they share,
//! and where there are several, `PointSourceId` has the number of the scan. What a scan lacks is 0.
//! A record is little-endian numbers of the types that hold the values of all scans.

mod fields;
mod file;
mod info;
mod names;
mod part;
mod pose;
mod reading;
mod registered;
pub(crate) mod sink;
mod source;
mod validate;

pub use registered::{E57, E57Format};
