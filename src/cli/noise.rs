//! A tolerance below the noise of a scan keeps nearly all of it: said before the run, by a trial on
//! a part of the scan, with the tolerance that would do.

use super::console::Console;
use super::draw::{Nothing, watched};
use crate::engine::Watch;
use crate::graph::{Graph, GraphStage};
use crate::ops::Graded;
use crate::plan::{Plan, TrialPoints};
use crate::quantity::Length;
use crate::report::Grouped;
use crate::stage::{Role, StageKind};
use crate::{Error, Result};

/// Points that are tried.
const TRIED: usize = 60_000;
/// Where a larger share of the points is expected to stay, the user hears it.
const MOST: f64 = 0.5;
/// The tolerance is looked for at which this share stays.
const WANTED: f64 = 0.1;
/// Steps towards it are of this factor.
const STEP: f64 = 2.0;
/// So many at most: of a tolerance a thousand times as large no more is said.
const STEPS: u32 = 10;

/// Warns if `tolerance`, that of the pipeline that `again` makes, of which `plan` is a plan, keeps
/// most points.
pub(super) fn warn_of_noise(
    tolerance: Length,
    plan: &Plan,
    again: &dyn Fn() -> Result<Graph>,
    console: &Console,
) -> Result<()> {
    let first = again()?;
    let points = plan.outline().points;
    let warning = watched(&mut Nothing, &|| console.cancelled(), |watch| {
        match plan.trial_points_if_any(&first, TRIED, watch)? {
            Some(some) => NoiseTrials { plan, again, some, watch }.warning(tolerance, points),
            None => Ok(None),
        }
    })?;
    warning.iter().for_each(|warning| console.warn(warning));
    Ok(())
}

/// The tolerance of the one stage that has one and no number besides, which would bound what it
/// keeps. None where several have one.
pub(super) fn tolerance_of(graph: &Graph) -> Result<Option<Length>> {
    let mut all = graph.stages.iter().filter(|stage| is_certain(stage));
    match (all.next(), all.next()) {
        (Some(stage), None) => Ok(keys(stage)?.tolerance),
        _ => Ok(None),
    }
}

/// True for a stage that works towards a tolerance alone.
fn is_certain(stage: &GraphStage) -> bool {
    let has = |key: &str| stage.keys.get(key).is_some_and(|value| !value.is_null());
    stage.kind == Graded::KIND && has("tolerance") && !has("keep")
}

fn keys(stage: &GraphStage) -> Result<Graded> {
    let failed =
        |e| Error::internal("the keys of `graded` are not as they were written").because(e);
    serde_json::from_value(stage.keys.clone()).map_err(failed)
}

/// Trials with several tolerances.
struct NoiseTrials<'a> {
    plan: &'a Plan,
    again: &'a dyn Fn() -> Result<Graph>,
    some: TrialPoints,
    watch: &'a dyn Watch,
}

impl NoiseTrials<'_> {
    fn warning(&self, tolerance: Length, points: u64) -> Result<Option<String>> {
        let share = self.share(tolerance, 1.0)?;
        if share <= MOST {
            return Ok(None);
        }
        let (kept, percent) = (Grouped((share * points as f64).round() as u64), 100.0 * share);
        let (mut before, mut loose) = ((1.0, share), None);
        for n in 1..=STEPS {
            let factor = STEP.powi(n as i32);
            let share = self.share(tolerance, factor)?;
            if share <= WANTED {
                loose = Some(between(before, (factor, share)));
                break;
            }
            before = (factor, share);
        }
        let wanted = 100.0 * WANTED;
        let would = match loose.and_then(|factor| tolerance.about_times(factor)) {
            Some(loose) => format!("`{}` keeps about {wanted:.0} %", setting(loose)),
            None => format!("no tolerance up to a thousand times of it keeps {wanted:.0} %"),
        };
        let of = Grouped(points);
        Ok(Some(format!(
            "`{}` is finer than the noise or the spacing of the scan: about {kept} of {of} points \
             ({percent:.0} %) are expected to stay; {would}",
            setting(tolerance)
        )))
    }

    /// The share of the points that stays with a tolerance so many times as large.
    fn share(&self, tolerance: Length, factor: f64) -> Result<f64> {
        let mut graph = (self.again)()?;
        for stage in graph.stages.iter_mut().filter(|stage| is_certain(stage)) {
            let tolerance =
                if factor == 1.0 { Some(tolerance) } else { tolerance.about_times(factor) };
            let mut graded = keys(stage)?;
            graded.tolerance = tolerance;
            stage.role = Role::RoundOp(Box::new(graded));
        }
        let preview = self.plan.preview(&self.some, graph, self.watch)?;
        let tried = preview.prediction.trial.map_or(1, |trial| trial.points).max(1);
        Ok(preview.kept as f64 / tried as f64)
    }
}

/// The setting, as messages name it.
fn setting(tolerance: Length) -> String {
    match tolerance.has_unit() {
        true => format!("graded.tolerance = \"{tolerance}\""),
        false => format!("graded.tolerance = {tolerance}"),
    }
}

/// The factor at which the share would be what is wanted, between two that were tried: of powers.
fn between((low, more): (f64, f64), (high, less): (f64, f64)) -> f64 {
    let part = (more / WANTED).ln() / (more / less.max(1e-9)).ln();
    low * (high / low).powf(part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_two_tolerances_shares_are_powers() {
        // A share that falls with the square: four times the tolerance keeps a sixteenth.
        let wanted = between((1.0, 0.4), (4.0, 0.025));
        assert!((wanted - 2.0).abs() < 1e-12, "{wanted}");
        assert!((between((1.0, 0.4), (2.0, 0.1)) - 2.0).abs() < 1e-12);
    }
}
