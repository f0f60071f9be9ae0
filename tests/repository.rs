//! The repository itself: what imports what, and what its pages say.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic and tell why")]

mod docs;
mod house;
mod support;
