//! `reduce --size`: as many points as a file of that size holds.
//!
//! What a packed point takes depends on the points beside it, so only a run tells how large its
//! output is. The first number is told by a trial on a part of the scan; a run that misses the size
//! leaves nothing behind, and says how many bytes a point took, from which the next number follows.

use super::arguments::ReduceArguments;
use super::console::Console;
use super::draw::{Nothing, watched};
use super::reduction::reduction;
use crate::budget::Bytes;
use crate::engine::Done;
use crate::graph::Overrides;
use crate::language::Registry;
use crate::plan::{FittedSize, Plan};
use crate::report::Grouped;
use crate::{Error, ErrorKind, Result};

/// By how much of it a size may be missed.
const WITHIN: f64 = 0.02;
/// The share of the points that is tried first.
const FIRST: f64 = 0.1;
/// Trials, each with the number that follows from the one before.
const TRIALS: usize = 2;
/// Points that are tried.
const TRIED: usize = 240_000;
/// Runs at most.
const RUNS: usize = 6;

/// Reduces to as many points as `bytes` hold.
pub(super) fn reduce_to_size(
    arguments: &ReduceArguments,
    bytes: u64,
    registry: &Registry,
    console: &Console,
) -> Result<Done> {
    console.hear_interrupts();
    let sized = SizedReduction { arguments, bytes, registry, console };
    let mut keep = sized.first()?;
    let miss = (bytes as f64 * WITHIN) as u64;
    let mut before: Option<(u64, u64)> = None;
    for _ in 0..RUNS {
        let plan = sized.plan(keep)?;
        let all = plan.outline().points;
        // With all points a smaller file is as large as it gets.
        let least = if keep >= all { 0 } else { bytes - miss };
        let (points, took) = match console.run_to_size(plan, least..=bytes.saturating_add(miss))? {
            FittedSize::Done(done) => return Ok(sized.told(*done)),
            FittedSize::Unfit { points, bytes } => (points, bytes),
        };
        let [is, kept] = [Bytes(took).to_string(), Grouped(points).to_string()];
        console.note(format_args!("size     {kept} points take {is}: once more with others"));
        if points <= 1 && took > bytes {
            return Err(sized.too_small(took));
        }
        if points < keep && took < bytes {
            // There are no more positions than these.
            keep = all;
            continue;
        }
        let next = next_number(before, (points, took), bytes);
        before = Some((points, took));
        keep = next.clamp(1, all);
    }
    Err(sized.missed(before))
}

/// The number that takes `wanted` bytes, by the last run and the one before it.
fn next_number(before: Option<(u64, u64)>, (points, took): (u64, u64), wanted: u64) -> u64 {
    let missing = wanted as f64 - took as f64;
    let each = match before {
        Some((other, bytes)) if other != points && bytes != took => {
            (took as f64 - bytes as f64) / (points as f64 - other as f64)
        }
        _ => took as f64 / points.max(1) as f64,
    };
    let next = points as f64 + missing / each.max(0.01);
    // Numbers far from what was measured are not to be trusted.
    next.clamp(0.2 * points as f64, 5.0 * points as f64).round() as u64
}

struct SizedReduction<'a> {
    arguments: &'a ReduceArguments,
    bytes: u64,
    registry: &'a Registry,
    console: &'a Console,
}

impl SizedReduction<'_> {
    fn arguments(&self, keep: u64) -> ReduceArguments {
        ReduceArguments { keep: Some(keep.to_string()), ..self.arguments.clone() }
    }

    fn plan(&self, keep: u64) -> Result<Plan> {
        reduction(&self.arguments(keep), self.registry)?.plan(&Overrides::default())
    }

    /// The first number: what plain records are, or by a trial on some points.
    fn first(&self) -> Result<u64> {
        let plan = self.plan(1)?;
        let all = plan.outline().points.max(1);
        if let Some(bytes) = plan.plain_bytes()? {
            return Ok((self.bytes / bytes).clamp(1, all));
        }
        let guess = |number: u64| number.clamp(1, all);
        let again = reduction(&self.arguments(1), self.registry)?;
        watched(&mut Nothing, &|| self.console.cancelled(), |watch| {
            let mut number = guess((all as f64 * FIRST) as u64);
            let Some(some) = plan.trial_points_if_any(&again, TRIED, watch)? else {
                return Ok(number);
            };
            for _ in 0..TRIALS {
                let graph = reduction(&self.arguments(number), self.registry)?;
                let preview = plan.preview(&some, graph, watch)?;
                let output = preview.prediction.outputs.first();
                let (Some(points), Some(bytes)) =
                    (output.and_then(|o| o.points), output.and_then(|o| o.bytes))
                else {
                    break;
                };
                let each = bytes as f64 / points.max(1) as f64;
                number = guess((self.bytes as f64 / each.max(0.01)) as u64);
            }
            Ok(number)
        })
    }

    /// The same run, with a word where all points take less.
    fn told(&self, done: Done) -> Done {
        let took: u64 = done.report.run.outputs.iter().filter_map(|output| output.bytes).sum();
        if (took as f64) < self.bytes as f64 * (1.0 - WITHIN) {
            let (all, size) = (Bytes(took), Bytes(self.bytes));
            self.console.warn(&format!("all points take {all}, which is less than {size}"));
        }
        done
    }

    fn too_small(&self, took: u64) -> Error {
        let (least, size) = (Bytes(took), Bytes(self.bytes));
        let told = format!("an output with one point takes {least}, and `--size` is {size}");
        Error::new(ErrorKind::Data, told).help("give a larger `--size`")
    }

    fn missed(&self, last: Option<(u64, u64)>) -> Error {
        let (points, took) = last.unwrap_or_default();
        let (points, took, size) = (Grouped(points), Bytes(took), Bytes(self.bytes));
        let told = format!(
            "no number of points was found whose output takes {size} within 2 %: the last, \
             {points}, takes {took}"
        );
        Error::new(ErrorKind::Data, told).help("give another `--size`, or a number by `--keep`")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_number_follows_from_what_points_took() {
        // 1000 bytes of a header, 10 a point.
        assert_eq!(next_number(None, (100, 2_000), 3_000), 150);
        assert_eq!(next_number(Some((100, 2_000)), (150, 2_500), 3_000), 200);
        assert_eq!(next_number(None, (100, 2_000), 1_000_000), 500);
        assert_eq!(next_number(None, (100, 200_000), 1), 20);
    }
}
