//! The arguments of commands that look at files and make nothing of them.

use clap::Args;

use super::shared::parse_threads;
use crate::graph::parse_bytes;
use crate::stage::PointWalk;

#[derive(Debug, Args)]
pub(crate) struct InfoArguments {
    /// Files of points, patterns or folders
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<String>,
    /// Read all points, and tell what the numbers of each dimension come to, how many points there
    /// are of each return and class, and how dense they are
    #[arg(long)]
    pub deep: bool,
    /// Print a JSON list with one object a file
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub walk: WalkArguments,
}

#[derive(Debug, Args)]
pub(crate) struct ValidateArguments {
    /// Files of points, patterns or folders
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<String>,
    /// Print a JSON list with one object a file
    #[arg(long)]
    pub json: bool,
    /// Print errors only: the exit code says if a file has faults
    #[arg(short, long)]
    pub quiet: bool,
    #[command(flatten)]
    pub walk: WalkArguments,
}

/// How points are read by commands that run no pipeline.
#[derive(Debug, Args)]
pub(crate) struct WalkArguments {
    /// Bound of the peak memory, such as 512MiB or 2GiB [default: half of what there is]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub memory: Option<u64>,
    /// Threads that work at once [default: all processors]
    #[arg(long, value_name = "N", value_parser = parse_threads)]
    pub threads: Option<usize>,
}

impl WalkArguments {
    /// What was given, the defaults for the rest.
    pub fn walk(&self) -> PointWalk<'static> {
        PointWalk::with(self.threads, self.memory)
    }
}
