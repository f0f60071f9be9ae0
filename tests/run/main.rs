//! Runs and what may go wrong in them.

#[path = "../run_support/mod.rs"]
mod run_support;

mod edges;
mod threads;
mod trouble;
