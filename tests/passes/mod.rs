//! Runs of several passes.

mod exact;
mod lossless;
mod same_bytes;
