//! The pipeline that a command is given, and the arguments of those that show it.

use clap::{Args, ValueEnum};

/// A pipeline, and what is put in the place of its values.
#[derive(Debug, Args)]
pub(crate) struct PipelineArguments {
    /// The pipeline file, in TOML or JSON; or a pipeline in one line, which has ` ! ` between its
    /// stages: 'read in.laz ! normals ! write out.ply'
    #[arg(value_name = "PIPELINE")]
    pub pipeline: String,
    /// Put a value in the place of the pipeline's: the stage by its name or kind (KIND.N, from 1,
    /// where there are several), or `run`
    #[arg(long = "set", value_name = "STAGE.KEY=VALUE")]
    pub sets: Vec<String>,
    /// Give a parameter of the pipeline a value; `--help` behind a pipeline file lists those that
    /// it has
    #[arg(long = "param", value_name = "NAME=VALUE")]
    pub params: Vec<String>,
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

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Drawing {
    /// Lines for a terminal
    Text,
    /// A flowchart for web pages
    Mermaid,
    /// The language of Graphviz
    Dot,
}
