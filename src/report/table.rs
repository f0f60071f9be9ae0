//! The short table that a run prints.

use std::fmt;
use std::path::Path;

use serde_json::Value;

use super::classes::class_name;
use super::digits::{Coordinate, Grouped, Long, Share};
use super::document::{Decision, FileFigures, Outcome, Report};
use super::figures::{BaselineFigures, ClassFigures, DeviationTotals, Pair, PlaneFigures, Totals};
use super::ledger::{Ledger, Removed};
use super::stats::{DimensionFigures, StatsFigures};
use super::tally::KEY_POINTS;
use super::towards::towards_lines;
use crate::budget::Bytes;
use crate::error::shown;

/// A [`Report`] as a few lines for the terminal; lengths in the scan's unit.
pub struct Table<'a> {
    report: &'a Report,
    path: Option<&'a Path>,
    unit: Option<&'a str>,
}

impl<'a> Table<'a> {
    /// The same with this unit behind lengths.
    #[must_use]
    pub fn in_unit(self, unit: Option<&'a str>) -> Self {
        Table { unit, ..self }
    }
}

impl Report {
    /// The report as a few lines for the terminal; `path` is where the whole of it is.
    pub fn table<'a>(&'a self, path: Option<&'a Path>) -> Table<'a> {
        Table { report: self, path, unit: None }
    }
}

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Report { result, further, run } = self.report;
        let all = std::iter::once(result).chain(further);
        for (number, result) in all.enumerate() {
            if number > 0 {
                writeln!(f)?;
            }
            if !further.is_empty() {
                branch_line(f, number, result)?;
            }
            self.result_lines(f, result)?;
        }
        if let Some(peak) = run.peak_memory_bytes {
            write!(f, "\nmemory     {} at most, budget {}", Bytes(peak), Bytes(run.memory_bytes))?;
        }
        time_line(f, self.report)?;
        if run.spill_bytes > 0 {
            write!(f, "\nspill      {}", Bytes(run.spill_bytes))?;
        }
        output_lines(f, &run.outputs)?;
        if let Some(path) = self.path {
            write!(f, "\nreport     {}", shown(path))?;
        }
        writeln!(f)
    }
}

/// Which of several branches the lines below are about: its stages.
fn branch_line(f: &mut fmt::Formatter<'_>, number: usize, result: &Outcome) -> fmt::Result {
    let stages = result.pipeline.as_array().map(Vec::as_slice).unwrap_or_default();
    let kinds = stages.iter().filter_map(|stage| stage.get("kind")?.as_str());
    let kinds: Vec<&str> = kinds.collect();
    writeln!(f, "branch {}   {}", number + 1, kinds.join(" ! "))
}

/// Outputs that have a line each: of more, each folder has one.
const MOST_OUTPUTS: usize = 12;

/// What was written where.
fn output_lines(f: &mut fmt::Formatter<'_>, outputs: &[FileFigures]) -> fmt::Result {
    if outputs.len() <= MOST_OUTPUTS {
        return outputs.iter().try_for_each(|output| {
            write!(f, "\noutput     {}", shown(Path::new(&output.path)))?;
            output.bytes.map_or(Ok(()), |bytes| write!(f, ", {}", Bytes(bytes)))
        });
    }
    let folder = |output: &FileFigures| Path::new(&output.path).parent().map(Path::to_owned);
    outputs.chunk_by(|a, b| folder(a) == folder(b)).try_for_each(|files| {
        let bytes = files.iter().filter_map(|file| file.bytes).sum();
        let folder = folder(&files[0]).filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.as_deref().unwrap_or(Path::new("."));
        write!(f, "\noutput     {} files in {}, {}", files.len(), shown(folder), Bytes(bytes))
    })
}

impl Table<'_> {
    /// What became of the points, on one branch of the pipeline.
    fn result_lines(&self, f: &mut fmt::Formatter<'_>, result: &Outcome) -> fmt::Result {
        let (read, kept) = (result.ledger.read, result.ledger.kept);
        write!(f, "points     {} in, {} out{}", Grouped(read), Grouped(kept), Share(kept, read))?;
        removed_line(f, &result.ledger)?;
        // Where stages remove points besides, marks are not why others are gone.
        let marked = marks(result).next().is_some() && result.ledger.removed_records() == 0;
        class_lines(f, &result.classes, marked)?;
        marked_lines(f, result)?;
        stats_lines(f, &result.stats)?;
        moved_lines(f, result)?;
        if let Some(&cells) = result.counts.get("cells") {
            write!(f, "\ncells      {}", Grouped(cells))?;
            // Passes that compute normals again count the same points again.
            let computed =
                result.passes.iter().filter(|pass| pass.stages.iter().any(|s| s == "normals"));
            if let (Some(&without @ 1..), 1) = (result.counts.get("no_normal"), computed.count()) {
                write!(f, ", and {} points in none: they have no normal, since", Grouped(without))?;
                f.write_str(" their neighbours lie on a line or at one place, and stay")?;
            }
        }
        // One that samples chose is told before the run.
        let is_found = |d: &&Decision| d.stage == "cells" && d.name == "max_angle" && keeps(result);
        for found in result.decisions.iter().filter(is_found) {
            let angle = found.value.as_f64().unwrap_or_default();
            let told = "normals of a cell differ by, for the number of points to keep";
            write!(f, "\nangle      {angle:.4} rad at most: what {told}")?;
        }
        towards_lines(f, result, self.unit)?;
        if let Some(totals) = &result.totals {
            self.totals_lines(f, result, totals)?;
        }
        self.accept_lines(f, result)
    }
}

/// What stages counted: points, and a line for each dimension.
fn stats_lines(f: &mut fmt::Formatter<'_>, stats: &[StatsFigures]) -> fmt::Result {
    for StatsFigures { name, points, dimensions, .. } in stats {
        write!(f, "\n{name:<9}  {} points", Grouped(*points))?;
        let width = dimensions.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
        for (name, figures) in dimensions {
            write!(f, "\n{:9}  {name:width$}  ", "")?;
            let DimensionFigures { min, max, mean, deviation, not_finite, .. } = figures;
            // As many decimals as tell numbers apart that are a thousandth of the deviation apart.
            let digits = deviation.filter(|v| *v > 0.0).map_or(0.0, |v| (3.0 - v.log10()).ceil());
            let decimals = digits.clamp(0.0, 12.0) as usize;
            match (min, max) {
                (Some(min), Some(max)) => write!(f, "{min:.decimals$} to {max:.decimals$}")?,
                _ => f.write_str("no numbers")?,
            }
            if let (Some(mean), Some(deviation)) = (mean, deviation) {
                write!(f, ", mean {mean:.decimals$}, deviation {deviation:.decimals$}")?;
            }
            if *not_finite > 0 {
                write!(f, ", {} not finite", Grouped(*not_finite))?;
            }
        }
    }
    Ok(())
}

/// Points that stages moved or connected, and normals that no stage knows a side of.
fn moved_lines(f: &mut fmt::Formatter<'_>, result: &Outcome) -> fmt::Result {
    for (name, moved) in &result.counts {
        let Some(stage) = name.strip_suffix("_moved") else { continue };
        write!(f, "\nmoved      {} points ({stage})", Grouped(*moved))?;
        if let Some(&held @ 1..) = result.counts.get(format!("{stage}_too_far").as_str()) {
            write!(f, ", and {} stay where they are: they would go farther", Grouped(held))?;
        }
    }
    if let Some(&triangles) = result.counts.get("triangles") {
        let count = |name: &str| Grouped(result.counts.get(name).copied().unwrap_or(0));
        write!(f, "\nmesh       {} triangles, {} corners", Grouped(triangles), count("corners"))?;
        if let Some(&covered @ 1..) = result.counts.get("covered") {
            write!(f, ", {} points in none: they lie above a corner", Grouped(covered))?;
        }
    }
    match result.counts.get("orient_unknown") {
        None | Some(0) => Ok(()),
        Some(&unknown) => write!(
            f,
            "\nnormals    {} stay as they were: nothing tells `orient` their side",
            Grouped(unknown)
        ),
    }
}

/// True if a number of points to keep was asked for.
fn keeps(result: &Outcome) -> bool {
    let stages = result.pipeline.as_array().into_iter().flatten();
    stages.into_iter().any(|stage| !stage["keys"]["keep"].is_null())
}

/// What was removed for other reasons than that another point stands for it.
fn removed_line(f: &mut fmt::Formatter<'_>, ledger: &Ledger) -> fmt::Result {
    let others = |r: &&Removed| !["represented", "coincident"].contains(&r.reason.as_str());
    for (i, Removed { stage, reason, records }) in ledger.removed.iter().filter(others).enumerate()
    {
        let before = if i == 0 { "\nleft out   " } else { ", " };
        let records = Grouped(*records);
        match reason.as_str() {
            "removed" => write!(f, "{before}{records} ({stage})")?,
            _ => write!(f, "{before}{records} {reason} ({stage})")?,
        }
    }
    Ok(())
}

/// The stages that mark, by kind, and how: as they are in the pipeline.
fn marks(result: &Outcome) -> impl Iterator<Item = (&str, &Value)> {
    let stages = result.pipeline.as_array().into_iter().flatten();
    let mark = |stage: &'_ Value| !stage["keys"]["mark"].is_null();
    let stages = stages.filter(move |stage| mark(stage));
    stages.filter_map(|stage| Some((stage["kind"].as_str()?, &stage["keys"]["mark"])))
}

/// How many records each stage marked, and as what.
fn marked_lines(f: &mut fmt::Formatter<'_>, result: &Outcome) -> fmt::Result {
    let count = |name: &str| Grouped(result.counts.get(name).copied().unwrap_or(0));
    let mut key_points = false;
    for (stage, mark) in marks(result) {
        let marked = count(&format!("{stage}_marked"));
        write!(f, "\nmarked     {marked} ")?;
        match mark.as_str() {
            // The flag is set on those that stay, and cleared on what the stage counts.
            Some("key-point") => {
                key_points = true;
                write!(f, "as no key-points by {stage}")?;
            }
            Some(flag) => write!(f, "as {flag} by {stage}")?,
            None => write!(f, "as class {mark} by {stage}")?,
        }
    }
    match key_points {
        true => write!(f, "\nmarked     {} as key-points", count(KEY_POINTS)),
        false => Ok(()),
    }
}

/// A line a class, unless none was reduced: then all say the same as the scan's. Of a scan that is
/// `marked` no point need be gone.
fn class_lines(f: &mut fmt::Formatter<'_>, classes: &[ClassFigures], marked: bool) -> fmt::Result {
    if classes.iter().all(|c| c.before == c.after) {
        return Ok(());
    }
    let name = |class: u8| match class_name(class) {
        Some(name) => format!("{class} {name}"),
        None => class.to_string(),
    };
    let width = classes.iter().map(|c| name(c.class).len()).max().unwrap_or(0);
    for (i, &ClassFigures { class, before, after }) in classes.iter().enumerate() {
        let heading = if i == 0 { "classes" } else { "" };
        write!(f, "\n{heading:9}  {:width$}  ", name(class))?;
        let (share, before, after) = (Share(after, before), Grouped(before), Grouped(after));
        match marked {
            true => write!(f, "{before}, {after} of them stay by their marks{share}")?,
            false => write!(f, "{before} → {after}{share}")?,
        }
    }
    Ok(())
}

/// Deviations are alike up to this factor: one of the two depends on where its cubes lie.
const ABOUT: f64 = 1.02;

impl Table<'_> {
    fn long(&self, length: f64) -> Long<'_> {
        Long(length, self.unit)
    }

    /// What the reduction did to the surface, then how flat the scan is.
    fn totals_lines(
        &self,
        f: &mut fmt::Formatter<'_>,
        result: &Outcome,
        totals: &Totals,
    ) -> fmt::Result {
        self.deviation_line(f, result, totals)?;
        self.baseline_line(f, result, totals)?;
        let planes = [("in tiles", &totals.tile_plane), ("whole scan", &totals.scan_plane)];
        let (mut heading, mut rises) = ("plane RMS", false);
        for (name, plane) in planes {
            if let Pair { before: Some(PlaneFigures { rms: before, .. }), after } = plane {
                write!(f, "\n{heading:9}  {name} {}", self.long(*before))?;
                if let Some(after) = after {
                    write!(f, " → {}", self.long(after.rms))?;
                    rises |= after.rms > *before;
                }
                heading = "";
            }
        }
        if rises && result.ledger.removed_records() > 0 {
            write!(
                f,
                "\n           \
                 (points stay where the surface bends: those lie farther from one plane)"
            )?;
        }
        Ok(())
    }

    /// A line for each rule of what is accepted.
    fn accept_lines(&self, f: &mut fmt::Formatter<'_>, result: &Outcome) -> fmt::Result {
        let rules = result.accept.iter().flat_map(|verdict| &verdict.rules);
        rules.enumerate().try_for_each(|(i, rule)| {
            let heading = if i == 0 { "accept" } else { "" };
            let word = if rule.passed { "PASS" } else { "FAIL" };
            write!(f, "\n{heading:9}  {word}  {}", rule.told(self.unit))
        })
    }

    /// How far removed records are from the surface, and of how many that is known.
    fn deviation_line(
        &self,
        f: &mut fmt::Formatter<'_>,
        result: &Outcome,
        totals: &Totals,
    ) -> fmt::Result {
        let removed = totals.points.before.saturating_sub(totals.points.after);
        let Some(DeviationTotals { points, rms, p95, max, at, .. }) = totals.deviation else {
            let told = removed > 0;
            return if told { write!(f, "\ndeviation  not measured") } else { Ok(()) };
        };
        write!(f, "\ndeviation  RMS {}, 95 % ≤ {}", self.long(rms), self.long(p95))?;
        let step = result.lattice.map_or(0.0, |lattice| lattice.step);
        let [x, y, z] = at.map(|at| Coordinate { at, step });
        write!(f, ", max {} at ({x}, {y}, {z})", self.long(max))?;
        match points < removed {
            true => write!(f, ", of {} of {} removed points", Grouped(points), Grouped(removed)),
            false => Ok(()),
        }
    }

    /// What a voxel grid of as many points would have done, where that was measured; or why it was
    /// not, where points were reduced by their normals.
    fn baseline_line(
        &self,
        f: &mut fmt::Formatter<'_>,
        result: &Outcome,
        totals: &Totals,
    ) -> fmt::Result {
        let Pair { before, after } = totals.points;
        match totals.baseline {
            Some(ref baseline) => {
                let BaselineFigures { side, rms, p95, .. } = *baseline;
                let [side, rms, p95] = [side, rms, p95].map(|length| self.long(length));
                write!(f, "\nbaseline   RMS {rms}, 95 % ≤ {p95}")?;
                write!(f, ": a voxel grid of as many points, cubes of {side}")?;
                let is_less = |of: &DeviationTotals| baseline.rms * ABOUT < of.rms;
                match totals.deviation.as_ref().is_some_and(is_less) {
                    true => f.write_str(", which loses less here"),
                    false => Ok(()),
                }
            }
            None if !result.counts.contains_key("cells") || before == after => Ok(()),
            // The finest grid that is measured keeps three of four positions.
            None if after > before / 4 * 3 => {
                write!(
                    f,
                    "\nbaseline   not measured: a voxel grid of so many points removes hardly any"
                )
            }
            None => {
                write!(f, "\nbaseline   not measured: none of the voxel grids keeps as many points")
            }
        }
    }
}

fn time_line(f: &mut fmt::Formatter<'_>, report: &Report) -> fmt::Result {
    write!(f, "\ntime       {:.1} s", report.run.seconds)?;
    if let Some(cpu) = report.run.cpu_seconds {
        write!(f, " ({cpu:.1} s of CPU)")?;
    }
    for (i, phase) in report.run.phases.iter().enumerate() {
        let before = if i == 0 { ": " } else { ", " };
        write!(f, "{before}{} {:.1}", phase.name, phase.seconds)?;
    }
    Ok(())
}
