//! Formats: one folder each, plain sources and sinks of records.

pub mod las;
pub mod synthetic;
