//! LAS 1.0 to 1.5 and LAZ, every point format: records byte for byte, headers and variable length
//! records carried. Knows no tiles and no stages but the two roles it plays.
//!
//! [`open`] reads one or several files as a source; [`LAS`], [`LAZ`] and [`COPC`] are the
//! formats as a registry takes them. A COPC file is read as the LAZ it is.

mod boxed;
mod chunked;
mod chunks;
mod copc;
mod credit;
mod crs;
mod damage;
pub(crate) mod describe;
mod described;
mod encode;
mod extra;
mod extras;
mod fields;
mod file;
mod form;
pub(crate) mod format;
mod found;
mod geokeys;
mod guard;
mod header;
mod held;
pub(crate) mod holding;
mod input;
mod las15;
mod laz;
mod merge;
mod native;
mod noted;
mod own;
mod read;
mod records;
mod registered;
mod reshaped;
pub(crate) mod sink;
mod source;
mod storage;
mod system;
mod table;
mod target;
mod text;
mod union;
mod validate;
mod verify;
mod vlr;
mod waveforms;

pub use format::layout;
pub use native::fresh;
pub use registered::{COPC, LAS, LAZ, LasFormat};
pub use source::open;
