//! The arguments of `compare`.

use clap::{Args, ValueEnum};

use super::shared::CommonArguments;
use crate::compare::MOST_PIXELS;
use crate::ops::Axis;
use crate::quantity::parse_count;

#[derive(Debug, Args)]
pub(crate) struct CompareArguments {
    /// A scan: a file of points, a pattern or a folder
    #[arg(value_name = "FIRST")]
    pub first: String,
    /// Another, over the same place
    #[arg(value_name = "SECOND")]
    pub second: String,
    /// The axis that one looks along
    #[arg(long, value_name = "AXIS", default_value = "z")]
    pub axis: AxisName,
    /// Pixels along the longer side of the box of both, 1 to 32768
    #[arg(long, value_name = "N", default_value = "1024", value_parser = pixels)]
    pub pixels: u64,
    /// Points of classes 7 and 18, which are noise: drop, so that they are not looked at, or keep
    /// [default: drop]
    #[arg(long, value_name = "HOW")]
    pub noise: Option<String>,
    /// Points with the withheld flag: drop, so that they are not looked at, or keep [default: drop]
    #[arg(long, value_name = "HOW")]
    pub withheld: Option<String>,
    /// Points whose coordinates are not finite: refuse the scan, or drop them [default: refuse]
    #[arg(long, value_name = "HOW")]
    pub nonfinite: Option<String>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub common: CommonArguments,
}

/// An axis as it is typed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum AxisName {
    X,
    Y,
    Z,
}

impl From<AxisName> for Axis {
    fn from(name: AxisName) -> Axis {
        match name {
            AxisName::X => Axis::X,
            AxisName::Y => Axis::Y,
            AxisName::Z => Axis::Z,
        }
    }
}

fn pixels(text: &str) -> Result<u64, String> {
    let right = parse_count(text).ok().filter(|n| (1..=MOST_PIXELS as u64).contains(n));
    right.ok_or_else(|| format!("takes a whole number from 1 to {MOST_PIXELS}"))
}
