//! Runs of several passes.

#[path = "../common/mod.rs"]
mod common;

mod branches;
mod exact;
mod lossless;
mod same_bytes;
