//! The arguments that several commands have.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::cli::classes::{Classes, parse_classes};
use crate::graph::MOST_THREADS;
use crate::quantity::parse_count;

/// A whole number within bounds, as the keys of a pipeline take it.
pub(crate) fn within(text: &str, least: u64, most: u64) -> Result<u64, String> {
    let right = parse_count(text).ok().filter(|number| (least..=most).contains(number));
    right.ok_or_else(|| format!("takes a whole number from {least} to {most}"))
}

/// A number of threads.
pub(crate) fn parse_threads(text: &str) -> Result<usize, String> {
    within(text, 1, MOST_THREADS as u64).map(|threads| threads as usize)
}

/// Common to all commands that run a pipeline.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Run options")]
pub(crate) struct CommonArguments {
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
    /// Write the report to this file: as JSON or, if its name ends in .html, as a page that people
    /// hand on, with pictures, maps and curves
    #[arg(long, value_name = "FILE")]
    pub report: Option<String>,
    /// What the result must be, such as "max <= 5mm, p99 <= 2mm, kept >= 10%, lossless": the exit
    /// code is 3 if it is not; what is written is written all the same
    #[arg(long, value_name = "RULES")]
    pub accept: Option<String>,
    /// Replace no file: refuse the run, with exit code 1, if an output or the report exists
    #[arg(long)]
    pub no_clobber: bool,
    /// Outputs do not say how they were made: no pipeline and no hashes of inputs, by which
    /// `reproduce` makes them again
    #[arg(long)]
    pub no_provenance: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Progress {
    Auto,
    Json,
    Never,
}

/// Which points are left out as they are read.
#[derive(Debug, Clone, Args)]
pub(crate) struct FilterArguments {
    /// Keep the points of these classes alone, such as 2,6
    #[arg(long, value_name = "CLASSES", value_delimiter = ',', value_parser = parse_classes)]
    pub keep_classes: Vec<Classes>,
    /// Leave the points of these classes out, such as 7,18
    #[arg(long, value_name = "CLASSES", value_delimiter = ',', value_parser = parse_classes)]
    pub drop_classes: Vec<Classes>,
}

/// How the inputs are read.
#[derive(Debug, Clone, Args)]
pub(crate) struct ReadArguments {
    /// What the columns of a text are, such as x,y,z,intensity; _ for one that is not read
    /// [default: as a heading names them]
    #[arg(long, value_name = "NAMES")]
    pub columns: Option<String>,
    /// Scans of E57 files that are read, by their numbers from 1, such as 1,3 [default: all]
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',')]
    pub scans: Vec<String>,
    /// Format of the inputs, such as txt [default: by extension, else by their first bytes]
    #[arg(long, value_name = "FORMAT")]
    pub from: Option<String>,
    /// Coordinate reference system that all inputs are in, whatever they say: EPSG:25832, with a
    /// vertical one EPSG:25832+7837, or WKT; points stay where they are [default: as they say]
    #[arg(long, value_name = "CRS")]
    pub crs: Option<String>,
    /// Coordinate reference system that points are brought to, by its EPSG code, such as
    /// EPSG:25832; heights stay, or change their unit: EPSG:25832+7837 [default: theirs]
    #[arg(long, value_name = "EPSG")]
    pub reproject: Option<String>,
    /// Where points of LAS, LAZ and COPC are read, in their coordinates; of COPC only that is read:
    /// X0,Y0,X1,Y1 or X0,Y0,Z0,X1,Y1,Z1 [default: everywhere]
    #[arg(long = "box", value_name = "CORNERS", allow_hyphen_values = true)]
    pub bounds: Option<String>,
    /// Distance between points down to which COPC is read, in their unit, such as 0.5 [default: all
    /// points]
    #[arg(long, value_name = "LENGTH")]
    pub resolution: Option<String>,
    /// What is done about damaged files: fail; skip what is damaged, of LAZ whole chunks; or
    /// salvage what can be read, also of damaged chunks. Damaged points of packed PCD and an
    /// E57 file that is cut off are not mended. What is lost is told [default: fail]
    #[arg(long, value_name = "HOW")]
    pub on_error: Option<String>,
    /// What is taken for granted: crs, that inputs which name no coordinate reference system are in
    /// the one that the others name; dimensions, that inputs which lack dimensions that others
    /// have, of LAS extra bytes, hold nothing there; extra-bytes, the same of LAS alone
    #[arg(long, value_name = "WHAT", value_delimiter = ',')]
    pub assume: Vec<String>,
}

/// How the output is written.
#[derive(Debug, Clone, Args)]
pub(crate) struct WrittenArguments {
    /// Scale of LAS coordinates, or three for X, Y and Z, or auto: one that rounds nothing; LAS
    /// inputs that differ are brought to it [default: the input's; PLY to LAS must say it]
    #[arg(long, value_name = "SCALE")]
    pub scale: Option<String>,
    /// Offset of LAS coordinates on each axis, to which LAS inputs that differ are brought, too; or
    /// auto: one near the points where they are out of reach [default: the input's, or 0]
    #[arg(long, value_name = "X,Y,Z")]
    pub offset: Option<String>,
    /// Point format of LAS, 0 to 10, or auto; LAS inputs that differ are brought to it [default:
    /// the input's, or the smallest that holds what there is]
    #[arg(long, value_name = "N")]
    pub point_format: Option<String>,
    /// Dimensions that may get lost, such as GpsTime,UserData, whatever their case
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub drop: Vec<String>,
    /// Dimensions that get another name, such as Amplitude=Intensity
    #[arg(long, value_name = "OLD=NEW", value_delimiter = ',')]
    pub map: Vec<String>,
    /// Types of dimensions in the output, to which values are rounded, such as Amplitude=f32: u8 to
    /// u64, i8 to i64, f32, f64
    #[arg(long = "type", value_name = "NAME=TYPE", value_delimiter = ',')]
    pub types: Vec<String>,
    /// What intensities with fractions are in LAS: unit, parts of 65535 [default: refused]
    #[arg(long, value_name = "HOW")]
    pub intensity: Option<String>,
    /// Encoding of PLY: ascii or binary [default: the input's]
    #[arg(long, value_name = "HOW")]
    pub encoding: Option<String>,
    /// Bits of a colour where LAS becomes another format: 8bit, 16bit, or auto: 8 where that loses
    /// nothing [default: auto]
    #[arg(long, value_name = "BITS")]
    pub colors: Option<String>,
    /// What stands between two numbers of a text: blank, comma, semicolon or tab [default: blank,
    /// comma in CSV]
    #[arg(long, value_name = "MARK")]
    pub separator: Option<String>,
    /// Decimals of coordinates in a text [default: as many as read back equal]
    #[arg(long, value_name = "N")]
    pub decimals: Option<String>,
    /// Whether a text begins with the names of its columns: true or false [default: true where they
    /// are more than coordinates, or CSV]
    #[arg(long, value_name = "BOOL")]
    pub header: Option<bool>,
}

/// Files that are converted at once, at most.
const MOST_JOBS: u64 = 256;

/// How many files are converted, each by itself.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Many files")]
pub(crate) struct BulkArguments {
    /// Files that are converted at once, which share memory and threads [default: as many as
    /// threads where there are many small files, else 1]
    #[arg(long, value_name = "N", value_parser = parse_jobs)]
    pub jobs: Option<usize>,
    /// Leave outputs that say that they were made so, of inputs that have not changed since; those
    /// of another version, or that do not say how they were made (texts), are made again
    #[arg(long, conflicts_with = "no_provenance")]
    pub resume: bool,
    /// Write what became of each file to this one, as JSON
    #[arg(long, value_name = "FILE")]
    pub summary: Option<PathBuf>,
}

fn parse_jobs(text: &str) -> Result<usize, String> {
    within(text, 1, MOST_JOBS).map(|jobs| jobs as usize)
}
