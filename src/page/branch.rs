//! A branch of the pipeline on the page: what was asked, what came of it, and where every record
//! went.

use std::io::BufRead;

use serde_json::Value;

use super::map::{DrawnMap, TileMap};
use super::worst::WorstTiles;
use super::{chart, scenes, words};
use crate::report::{
    BaselineFigures, DeviationTotals, Outcome, PlaneFigures, RuleVerdict, TileFigures, class_name,
};
use crate::{Error, Result};

/// A branch as the page shows it.
pub(super) struct BranchView {
    /// Its number and stages where there are several; else empty.
    pub heading: String,
    /// The figures that are told first, each with what it is.
    pub numbers: Vec<[String; 2]>,
    pub rules: Vec<RuleView>,
    /// Stages with their settings: kind, key and value.
    pub stages: Vec<StageView>,
    /// What stages settled by themselves.
    pub decisions: Vec<[String; 2]>,
    /// How far removed points are off: what, of this run, of a voxel grid.
    pub deviations: Vec<[String; 3]>,
    pub farthest: String,
    pub measured: String,
    /// What is said of the voxel grid.
    pub baseline: String,
    pub has_baseline: bool,
    pub chart: String,
    pub maps: Vec<MapView>,
    pub planes: Vec<[String; 3]>,
    /// What became of records: what, how many, the part of all.
    pub ledger: Vec<[String; 3]>,
    pub classes: Vec<[String; 4]>,
}

/// A rule and what it came to.
pub(super) struct RuleView {
    pub rule: String,
    pub found: String,
    pub passed: bool,
}

/// A stage and its settings.
pub(super) struct StageView {
    pub kind: String,
    pub keys: Vec<[String; 2]>,
}

/// A map with its scale.
pub(super) struct MapView {
    pub title: &'static str,
    pub map: DrawnMap,
    pub most: String,
    pub class: &'static str,
    pub told: String,
}

/// What the tiles of a branch come to.
pub(super) struct Tiles {
    pub map: TileMap,
    pub worst: WorstTiles,
}

impl Tiles {
    /// From the lines of the tiles; None if the branch has none.
    pub fn read(result: &Outcome, lines: &mut dyn BufRead) -> Result<Option<Tiles>> {
        let (Some(side), Some(lattice)) = (result.tile_side, result.lattice) else {
            return Ok(None);
        };
        let [x, y, _] = lattice.shift;
        let mut tiles = Tiles { map: TileMap::new(side, [x, y]), worst: WorstTiles::default() };
        for line in lines.lines() {
            let line = line.map_err(|e| match e.downcast::<Error>() {
                Ok(error) => error,
                Err(e) => Error::internal("a line of the report could not be read").because(e),
            })?;
            let tile: TileFigures = serde_json::from_str(&line)
                .map_err(|e| Error::internal("a line of the report is no tile").because(e))?;
            tiles.map.add(&tile);
            tiles.worst.add(&tile);
        }
        Ok(Some(tiles))
    }
}

impl BranchView {
    /// Of a branch that came to `result`, number `n` of `all`.
    pub fn of(
        result: &Outcome,
        tiles: Option<&Tiles>,
        (n, all): (usize, usize),
        unit: Option<&str>,
    ) -> Result<BranchView> {
        let stages = stages(&result.pipeline);
        let kinds: Vec<&str> = stages.iter().map(|stage| stage.kind.as_str()).collect();
        let heading = match all {
            1 => String::new(),
            _ => format!("Branch {}: {}", n + 1, kinds.join(", ")),
        };
        let deviation = result.totals.and_then(|totals| totals.deviation);
        let baseline = result.totals.and_then(|totals| totals.baseline);
        let rules = result.accept.iter().flat_map(|verdict| &verdict.rules);
        Ok(BranchView {
            heading,
            numbers: numbers(result, unit),
            rules: rules.map(|rule| rule_view(rule, unit)).collect(),
            decisions: decisions(result),
            deviations: deviations(deviation, baseline, unit),
            farthest: deviation.map_or(String::new(), |d| scenes::coordinates(d.at, result)),
            measured: measured(result, deviation),
            has_baseline: baseline.is_some(),
            baseline: baseline.map_or(String::new(), |baseline| told_grid(&baseline, unit)),
            chart: deviation.map_or(String::new(), |d| {
                let step = result.lattice.map_or(1.0, |lattice| lattice.step);
                chart::svg((&result.deviations, step), &d, unit)
            }),
            maps: tiles.map_or(Ok(Vec::new()), |tiles| maps(&tiles.map, unit))?,
            planes: planes(result, unit),
            ledger: ledger(result),
            classes: classes(result),
            stages,
        })
    }
}

/// The stages with the settings that they have.
fn stages(pipeline: &Value) -> Vec<StageView> {
    let stages = pipeline.as_array().map(Vec::as_slice).unwrap_or_default();
    let view = |stage: &Value| {
        let keys = stage.get("keys").and_then(Value::as_object).into_iter().flatten();
        let is_said = |value: &Value| !value.is_null() && value.as_array() != Some(&Vec::new());
        let keys = keys.filter(|(_, value)| is_said(value));
        StageView {
            kind: stage.get("kind").map(words::value).unwrap_or_default(),
            keys: keys.map(|(key, value)| [words::plain(key), words::value(value)]).collect(),
        }
    };
    stages.iter().map(view).collect()
}

fn numbers(result: &Outcome, unit: Option<&str>) -> Vec<[String; 2]> {
    let (read, kept) = (result.ledger.read, result.ledger.kept);
    let number = |what: &str, told: String| [told, what.to_owned()];
    let mut all = vec![
        number("points read", words::count(read)),
        number("points kept", words::count(kept)),
        number("of all", words::percent(kept, read)),
    ];
    if let Some(deviation) = result.totals.and_then(|totals| totals.deviation) {
        all.push(number("RMS deviation", words::length(deviation.rms, unit)));
        all.push(number("largest deviation", words::length(deviation.max, unit)));
    }
    all
}

fn rule_view(rule: &RuleVerdict, unit: Option<&str>) -> RuleView {
    let found = match (rule.is_length(), rule.found) {
        (true, Some(found)) => words::length(found, unit),
        (false, Some(found)) => words::count(found as u64),
        (_, None) if rule.passed => "as read, byte for byte".to_owned(),
        (_, None) => "not measured".to_owned(),
    };
    RuleView { rule: rule.rule.clone(), found, passed: rule.passed }
}

fn decisions(result: &Outcome) -> Vec<[String; 2]> {
    let told = |value: &Value| match value.as_f64() {
        Some(number) if !value.is_u64() && !value.is_i64() => format!("{number}"),
        _ => words::value(value),
    };
    let each = result.decisions.iter();
    each.map(|d| [format!("{}: {}", d.stage, words::plain(&d.name)), told(&d.value)]).collect()
}

fn deviations(
    of: Option<DeviationTotals>,
    baseline: Option<BaselineFigures>,
    unit: Option<&str>,
) -> Vec<[String; 3]> {
    let Some(of) = of else { return Vec::new() };
    let grid = |pick: fn(&BaselineFigures) -> f64| {
        baseline.as_ref().map_or(String::new(), |grid| words::length(pick(grid), unit))
    };
    let row = |what: &str, length: f64, grid: String| {
        [what.to_owned(), words::length(length, unit), grid]
    };
    vec![
        row("root of the mean square", of.rms, grid(|grid| grid.rms)),
        row("half deviate no more than", of.p50, grid(|grid| grid.p50)),
        row("95 % deviate no more than", of.p95, grid(|grid| grid.p95)),
        row("99 % deviate no more than", of.p99, grid(|grid| grid.p99)),
        row("the largest", of.max, String::new()),
    ]
}

/// Of how many removed points deviations are known.
fn measured(result: &Outcome, deviation: Option<DeviationTotals>) -> String {
    let removed = result.ledger.removed_records();
    match deviation {
        Some(of) if of.points < removed => {
            let (points, removed) = (words::count(of.points), words::count(removed));
            format!(
                "Measured of {points} of the {removed} removed points: nothing stands for the \
                     others, which stages were asked to leave out."
            )
        }
        Some(_) => "Measured of all removed points.".to_owned(),
        None => String::new(),
    }
}

fn told_grid(baseline: &BaselineFigures, unit: Option<&str>) -> String {
    let side = words::length(baseline.side, unit);
    format!(
        "The baseline is what a voxel grid of as many points would have left: one point of each \
             cube of {side}, the one nearest to its middle."
    )
}

fn maps(map: &TileMap, unit: Option<&str>) -> Result<Vec<MapView>> {
    let side = words::length(map.column_side(), unit);
    let mut all = Vec::new();
    if let Some(drawn) = map.deviations()? {
        let most = words::length(drawn.most, unit);
        let told = format!("The largest deviation in each square of {side}.");
        let title = "Where it is off";
        all.push(MapView { title, map: drawn, most, class: "errors", told });
    }
    if let Some(drawn) = map.densities()? {
        let unit = unit.map_or("unit of area".to_owned(), |unit| format!("{unit}²"));
        let most = format!("{}/{unit}", crate::report::Short(drawn.most));
        let told = format!("Kept points for each {unit}, in squares of {side}.");
        let title = "Where points were kept";
        all.push(MapView { title, map: drawn, most, class: "densities", told });
    }
    Ok(all)
}

fn planes(result: &Outcome, unit: Option<&str>) -> Vec<[String; 3]> {
    let Some(totals) = result.totals else { return Vec::new() };
    let told = |figures: Option<PlaneFigures>| {
        figures.map_or("–".to_owned(), |figures| words::length(figures.rms, unit))
    };
    let pairs = [("in its tile", totals.tile_plane), ("of the whole scan", totals.scan_plane)];
    pairs.map(|(what, pair)| [what.to_owned(), told(pair.before), told(pair.after)]).into()
}

fn ledger(result: &Outcome) -> Vec<[String; 3]> {
    let ledger = &result.ledger;
    let row = |what: String, records: u64| {
        [what, words::count(records), words::percent(records, ledger.read)]
    };
    let removed = ledger.removed.iter().map(|removed| {
        let told = match removed.reason.as_str() {
            "removed" => format!("removed by {}", removed.stage),
            reason => format!("removed by {}: {reason}", removed.stage),
        };
        row(told, removed.records)
    });
    let first = [row("read".to_owned(), ledger.read)];
    first.into_iter().chain(removed).chain([row("kept".to_owned(), ledger.kept)]).collect()
}

fn classes(result: &Outcome) -> Vec<[String; 4]> {
    let row = |of: &crate::report::ClassFigures| {
        let name = class_name(of.class).unwrap_or_default();
        let name = format!("{} {name}", of.class).trim_end().to_owned();
        let share = words::percent(of.after, of.before);
        [name, words::count(of.before), words::count(of.after), share]
    };
    result.classes.iter().map(row).collect()
}
