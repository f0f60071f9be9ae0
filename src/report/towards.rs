//! The lines of the closing table about what was asked of `graded`: which number of points the knee
//! was, and whether a tolerance holds.

use std::fmt;

use serde_json::Value;

use super::digits::{Grouped, Long};
use super::document::Outcome;

/// What exceptions from a tolerance are counted as.
const EXCEPTIONS: &str = "graded_exceptions";

/// The lines about a branch, with the sign of the unit that lengths are in.
pub(super) fn towards_lines(
    f: &mut fmt::Formatter<'_>,
    result: &Outcome,
    unit: Option<&str>,
) -> fmt::Result {
    let decided = |name: &str| {
        let is = |d: &&super::Decision| d.stage == "graded" && d.name == name;
        result.decisions.iter().find(is).map(|decision| &decision.value)
    };
    if let (Some(keep), Some(tried)) =
        (decided("keep").and_then(Value::as_u64), decided("tried").and_then(Value::as_array))
    {
        knee_line(f, keep, tried, unit)?;
    }
    let Some(&exceptions) = result.counts.get(EXCEPTIONS) else {
        let is_keep = decided("ended_by").and_then(Value::as_str) == Some("keep");
        return match is_keep {
            true => write!(f, "\ntolerance  does not hold: it takes more points than may stay"),
            false => Ok(()),
        };
    };
    let deviation = result.totals.as_ref().and_then(|totals| totals.deviation);
    let largest = deviation.map_or(0.0, |deviation| deviation.max);
    write!(f, "\ntolerance  holds: no removed point is farther than {}", Long(largest, unit))?;
    write!(f, " from the surface; {} points stay as exceptions", Grouped(exceptions))
}

/// Which number was chosen, and the errors of those that were tried.
fn knee_line(
    f: &mut fmt::Formatter<'_>,
    keep: u64,
    tried: &[Value],
    unit: Option<&str>,
) -> fmt::Result {
    let errors = || tried.iter().filter_map(|one| one["mean_error"].as_f64());
    let still_falls = errors().nth_back(1).zip(errors().next_back()).is_some_and(|(a, b)| b < a);
    let why = match tried.iter().any(|one| one["points"].as_u64() == Some(keep)) {
        true => "by the shape: mean errors are ",
        false if still_falls => "the most that are chosen: mean errors still fall, ",
        false => "as many as the spacing takes: mean errors are ",
    };
    write!(f, "\nchosen     {} points, {why}", Grouped(keep))?;
    for (n, one) in tried.iter().enumerate() {
        let (Some(points), Some(error)) = (one["points"].as_u64(), one["mean_error"].as_f64())
        else {
            continue;
        };
        let before = if n == 0 { "" } else { ", " };
        write!(f, "{before}{} with {}", Long(error, unit), Grouped(points))?;
    }
    Ok(())
}
