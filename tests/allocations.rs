//! What is allocated, measured by an allocator of their own: one test at a time.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic and tell why")]

mod memory;
mod support;

#[global_allocator]
static COUNTED: support::allocator::Counted = support::allocator::Counted;
