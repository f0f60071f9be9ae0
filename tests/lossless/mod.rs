//! Nothing is lost.

#[path = "../scans_support/mod.rs"]
mod scans_support;

mod edges;
mod records;
