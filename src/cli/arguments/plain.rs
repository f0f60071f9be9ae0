//! The arguments of commands that run no pipeline and share none with others.

use std::path::PathBuf;

use clap::Args;
use clap_complete::Shell;

#[derive(Debug, Args)]
pub(crate) struct NewArguments {
    /// The job; without one, the jobs are listed
    #[arg(value_name = "JOB")]
    pub job: Option<String>,
    /// The file, which must not exist [default: JOB.toml]
    #[arg(short, long, value_name = "FILE", requires = "job")]
    pub output: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct StagesArguments {
    /// One stage, or `run` for the settings above all stages
    #[arg(value_name = "KIND")]
    pub kind: Option<String>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct CompletionsArguments {
    /// The shell
    #[arg(value_name = "SHELL")]
    pub shell: Shell,
}

#[derive(Debug, Args)]
pub(crate) struct ManArguments {
    /// The folder; it is made if it does not exist
    #[arg(value_name = "DIR")]
    pub folder: Option<String>,
}
