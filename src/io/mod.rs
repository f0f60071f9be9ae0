//! Formats: one folder each, plain sources and sinks of records.

mod describe;

pub use describe::describe;
