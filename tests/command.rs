//! Whole runs, mostly of the command as a user starts it: arguments and pipeline files, and all that
//! may go wrong.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic and tell why")]

mod cli;
mod dirty;
#[cfg(target_os = "linux")]
mod faults;
mod limits;
mod pipelines;
mod run;
mod support;
