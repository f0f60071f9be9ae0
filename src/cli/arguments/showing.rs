//! The arguments of commands that show a pipeline and do not run it.

use clap::Args;

use super::{Drawing, PipelineArguments, PlanArguments};

/// Of `plan`.
#[derive(Debug, Args)]
pub(crate) struct PredictArguments {
    #[command(flatten)]
    pub planned: PlanArguments,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Read headers alone: what only a trial on a part of the points can tell is left out
    #[arg(long)]
    pub no_trial: bool,
}

#[derive(Debug, Args)]
pub(crate) struct GraphArguments {
    #[command(flatten)]
    pub pipeline: PipelineArguments,
    /// What it is drawn as
    #[arg(long = "as", value_name = "HOW", default_value = "text")]
    pub drawing: Drawing,
}

#[derive(Debug, Args)]
pub(crate) struct ExplainArguments {
    #[command(flatten)]
    pub pipeline: PipelineArguments,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}
