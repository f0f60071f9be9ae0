//! Formats: one folder each, plain sources and sinks of records.

pub mod convert;
pub mod ply;
pub mod synthetic;
