//! Formats: one folder each, plain sources and sinks of records.

pub mod convert;
mod describe;
mod epsg;
pub mod las;
mod origin;
pub mod ply;
mod project;
pub(crate) mod sniff;
pub mod synthetic;
mod wkt;

pub use describe::describe;
pub use origin::open_plain;
pub use project::Projected;
pub use sniff::of_extension;
