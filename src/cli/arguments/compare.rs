//! The arguments of `compare`.

use clap::{Args, ValueEnum};

use super::shared::CommonArguments;
use crate::compare::{DEPTH_PIXELS, MOST_PIXELS};
use crate::ops::Axis;
use crate::quantity::parse_count;

#[derive(Debug, Args)]
pub(crate) struct CompareArguments {
    /// A scan: a file of points, a pattern or a folder
    #[arg(value_name = "FIRST")]
    pub first: String,
    /// Another, of the same format or another one
    #[arg(value_name = "SECOND")]
    pub second: String,
    /// Measure how far the points of each scan are from the nearest of the other, and from the
    /// plane of its 8 nearest; exact, whatever the size of the scans
    #[arg(long)]
    pub distances: bool,
    /// Measure the angle between the normal of each point and that of the nearest point of the
    /// other scan, without their signs; both must have normals
    #[arg(long)]
    pub normals: bool,
    /// Compare both as depth images, too: sum of squared differences and their RMS
    #[arg(long)]
    pub depth: bool,
    /// The axis that depth images look along, instead of z; implies --depth
    #[arg(long, value_name = "AXIS")]
    pub axis: Option<AxisName>,
    /// Pixels along the longer side of the box of both, 1 to 32768, instead of 1024; implies
    /// --depth
    #[arg(long, value_name = "N", value_parser = pixels)]
    pub pixels: Option<u64>,
    /// Points of classes 7 and 18, which are noise: drop, so that they are not looked at, or keep
    /// [default: keep for records, drop for distances and depth]
    #[arg(long, value_name = "HOW")]
    pub noise: Option<String>,
    /// Points with the withheld flag: drop, so that they are not looked at, or keep [default: as
    /// --noise]
    #[arg(long, value_name = "HOW")]
    pub withheld: Option<String>,
    /// Points whose coordinates are not finite, where distances or depth are measured: refuse the
    /// scan, or drop them, from the records too [default: refuse]
    #[arg(long, value_name = "HOW")]
    pub nonfinite: Option<String>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub common: CommonArguments,
}

impl CompareArguments {
    /// The axis and the pixels of depth images, if they are asked for.
    pub fn depth(&self) -> Option<(Axis, usize)> {
        let is_asked = self.depth || self.axis.is_some() || self.pixels.is_some();
        let axis = self.axis.unwrap_or(AxisName::Z).into();
        is_asked.then(|| (axis, self.pixels.map_or(DEPTH_PIXELS, |pixels| pixels as usize)))
    }
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
