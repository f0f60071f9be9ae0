//! What can be typed.

mod pipeline;
mod plain;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use super::classes::{Classes, parse_classes};
use super::exit::EXIT_CODES;
use super::preset::Preset;
use crate::graph::MOST_THREADS;
use crate::picture::{ColorBy, View};
use crate::quantity::parse_count;

pub(super) use pipeline::{Drawing, ExplainArguments, GraphArguments, PipelineArguments};
pub(super) use plain::{
    CompletionsArguments, InfoArguments, ManArguments, NewArguments, StagesArguments,
};

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
    /// Convert between LAS, LAZ and PLY
    Convert(ConvertArguments),
    /// Show what files contain, from their headers
    Info(InfoArguments),
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
            Command::Run(PlanArguments { common, .. })
            | Command::Plan(PredictArguments { planned: PlanArguments { common, .. }, .. })
            | Command::Check(PlanArguments { common, .. })
            | Command::Convert(ConvertArguments { common, .. })
            | Command::Synth(SynthArguments { common, .. }) => Some(common),
            Command::Info(_) | Command::Picture(_) | Command::Stages(_) => None,
            Command::Graph(_) | Command::Explain(_) | Command::New(_) | Command::Schema => None,
            Command::Completions(_) | Command::Man(_) => None,
        }
    }
}

/// Common to all commands that run a pipeline.
#[derive(Debug, Args)]
#[command(next_help_heading = "Run options")]
pub(super) struct CommonArguments {
    /// Bound of the peak memory, such as 512MiB or 2GiB [default: half of what there is]
    #[arg(long, value_name = "SIZE")]
    pub memory: Option<String>,
    /// Threads that work at once [default: all processors]
    #[arg(long, value_name = "N")]
    pub threads: Option<String>,
    /// Folder for what does not fit in memory [default: beside the output]
    #[arg(long, value_name = "DIR")]
    pub scratch: Option<String>,
    /// Progress on stderr: bars where it is a terminal, one JSON event a line, or none
    #[arg(long, value_name = "HOW", default_value = "auto")]
    pub progress: Progress,
    /// Print errors only
    #[arg(short, long, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Print what the plan and the stages decided, how long each phase took, and what the memory
    /// was for
    #[arg(short, long)]
    pub verbose: bool,
    /// Write the report to this file
    #[arg(long, value_name = "FILE")]
    pub report: Option<String>,
    /// Replace no file: refuse the run, with exit code 1, if an output or the report exists
    #[arg(long)]
    pub no_clobber: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Progress {
    Auto,
    Json,
    Never,
}

/// A whole number within bounds, as the keys of a pipeline take it.
fn within(text: &str, least: u64, most: u64) -> Result<u64, String> {
    let right = parse_count(text).ok().filter(|number| (least..=most).contains(number));
    right.ok_or_else(|| format!("takes a whole number from {least} to {most}"))
}

fn parse_threads(text: &str) -> Result<usize, String> {
    within(text, 1, MOST_THREADS as u64).map(|threads| threads as usize)
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
pub(super) struct ReduceArguments {
    /// LAS, LAZ or PLY files, patterns or folders
    #[arg(value_name = "IN", required = true)]
    pub inputs: Vec<String>,
    /// The reduced file: .las, .laz or .ply
    #[arg(short, long, value_name = "OUT", required_unless_present = "outdir")]
    pub output: Option<String>,
    /// One reduced file for each input instead, in this folder, under the input's name and header;
    /// neighbours are found across the inputs
    #[arg(long, value_name = "DIR", conflicts_with = "output")]
    pub outdir: Option<String>,
    /// Format: las, laz or ply [default: by extension; in a folder, that of each input]
    #[arg(long, value_name = "FORMAT")]
    pub to: Option<String>,
    /// Settings for a kind of scan, or those of the published method (paper); other options take
    /// the place of a preset's [default: by the noise and the spacing of the scan; the run says
    /// what it chose]
    #[arg(long, value_name = "KIND")]
    pub preset: Option<Preset>,
    /// Instead of a number of points: the largest range of normal angles in a cell, in radians, as
    /// 6deg, or auto, by the noise
    #[arg(long, value_name = "ANGLE")]
    pub max_angle: Option<String>,
    /// How many points are to stay: 10%, 250k, 1e6, or auto, as many as the noise asks for
    /// [default: auto]
    #[arg(long, value_name = "TARGET", conflicts_with = "max_angle")]
    pub keep: Option<String>,
    /// Nearest other positions that a normal is computed from; auto takes 10 or, where there is
    /// noise, 20 [default: auto]
    #[arg(long, value_name = "K")]
    pub neighbors: Option<String>,
    /// Side of the cells before any split: a length, auto, or spread evenly [default: spread]
    #[arg(long, value_name = "SIDE")]
    pub side: Option<String>,
    /// A cell with this many points or fewer is not split [default: 1]
    #[arg(long, value_name = "N")]
    pub min_points: Option<String>,
    /// Largest side of a cell that is kept whole: in the scan's unit, as 2m, or none [default:
    /// none]
    #[arg(long, value_name = "LENGTH")]
    pub max_side: Option<String>,
    /// No cell of this length or less is split: in the scan's unit, as 5cm, auto or none [default:
    /// auto]
    #[arg(long, value_name = "LENGTH")]
    pub min_spacing: Option<String>,
    /// What the angles of a cell are measured to: axis, one direction for all, or cone, the cell's
    /// own [default: cone]
    #[arg(long, value_name = "HOW")]
    pub measure: Option<String>,
    /// The direction of `--measure axis`: x, y, z or a vector such as 0,0,1 [default: x]
    #[arg(long, value_name = "AXIS")]
    pub reference: Option<String>,
    /// How a cell is split: voronoi or octant [default: voronoi]
    #[arg(long, value_name = "HOW")]
    pub split: Option<String>,
    /// How a normal is computed: varady or pca [default: varady]
    #[arg(long, value_name = "HOW")]
    pub method: Option<String>,
    /// Remove points that are far from all others before anything else, as a stage `outliers` does
    #[arg(long)]
    pub outliers: bool,
    /// Reduce what is left again, until it was reduced this often [default: 1]
    #[arg(long, value_name = "N")]
    pub passes: Option<String>,
    /// Mark the decision in the records and write them all: key-point, withheld, or class 7 or 18
    #[arg(long, value_name = "HOW")]
    pub mark: Option<String>,
    /// Order of the records: canonical, a function of the points alone, or input, that of the
    /// inputs [default: canonical]
    #[arg(long, value_name = "HOW", conflicts_with = "outdir")]
    pub order: Option<String>,
    /// Reduce the points of these classes alone, such as 2,6; all others stay, and are not seen as
    /// neighbours
    #[arg(long, value_name = "CLASSES", value_delimiter = ',', value_parser = parse_classes)]
    pub classes: Vec<Classes>,
    /// Points of classes 7 and 18, which are noise: drop them, keep them as points like all others,
    /// or ignore them and write them as they are [default: drop; ignore with --mark; keep where
    /// --classes or --keep-classes names one of them]
    #[arg(long, value_name = "HOW")]
    pub noise: Option<String>,
    #[command(flatten)]
    pub filter: FilterArguments,
    /// Points with the withheld flag: drop them, keep them as points like all others, or ignore
    /// them and write them as they are [default: drop]
    #[arg(long, value_name = "HOW")]
    pub withheld: Option<String>,
    /// Points whose coordinates are not finite: refuse the scan, or drop them [default: refuse]
    #[arg(long, value_name = "HOW")]
    pub nonfinite: Option<String>,
    /// Length of a step of the lattice on which points are compared, in the scan's unit, for scans
    /// far from their origin or finer than it. Sides that are chosen follow from it, and with them
    /// how many points stay [default: what the coordinates are stored in, for floats 2^-30]
    #[arg(long, value_name = "NUMBER")]
    pub lattice: Option<String>,
    /// Scans whose points contradict their LAS header, as damaged ones do: refuse them, or warn
    /// [default: refuse]
    #[arg(long, value_name = "HOW")]
    pub headers: Option<String>,
    /// What z is multiplied by where distances are measured, or auto: by what the units of the
    /// reference system say; the records keep their z [default: 1, and scans of mixed units are
    /// refused]
    #[arg(long, value_name = "FACTOR")]
    pub z_scale: Option<String>,
    #[command(flatten)]
    pub written: WrittenArguments,
    #[command(flatten)]
    pub common: CommonArguments,
}

/// Which points are left out as they are read.
#[derive(Debug, Args)]
pub(super) struct FilterArguments {
    /// Keep the points of these classes alone, such as 2,6
    #[arg(long, value_name = "CLASSES", value_delimiter = ',', value_parser = parse_classes)]
    pub keep_classes: Vec<Classes>,
    /// Leave the points of these classes out, such as 7,18
    #[arg(long, value_name = "CLASSES", value_delimiter = ',', value_parser = parse_classes)]
    pub drop_classes: Vec<Classes>,
}

/// How the output is written.
#[derive(Debug, Args)]
pub(super) struct WrittenArguments {
    /// Scale of LAS coordinates, or three for X, Y and Z [default: the input's; PLY to LAS must say
    /// it]
    #[arg(long, value_name = "SCALE")]
    pub scale: Option<String>,
    /// Offset of LAS coordinates on each axis [default: the input's, or 0]
    #[arg(long, value_name = "X,Y,Z")]
    pub offset: Option<String>,
    /// Dimensions that may get lost, such as GpsTime,UserData
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub drop: Vec<String>,
    /// Encoding of PLY: ascii or binary [default: the input's]
    #[arg(long, value_name = "HOW")]
    pub encoding: Option<String>,
    /// Bits of a colour where LAS becomes PLY: 8bit, 16bit, or auto: 8 where that loses nothing
    /// [default: auto]
    #[arg(long, value_name = "BITS")]
    pub colors: Option<String>,
}

#[derive(Debug, Args)]
pub(super) struct ConvertArguments {
    /// LAS, LAZ or PLY files, patterns or folders
    #[arg(value_name = "IN", required = true)]
    pub inputs: Vec<String>,
    /// A file, which takes all inputs, or a folder (that exists, or with a slash behind), which
    /// takes one output an input
    #[arg(short, long, value_name = "OUT|DIR")]
    pub output: String,
    /// Format: las, laz or ply [default: by extension; in a folder, the input's]
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
    pub written: WrittenArguments,
    #[command(flatten)]
    pub common: CommonArguments,
}

#[derive(Debug, Args)]
pub(super) struct PictureArguments {
    /// LAS, LAZ or PLY files, patterns or folders: a scan each, drawn side by side, 4 at most.
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
    #[command(flatten)]
    pub common: CommonArguments,
}
