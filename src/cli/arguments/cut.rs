//! The arguments of `cut`.

use clap::Args;

use super::shared::CommonArguments;

#[derive(Debug, Args)]
pub(crate) struct CutArguments {
    /// A reduction that was made with `--ranks`: a LAS, LAZ or PLY file
    #[arg(value_name = "IN")]
    pub input: String,
    /// The coarser reduction: .las, .laz or .ply
    #[arg(short, long, value_name = "OUT")]
    pub output: String,
    /// How many of its points stay: 10%, 250k or 1e6
    #[arg(long, value_name = "TARGET")]
    pub keep: String,
    #[command(flatten)]
    pub common: CommonArguments,
}
