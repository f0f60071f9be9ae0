//! Runs of several passes.

mod branches;
mod exact;
mod lossless;
mod same_bytes;
