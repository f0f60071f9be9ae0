//! From a pipeline file to a finished run: parse, plan, run.

mod watch;

pub use watch::{Quiet, Watch};
