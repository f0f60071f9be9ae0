//! The arguments of `verify`.

use clap::Args;

use super::shared::CommonArguments;
use crate::quantity::Length;

#[derive(Debug, Args)]
pub(crate) struct VerifyArguments {
    /// The original: files of points, patterns or folders; and last the reduced scan, one
    /// file
    #[arg(value_name = "ORIGINAL... REDUCED", required = true)]
    pub inputs: Vec<String>,
    /// How far from the surface of the points that were kept no other may be: in the scan's unit,
    /// or as 5mm
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    pub tolerance: Option<Length>,
    /// How far from the nearest point that was kept no other may be: in the scan's unit, or as
    /// 50cm. Points farther away than four times that play no part in the surface
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    pub max_spacing: Option<Length>,
    /// Points of the original of classes 7 and 18, which are noise: drop, so that they are not
    /// measured, or keep [default: drop]
    #[arg(long, value_name = "HOW")]
    pub noise: Option<String>,
    /// Points of the original with the withheld flag: drop, so that they are not measured, or keep
    /// [default: drop]
    #[arg(long, value_name = "HOW")]
    pub withheld: Option<String>,
    /// Points of the original whose coordinates are not finite: refuse the scan, or drop them
    /// [default: refuse]
    #[arg(long, value_name = "HOW")]
    pub nonfinite: Option<String>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub common: CommonArguments,
}

impl VerifyArguments {
    /// The reduced scan, if there is one beside the original, and the files of that.
    pub fn files(&self) -> (Option<&str>, &[String]) {
        match self.inputs.split_last() {
            Some((reduced, original)) if !original.is_empty() => (Some(reduced), original),
            _ => (None, &self.inputs),
        }
    }
}

/// A length as it is typed.
fn length(text: &str) -> Result<Length, String> {
    let number = text.parse().ok().and_then(Length::of);
    let takes = || "takes a length above 0, in the scan's unit or such as 5cm".to_owned();
    number.or_else(|| Length::read(text)).ok_or_else(takes)
}
