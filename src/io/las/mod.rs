//! LAS 1.0 to 1.4 and LAZ, every point format: records byte for byte, headers and variable length
//! records carried. Knows no tiles and no stages but the two roles it plays.
//!
//! [`open`] reads one or several files as a source, [`create`] writes a sink, [`describe`] tells
//! what a file says of itself. A COPC file is read as the LAZ it is.

mod chunks;
mod credit;
mod crs;
mod describe;
mod described;
mod encode;
mod extra;
mod fields;
mod file;
mod format;
mod guard;
mod header;
mod input;
mod laz;
mod merge;
mod native;
mod own;
mod read;
mod sink;
mod source;
mod system;
mod table;
mod text;
mod union;
mod verify;
mod vlr;
mod waveforms;

pub use describe::{Description, ExtraBytes, Record, describe};
pub use format::layout;
pub use native::{fresh, records_beside, waveforms_of};
pub use own::{Shifted, own_form};
pub use read::Shift;
pub use sink::{LasOptions, chunk, create};
pub use source::open;
pub use waveforms::beside;
