//! `validate`: files held to the rules of their formats.

use std::path::Path;

use serde_json::{Value, json};

use super::arguments::ValidateArguments;
use super::console::Console;
use super::print;
use crate::engine::Watch;
use crate::error::{listed, shown};
use crate::io::ends::expand_any;
use crate::report::Grouped;
use crate::stage::{Finding, Formats, PLACES_TOLD, PointWalk, Severity, WalkProgress};
use crate::{Error, ErrorKind, Result, io};

/// How much can matter, in the order in which it is counted.
const SEVERITIES: [Severity; 3] = [Severity::Fault, Severity::Warning, Severity::Note];

/// Prints what is wrong with files; fails if one has a fault, once all were looked at.
pub(super) fn validate(
    arguments: &ValidateArguments,
    formats: &Formats,
    console: &Console,
) -> Result<()> {
    let files = expand_any(&arguments.files, formats)?;
    let (total, walk) = (files.len(), arguments.walk.walk());
    let (mut all, mut faulty) = (Vec::new(), Vec::new());
    for file in files {
        let (findings, format) = console.watched(None, |watch| {
            let walk = PointWalk { progress: Some(&Looked(watch)), ..walk };
            io::validate(&file, formats, &walk)
        })?;
        if findings.have_faults() {
            faulty.push(file.clone());
        }
        let findings = findings.sorted();
        match (arguments.quiet, arguments.json) {
            (true, _) => {}
            (false, true) => all.push(as_json(&file, format, &findings)?),
            (false, false) => print::result(as_text(&file, &findings))?,
        }
    }
    if arguments.json && !arguments.quiet {
        print::json(&format!("{:#}", Value::Array(all)))?;
    }
    let Some(first) = faulty.first() else { return Ok(()) };
    let error = match faulty.len() {
        1 => Error::new(ErrorKind::Data, "the file has faults").at(first),
        n => Error::new(ErrorKind::Data, format!("{n} of {total} files have faults")),
    };
    Err(match arguments.quiet {
        true => error.help("without --quiet they are told"),
        false => error,
    })
}

/// Tells a watch how far the look at a file is.
struct Looked<'a>(&'a dyn Watch);

impl WalkProgress for Looked<'_> {
    fn begin(&self, points: u64) {
        self.0.phase("validate", Some(points));
    }

    fn advance(&self, points: u64) {
        self.0.advance(points);
    }
}

/// How many findings there are of each severity.
fn counts(findings: &[Finding]) -> [(Severity, usize); 3] {
    let count = |severity| findings.iter().filter(|f| f.rule.severity == severity).count();
    SEVERITIES.map(|severity| (severity, count(severity)))
}

fn as_json(file: &Path, format: Option<&str>, findings: &[Finding]) -> Result<Value> {
    let failed = |e| Error::internal("findings could not be written as JSON").because(e);
    let [faults, warnings, notes] = counts(findings).map(|(_, count)| count);
    Ok(json!({
        "file": shown(file).to_string(),
        "format": format,
        "valid": faults == 0,
        "faults": faults,
        "warnings": warnings,
        "notes": notes,
        "findings": serde_json::to_value(findings).map_err(failed)?,
    }))
}

fn as_text(file: &Path, findings: &[Finding]) -> String {
    let told = counts(findings).into_iter().filter(|(_, count)| *count > 0);
    let told = told.map(|(severity, count)| match count {
        1 => format!("1 {}", severity.name()),
        _ => format!("{count} {}s", severity.name()),
    });
    let told: Vec<String> = told.collect();
    let head = match told.is_empty() {
        true => "nothing is wrong".to_owned(),
        false => listed(told, "and"),
    };
    let mut text = format!("{}: {head}", shown(file));
    for Finding { rule, count, places } in findings {
        text += &format!("\n  {:7}  {} ({})", rule.severity.name(), rule.clause, rule.name);
        for place in places {
            let byte = place.byte.map(|byte| format!("at byte {byte}"));
            let point = place.point.map(|point| format!("point {point}"));
            let place_told: Vec<String> = byte.into_iter().chain(point).collect();
            let begin = match place_told.is_empty() {
                true => String::new(),
                false => format!("{}: ", place_told.join(", ")),
            };
            text += &format!("\n           {begin}{}", place.found.replace('\n', " "));
        }
        if *count > PLACES_TOLD as u64 {
            text += &format!("\n           and {} more", Grouped(count - places.len() as u64));
        }
        text += &format!("\n           should be: {}", rule.should);
    }
    text
}
