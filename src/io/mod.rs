//! Formats: one folder each, plain sources and sinks of records.

pub mod convert;
mod describe;
pub mod las;
pub mod ply;
pub mod synthetic;

pub use describe::describe;
