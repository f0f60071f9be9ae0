//! Runs of several passes.

mod branches;
mod columns;
mod exact;
mod limits;
mod lossless;
mod measured;
mod same_bytes;
