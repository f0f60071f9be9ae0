//! The check of stages, checked: pointmill's own stages keep their promises, wrong ones are found.
//! Has the allocator by which the check measures memory.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic and tell why")]

mod promises;

#[global_allocator]
static COUNTING: pointmill::testing::CountingAllocator = pointmill::testing::CountingAllocator;
