//! What can be typed.

mod compare;
mod cut;
mod look;
mod pipeline;
mod plain;
mod reduce;
mod reproduce;
mod shared;
mod verify;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

use super::exit::EXIT_CODES;
use crate::picture::{ColorBy, View};

pub(super) use compare::CompareArguments;
pub(super) use cut::CutArguments;
pub(super) use look::{InfoArguments, ValidateArguments};
pub(super) use pipeline::{Drawing, ExplainArguments, GraphArguments, PipelineArguments};
pub(super) use plain::{CompletionsArguments, ManArguments, NewArguments, StagesArguments};
pub(super) use reduce::ReduceArguments;
pub(super) use reproduce::ReproduceArguments;
pub(super) use shared::{
    BulkArguments, CommonArguments, FilterArguments, Progress, ReadArguments, WrittenArguments,
};
use shared::{parse_threads, within};
pub(super) use verify::VerifyArguments;

/// Reduces laser scans that do not fit in memory to the points that matter.
#[derive(Debug, Parser)]
#[command(name = "pointmill", version, after_help = EXIT_CODES, propagate_version = true)]
pub(super) struct Arguments {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Run a pipeline: a file, or one line
    Run(PlanArguments),
    /// Reduce scans to the points that matter
    Reduce(Box<ReduceArguments>),
    /// Convert between LAS, LAZ, COPC, PLY, PCD, E57 and texts
    Convert(Box<ConvertArguments>),
    /// Show what files contain, from their headers or, with --deep, from all points
    Info(InfoArguments),
    /// Hold files to the rules of their formats, and tell each that does not hold
    Validate(ValidateArguments),
    /// Show how a pipeline would be run and what the run would use, without running it
    Plan(PredictArguments),
    /// Check a pipeline and tell every mistake; reads its inputs' headers, writes nothing
    Check(PlanArguments),
    /// List the stages that a pipeline can have, with their keys
    Stages(StagesArguments),
    /// Draw the graph of a pipeline; its inputs are not opened
    Graph(GraphArguments),
    /// Print a pipeline with every key of every stage, and where each value is from
    Explain(ExplainArguments),
    /// Write a commented pipeline file for a job, to be changed
    New(NewArguments),
    /// Print the JSON Schema of pipeline files, by which editors complete and check them
    Schema,
    /// Cut a coarser reduction off one that has ranks, without computing anything
    Cut(CutArguments),
    /// Check that a scan is a reduction of another, and how far removed points are from its surface
    Verify(Box<VerifyArguments>),
    /// Compare two scans: are the records the same, how far apart are the points
    Compare(Box<CompareArguments>),
    /// Run again what made a file, and say whether the bytes are the same
    Reproduce(ReproduceArguments),
    /// Draw scans side by side, from above or from a side
    Picture(PictureArguments),
    /// Make a synthetic scan
    Synth(SynthArguments),
    /// Print what a shell needs to complete commands and flags
    Completions(CompletionsArguments),
    /// Print the manual page, or write those of all commands into a folder
    Man(ManArguments),
}

impl Command {
    /// The pipeline of commands that take one.
    pub fn pipeline(&self) -> Option<&PipelineArguments> {
        match self {
            Command::Run(all) | Command::Check(all) => Some(&all.pipeline),
            Command::Plan(PredictArguments { planned, .. }) => Some(&planned.pipeline),
            Command::Graph(graph) => Some(&graph.pipeline),
            Command::Explain(explain) => Some(&explain.pipeline),
            _ => None,
        }
    }

    /// What commands that plan or run a pipeline have in common.
    pub fn common(&self) -> Option<&CommonArguments> {
        match self {
            Command::Reduce(reduce) => Some(&reduce.common),
            Command::Convert(convert) => Some(&convert.common),
            Command::Verify(verify) => Some(&verify.common),
            Command::Compare(compare) => Some(&compare.common),
            Command::Cut(cut) => Some(&cut.common),
            Command::Reproduce(reproduce) => Some(&reproduce.common),
            Command::Run(PlanArguments { common, .. })
            | Command::Plan(PredictArguments { planned: PlanArguments { common, .. }, .. })
            | Command::Check(PlanArguments { common, .. })
            | Command::Synth(SynthArguments { common, .. }) => Some(common),
            Command::Info(_) | Command::Validate(_) | Command::Picture(_) => None,
            Command::Stages(_) => None,
            Command::Graph(_) | Command::Explain(_) | Command::New(_) | Command::Schema => None,
            Command::Completions(_) | Command::Man(_) => None,
        }
    }
}

/// Of commands that plan a pipeline, or run it.
#[derive(Debug, Args)]
pub(super) struct PlanArguments {
    #[command(flatten)]
    pub pipeline: PipelineArguments,
    #[command(flatten)]
    pub common: CommonArguments,
}

/// Of `plan`.
#[derive(Debug, Args)]
pub(super) struct PredictArguments {
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
pub(super) struct ConvertArguments {
    /// Files of points, patterns or folders, or @LIST: a text with one of them a line; or - for
    /// standard input
    #[arg(value_name = "IN", required = true)]
    pub inputs: Vec<String>,
    /// A file, which takes all inputs, or a folder (that exists, or with a slash behind), which
    /// takes one output an input; or - for standard output, with --to
    #[arg(short, long, value_name = "OUT|DIR")]
    pub output: String,
    /// Format, such as laz, ply or csv [default: by extension; in a folder, the input's]
    #[arg(long, value_name = "FORMAT")]
    pub to: Option<String>,
    /// Points whose coordinates are not finite: drop them, or refuse to write them where the output
    /// cannot hold them; PLY can [default: refuse]
    #[arg(long, value_name = "HOW")]
    pub nonfinite: Option<String>,
    /// Scans whose points contradict their LAS header, as damaged ones do: refuse them, or warn
    /// [default: refuse]
    #[arg(long, value_name = "HOW")]
    pub headers: Option<String>,
    #[command(flatten)]
    pub filter: FilterArguments,
    #[command(flatten)]
    pub read: ReadArguments,
    #[command(flatten)]
    pub written: WrittenArguments,
    #[command(flatten)]
    pub bulk: BulkArguments,
    #[command(flatten)]
    pub common: CommonArguments,
}

#[derive(Debug, Args)]
pub(super) struct PictureArguments {
    /// Files of points, patterns or folders: a scan each, drawn side by side, 4 at most.
    /// Quote a pattern, so that its files are one scan
    #[arg(value_name = "IN", required = true)]
    pub inputs: Vec<String>,
    /// The picture: a .png file
    #[arg(short, long, value_name = "OUT")]
    pub output: PathBuf,
    /// From where the scans are seen
    #[arg(long, value_name = "WHERE", default_value = "above")]
    pub from: View,
    /// What points are coloured by
    #[arg(long, value_name = "WHAT", default_value = "height")]
    pub by: ColorBy,
    /// Pixels that the picture is wide, 64 to 4096
    #[arg(long, value_name = "PIXELS", default_value = "1600", value_parser = parse_width)]
    pub width: u32,
    /// Threads that work at once [default: all processors]
    #[arg(long, value_name = "N", value_parser = parse_threads)]
    pub threads: Option<usize>,
}

fn parse_width(text: &str) -> Result<u32, String> {
    within(text, 64, 4096).map(|width| width as u32)
}

#[derive(Debug, Args)]
pub(super) struct SynthArguments {
    /// What is scanned: plane, part, sphere, squares-random, squares-uniform or als
    #[arg(value_name = "KIND")]
    pub scene: String,
    /// How many points, such as 1500, 10k, 5M or 1e6
    #[arg(short = 'n', long = "points", value_name = "N")]
    pub points: String,
    /// The file: .las, .laz or .ply
    #[arg(short, long, value_name = "OUT")]
    pub output: String,
    /// Equal seeds give equal scans [default: 0]
    #[arg(long, value_name = "SEED")]
    pub seed: Option<String>,
    /// Standard deviation of the noise in world units [default: the scene's own]
    #[arg(long, value_name = "NUMBER")]
    pub noise: Option<String>,
    /// What squares are projected on: relief, plane, cap, step or freeform [default: relief]
    #[arg(long, value_name = "OBJECT")]
    pub front: Option<String>,
    /// Where the noise of squares goes: depth, or space for all three directions [default: depth]
    #[arg(long, value_name = "WHERE")]
    pub noise_in: Option<String>,
    /// The share of squares that are far from the object, 0 to 1 [default: 0]
    #[arg(long, value_name = "SHARE")]
    pub outliers: Option<String>,
    #[command(flatten)]
    pub common: CommonArguments,
}
