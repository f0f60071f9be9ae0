//! The repository itself: what imports what, what its pages say, and what users are told.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic and tell why")]

mod docs;
mod house;
mod support;
mod wrong;
