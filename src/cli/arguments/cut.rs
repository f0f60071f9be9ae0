//! The arguments of `cut`.

use clap::Args;

use super::shared::CommonArguments;

#[derive(Debug, Args)]
pub(crate) struct CutArguments {
    /// A reduction that was made with `--ranks`: a file of points
    #[arg(value_name = "IN")]
    pub input: String,
    /// The coarser reduction: .las, .laz or .ply
    #[arg(short, long, value_name = "OUT")]
    pub output: String,
    /// How many of its points stay: 10%, 250k or 1e6; or about how far from each other they are, as
    /// a length with its unit: 2mm
    #[arg(long, value_name = "TARGET", required_unless_present = "spacing")]
    pub keep: Option<String>,
    /// The same length in the scan's unit, where the scan does not say which that is: 0.002
    #[arg(long, value_name = "LENGTH", conflicts_with = "keep")]
    pub spacing: Option<String>,
    #[command(flatten)]
    pub common: CommonArguments,
}
