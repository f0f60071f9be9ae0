//! `reduce --preview`: what several numbers of points and several tolerances would come to.

use std::fmt::Write as _;
use std::time::Instant;

use super::arguments::ReduceArguments;
use super::console::Console;
use super::draw::{Nothing, watched};
use super::reduction::reduction;
use crate::Result;
use crate::budget::Bytes;
use crate::engine::Watch;
use crate::graph::Overrides;
use crate::language::Registry;
use crate::plan::{Plan, Preview, TrialPoints};
use crate::report::{DeviationTotals, Grouped, Short};

/// Points that are tried, about.
const TRIED: usize = 150_000;
/// The shares that are tried, besides what is asked for.
const SHARES: [&str; 4] = ["1%", "5%", "10%", "20%"];
/// The percentiles of the errors of these are the tolerances that are tried: what is rounded.
const TOLERANCES_OF: [usize; 2] = [1, 3];
/// The output that a preview without one is of: it is not written.
const OUTPUT: &str = "preview.laz";

/// What is tried, and what it comes to.
struct PreviewRow {
    label: String,
    preview: Preview,
}

/// Prints a table of what several reductions are expected to come to, in the words of `reduce`.
pub(super) fn preview(
    arguments: &ReduceArguments,
    registry: &Registry,
    console: &Console,
) -> Result<()> {
    console.hear_interrupts();
    let start = Instant::now();
    let mut arguments = arguments.clone();
    if arguments.output.is_none() && arguments.outdir.is_none() {
        arguments.output = Some(OUTPUT.to_owned());
    }
    let plan = reduction(&arguments, registry)?.plan(&Overrides::default())?;
    plan.warnings().iter().for_each(|warning| console.warn(warning));
    let rows = watched(&mut Nothing, &|| console.cancelled(), |watch| {
        let again = reduction(&arguments, registry)?;
        let points = plan.trial_points(&again, TRIED, watch)?;
        Trials { plan: &plan, points, arguments: &arguments, registry, watch }.rows()
    })?;
    if let Some(doubt) = rows.iter().flatten().find_map(|row| doubt(&row.preview)) {
        console.warn(&doubt);
    }
    let took = start.elapsed().as_secs_f64();
    console.result(text(&rows, plan.unit(), plan.outline().points, took).trim_end())
}

/// The trials of a preview.
struct Trials<'a> {
    plan: &'a Plan,
    points: TrialPoints,
    arguments: &'a ReduceArguments,
    registry: &'a Registry,
    watch: &'a dyn Watch,
}

impl Trials<'_> {
    /// The rows of numbers and those of tolerances.
    fn rows(&self) -> Result<[Vec<PreviewRow>; 2]> {
        // With nothing asked for, what the run would choose.
        let none = self.arguments.tolerance.is_none() && !self.arguments.by_cells();
        let asked = self.arguments.keep.as_deref().or(none.then_some("auto"));
        let others =
            SHARES.into_iter().filter(|share| self.arguments.keep.as_deref() != Some(share));
        let numbers: Vec<PreviewRow> =
            others.chain(asked).map(|keep| self.number(keep)).collect::<Result<_>>()?;
        if self.arguments.by_cells() {
            return Ok([numbers, Vec::new()]);
        }
        let percentile = |n: usize| Some(numbers.get(n)?.preview.deviation?.p99);
        let each = TOLERANCES_OF.into_iter().filter_map(percentile).filter_map(rounded);
        let mut tolerances: Vec<String> = each.map(|length| length.to_string()).collect();
        tolerances.extend(self.arguments.tolerance.clone());
        tolerances.dedup();
        let tolerances = tolerances.iter().map(|length| self.tolerance(length));
        let tolerances = tolerances.collect::<Result<_>>()?;
        Ok([numbers, tolerances])
    }

    /// A share is tried as the number that it is of the whole scan.
    fn number(&self, keep: &str) -> Result<PreviewRow> {
        let share = keep.trim().strip_suffix('%').and_then(|percent| percent.trim().parse().ok());
        let all = self.plan.outline().points as f64;
        let number = share.map(|percent: f64| (all * percent / 100.0).round().max(1.0) as u64);
        let of_all = number.map_or_else(|| keep.to_owned(), |number| number.to_string());
        let label = keep.to_owned();
        let row = |keep: String| {
            let arguments = self.arguments.clone();
            self.row(
                label.clone(),
                ReduceArguments { keep: Some(keep), tolerance: None, ..arguments },
            )
        };
        let first = row(of_all)?;
        // What is chosen by the shape is a share of the points that are tried.
        match &first.preview.prediction.trial {
            Some(trial) if keep == "auto" && trial.density < 1.0 => {
                let share = first.preview.kept as f64 / trial.points.max(1) as f64;
                row(((all * share).round().max(1.0) as u64).to_string())
            }
            _ => Ok(first),
        }
    }

    fn tolerance(&self, length: &str) -> Result<PreviewRow> {
        let (tolerance, label) = (Some(length.to_owned()), length.to_owned());
        self.row(label, ReduceArguments { keep: None, tolerance, ..self.arguments.clone() })
    }

    fn row(&self, label: String, arguments: ReduceArguments) -> Result<PreviewRow> {
        let graph = reduction(&arguments, self.registry)?;
        Ok(PreviewRow { label, preview: self.plan.preview(&self.points, graph, self.watch)? })
    }
}

/// The length of one digit, 1, 2 or 5, that is next to another in its ratio.
fn rounded(length: f64) -> Option<f64> {
    let decade = 10f64.powf(length.log10().floor());
    let near = |digit: &f64| (length / (digit * decade)).ln().abs();
    let digits = [1.0, 2.0, 5.0, 10.0].into_iter().filter(|_| length.is_normal() && length > 0.0);
    let digit = digits.min_by(|a, b| near(a).total_cmp(&near(b)))?;
    format!("{:.0e}", digit * decade).parse().ok()
}

/// Why a preview tells little, if it does.
fn doubt(preview: &Preview) -> Option<String> {
    let trial = preview.prediction.trial.as_ref()?;
    trial.is_thin().then(|| {
        format!(
            "points of one place are all over the input, and the trial saw {:.0} % of those in its \
             places: expect errors and numbers somewhat other than these",
            100.0 * trial.density
        )
    })
}

/// The table.
fn text(rows: &[Vec<PreviewRow>; 2], unit: Option<&str>, all: u64, took: f64) -> String {
    let mut out = String::new();
    let trial = rows.iter().flatten().find_map(|row| row.preview.prediction.trial.as_ref());
    let tried = trial.map_or(0, |trial| trial.points);
    let (of, took) = (Grouped(all), Short(took));
    // A String takes all that is written to it.
    let _ = writeln!(out, "{} of {of} points were tried, in {took} s", Grouped(tried));
    let unit = unit.map_or(String::new(), |unit| format!(" {unit}"));
    for (rows, what) in rows.iter().zip(["keep", "tolerance"]).filter(|(rows, _)| !rows.is_empty())
    {
        let _ = writeln!(
            out,
            "\n{what:<11} {:>14} {:>11} {:>11} {:>11} {:>11} {:>9}",
            "points", "size", "RMS error", "95 % ≤", "99 % ≤", "time"
        );
        for PreviewRow { label, preview } in rows {
            let label = match label.parse::<f64>() {
                Ok(_) if what == "tolerance" => format!("{label}{unit}"),
                _ => label.clone(),
            };
            let _ = writeln!(out, "{label:<11} {}", figures(preview, &unit));
        }
    }
    out
}

/// What a row says behind its label.
fn figures(Preview { prediction, deviation, .. }: &Preview, unit: &str) -> String {
    let output = prediction.outputs.first();
    let points = output.and_then(|output| output.points).map(|points| Grouped(points).to_string());
    let size = output.and_then(|output| output.bytes).map(|bytes| Bytes(bytes).to_string());
    let length = |of: fn(&DeviationTotals) -> f64| {
        deviation.as_ref().map_or("-".to_owned(), |all| format!("{}{unit}", Short(of(all))))
    };
    let (rms, p95, p99) = (length(|all| all.rms), length(|all| all.p95), length(|all| all.p99));
    let time = prediction.seconds.map_or("-".to_owned(), |s| format!("{} s", Short(s)));
    let [points, size] = [points, size].map(|text| text.unwrap_or_else(|| "-".to_owned()));
    format!("{points:>14} {size:>11} {rms:>11} {p95:>11} {p99:>11} {time:>9}")
}
