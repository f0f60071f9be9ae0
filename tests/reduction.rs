//! What becomes of points: the stages, alone and in chains, over tiles and passes, and the report of
//! them.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic and tell why")]

mod cells;
mod normals;
mod passes;
mod report;
mod stages;
mod support;
