//! What can be typed.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::pipeline::{Overrides, Set, parse_bytes};
use crate::point::parse_count;
use crate::{Error, Result};

const EXIT_CODES: &str = "\
Exit codes:
  0    done
  1    the run failed: I/O, bad data, over budget
  2    the command or the pipeline is wrong
  130  interrupted

Results go to stdout, progress and messages to stderr.";

/// Reduces laser scans that do not fit in memory to the points that matter.
#[derive(Debug, Parser)]
#[command(name = "pointmill", version, after_help = EXIT_CODES, propagate_version = true)]
pub(super) struct Arguments {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Run a pipeline file
    Run(Run),
    /// Reduce scans to the points that matter: a run of pipelines/reduce.toml
    Reduce(Box<Reduce>),
    /// Convert between LAS, LAZ and PLY: a run of pipelines/convert.toml
    Convert(Convert),
    /// Say what the headers of files say
    Info(Info),
    /// Show how a pipeline would be run, without a run
    Plan(Plan),
    /// Say whether a pipeline is right, or every mistake: reads its inputs' headers, writes nothing
    Check(Plan),
    /// List the stages that a pipeline can have, with their keys
    Stages(Stages),
    /// Make a scan up
    Synth(Synth),
}

impl Command {
    /// What commands that plan or run a pipeline have in common.
    pub fn common(&self) -> Option<&Common> {
        match self {
            Command::Reduce(reduce) => Some(&reduce.common),
            Command::Run(Run { common, .. })
            | Command::Convert(Convert { common, .. })
            | Command::Plan(Plan { common, .. })
            | Command::Check(Plan { common, .. })
            | Command::Synth(Synth { common, .. }) => Some(common),
            Command::Info(_) | Command::Stages(_) => None,
        }
    }
}

/// Common to all commands that run a pipeline.
#[derive(Debug, Args)]
#[command(next_help_heading = "Run options")]
pub(super) struct Common {
    /// Bound of the peak memory, such as 512MiB or 2GiB [default: half of what there is]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub memory: Option<u64>,
    /// Threads that work at once [default: all processors]
    #[arg(long, value_name = "N", value_parser = parse_threads)]
    pub threads: Option<NonZeroUsize>,
    /// Folder for what does not fit in memory [default: beside the output]
    #[arg(long, value_name = "DIR")]
    pub scratch: Option<PathBuf>,
    /// Progress on stderr: bars where it is a terminal, one JSON event a line, or none
    #[arg(long, value_name = "HOW", default_value = "auto")]
    pub progress: Progress,
    /// Say nothing but errors
    #[arg(short, long, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say what the plan and the stages decided, and how long each phase took
    #[arg(short, long)]
    pub verbose: bool,
    /// Write the report to this file
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Replace no file: refuse the run, with exit code 1, if an output or the report exists
    #[arg(long)]
    pub no_clobber: bool,
}

impl Common {
    /// What takes the place of the pipeline's `[run]` settings. The report is not among it: see
    /// [`sets`](Common::sets).
    pub fn overrides(&self) -> Overrides {
        Overrides {
            memory: self.memory,
            threads: self.threads,
            scratch: self.scratch.clone(),
            report: None,
        }
    }

    /// Values put in the place of the pipeline's: `--report`, so that it is compared with the
    /// inputs and outputs, and `--no-clobber`.
    pub fn sets(&self) -> Result<Vec<Set>> {
        let mut sets = Vec::new();
        if let Some(path) = &self.report {
            let told = || Error::pipeline("the name is not UTF-8 text").at(path);
            let text = path.to_str().ok_or_else(told)?;
            sets.push(Set::argument("--report", "run.report", text.into()));
        }
        if self.no_clobber {
            sets.push(Set::argument("--no-clobber", "run.existing", "refuse".into()));
        }
        Ok(sets)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Progress {
    Auto,
    Json,
    Never,
}

fn parse_threads(text: &str) -> Result<NonZeroUsize, String> {
    let refused = |_| format!("`{text}` is no number of threads: give 1 or more, or leave it out");
    text.parse().map_err(refused)
}

/// One number for all axes, or three for X, Y and Z.
#[derive(Debug, Clone)]
pub(super) struct Axes(pub Vec<f64>);

fn parse_axes(text: &str) -> Result<Axes, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    match numbers {
        Ok(numbers) if [1, 3].contains(&numbers.len()) => Ok(Axes(numbers)),
        _ => Err(format!("`{text}` is neither a number nor three with commas between them")),
    }
}

#[derive(Debug, Args)]
pub(super) struct Run {
    /// The pipeline file
    #[arg(value_name = "PIPELINE")]
    pub pipeline: PathBuf,
    /// Put a value in the place of the file's: the stage by its name or kind (KIND.N, from 1, where
    /// there are several), or `run`
    #[arg(long = "set", value_name = "STAGE.KEY=VALUE")]
    pub sets: Vec<String>,
    #[command(flatten)]
    pub common: Common,
}

#[derive(Debug, Args)]
pub(super) struct Plan {
    /// The pipeline file
    #[arg(value_name = "PIPELINE")]
    pub pipeline: PathBuf,
    /// Put a value in the place of the file's, as in `run`
    #[arg(long = "set", value_name = "STAGE.KEY=VALUE")]
    pub sets: Vec<String>,
    #[command(flatten)]
    pub common: Common,
}

#[derive(Debug, Args)]
pub(super) struct Reduce {
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
    /// Format of the files in that folder: las, laz or ply [default: that of each input]
    #[arg(long, value_name = "FORMAT", requires = "outdir")]
    pub to: Option<String>,
    /// Largest range of normal angles in a cell, in radians or as 6deg [default: 0.1]
    #[arg(long, value_name = "ANGLE")]
    pub max_angle: Option<String>,
    /// Instead of an angle: how many points are to stay, such as 10% or 5M
    #[arg(long, value_name = "TARGET", conflicts_with = "max_angle")]
    pub keep: Option<String>,
    /// Nearest other positions that a normal is computed from [default: 10]
    #[arg(long, value_name = "K")]
    pub neighbors: Option<u64>,
    /// Side of the cells before any split, in the scan's unit [default: auto]
    #[arg(long, value_name = "SIDE")]
    pub side: Option<String>,
    /// A cell with this many points or fewer is not split [default: 1]
    #[arg(long, value_name = "N")]
    pub min_points: Option<u64>,
    /// Largest side of a cell that is kept whole, in the scan's unit [default: none]
    #[arg(long, value_name = "LENGTH")]
    pub max_side: Option<f64>,
    /// No cell of this length or less is split, in the scan's unit [default: none]
    #[arg(long, value_name = "LENGTH")]
    pub min_spacing: Option<f64>,
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
    pub passes: Option<u64>,
    /// Mark the decision in the records and write them all: key-point, withheld, or class 7 or 18
    #[arg(long, value_name = "HOW")]
    pub mark: Option<String>,
    /// Reduce the points of these classes alone, such as 2,6; all others stay, and are not seen as
    /// neighbours
    #[arg(long, value_name = "CLASSES", value_delimiter = ',')]
    pub classes: Vec<u8>,
    /// Points with the withheld flag: drop them, keep them as points like all others, or ignore them
    /// and write them as they are [default: drop]
    #[arg(long, value_name = "HOW")]
    pub withheld: Option<String>,
    /// Points whose coordinates are not finite: refuse the scan, or drop them [default: refuse]
    #[arg(long, value_name = "HOW")]
    pub nonfinite: Option<String>,
    /// What z is multiplied by where distances are measured, or auto: by what the units of the
    /// reference system say; the records keep their z [default: 1, and scans of mixed units are
    /// refused]
    #[arg(long, value_name = "FACTOR")]
    pub z_scale: Option<String>,
    #[command(flatten)]
    pub written: Written,
    #[command(flatten)]
    pub common: Common,
}

/// How the output is written.
#[derive(Debug, Args)]
pub(super) struct Written {
    /// Scale of LAS coordinates, or three for X, Y and Z [default: the input's; PLY to LAS must say it]
    #[arg(long, value_name = "SCALE", allow_hyphen_values = true, value_parser = parse_axes)]
    pub scale: Option<Axes>,
    /// Offset of LAS coordinates on each axis [default: the input's, or 0]
    #[arg(long, value_name = "X,Y,Z", value_delimiter = ',', allow_hyphen_values = true)]
    pub offset: Vec<f64>,
    /// Dimensions that may get lost, such as GpsTime,UserData
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub drop: Vec<String>,
    /// Encoding of PLY: ascii or binary [default: the input's]
    #[arg(long, value_name = "HOW")]
    pub encoding: Option<String>,
}

#[derive(Debug, Args)]
pub(super) struct Convert {
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
    #[command(flatten)]
    pub written: Written,
    #[command(flatten)]
    pub common: Common,
}

#[derive(Debug, Args)]
pub(super) struct Info {
    /// LAS, LAZ or PLY files, patterns or folders
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<String>,
    /// Print a JSON list with one object a file
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub(super) struct Stages {
    /// One stage, or `run` for the settings above all stages
    #[arg(value_name = "KIND")]
    pub kind: Option<String>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub(super) struct Synth {
    /// What is scanned: plane, part, sphere, squares-random, squares-uniform or als
    #[arg(value_name = "KIND")]
    pub scene: String,
    /// How many points, such as 1500, 10k, 5M or 1e6
    #[arg(short = 'n', long = "points", value_name = "N", value_parser = parse_count)]
    pub points: u64,
    /// The file: .las, .laz or .ply
    #[arg(short, long, value_name = "OUT")]
    pub output: String,
    /// Equal seeds give equal scans [default: 0]
    #[arg(long, value_name = "SEED")]
    pub seed: Option<u64>,
    /// Standard deviation of the noise in world units [default: the scene's own]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub noise: Option<f64>,
    #[command(flatten)]
    pub common: Common,
}
