//! The arguments of `reproduce`.

use std::path::PathBuf;

use clap::Args;

use super::shared::CommonArguments;

#[derive(Debug, Args)]
pub(crate) struct ReproduceArguments {
    /// The output of a run: a file that pointmill wrote
    #[arg(value_name = "OUT")]
    pub output: PathBuf,
    /// Folder where the inputs are [default: where they were from the output's folder]
    #[arg(long, value_name = "FOLDER")]
    pub inputs: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub common: CommonArguments,
}
