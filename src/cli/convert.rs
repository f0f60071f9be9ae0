//! `convert`: all inputs to one file, or each to its own.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::arguments::ConvertArguments;
use super::console::Console;
use super::flags::{common_flags, convert_flags, given, one_form};
use super::mistyped::marked;
use super::pipeline::{HIDDEN, with_stages};
use super::run::{finish, mill};
use crate::budget::Bytes;
use crate::engine::{Done, make_folder, refuse_existing};
use crate::error::{listed, shown};
use crate::graph::Existing;
use crate::graph::Graph;
use crate::host::{Clash, Files, Use};
use crate::io::ends::{expand_any, unreadable};
use crate::language::Registry;
use crate::report::Grouped;
use crate::stage::Formats;
use crate::{Error, ErrorKind, Result};

/// The pipeline of `convert`, which users copy.
const CONVERT: &str = include_str!("../../pipelines/convert.toml");

/// Converts all inputs into one file, or each into a file of its own in a folder; prints a closing
/// table.
pub(super) fn convert(
    arguments: &ConvertArguments,
    registry: &Registry,
    console: &Console,
) -> Result<()> {
    let (folder, formats) = (Path::new(&arguments.output), registry.formats());
    if !(arguments.output.ends_with('/') || folder.is_dir()) {
        let one = pipeline(arguments, json!(arguments.inputs), json!(arguments.output), registry);
        return finish(&mill(one?, console)?, console);
    }
    let (inputs, odd): (Vec<PathBuf>, Vec<PathBuf>) = expand_any(&arguments.inputs, formats)?
        .into_iter()
        .partition(|input| input.to_str().is_some());
    if let ([], [first, ..]) = (&inputs[..], &odd[..]) {
        return Err(unreadable(first));
    }
    if inputs.len() > 1 && arguments.common.report.is_some() {
        let told = "--report: is for one output, and this makes several";
        let report = arguments.common.report.as_deref().unwrap_or_default();
        let note = "leave --report out, or convert the files one by one";
        return Err(Error::pipeline(marked(told, report, note)));
    }
    let pairs = outputs(&inputs, folder, arguments.to.as_deref(), formats)?;
    check_files(&pairs, arguments, formats)?;
    // Every pipeline is checked before the first is run.
    let mut runs = Vec::new();
    for (input, output) in pairs {
        // Names of inputs are text, and so is what is added to them.
        let text = |path: &Path| json!(path.to_string_lossy());
        let one = pipeline(arguments, text(&input), text(&output), registry)?;
        runs.push((input, one));
    }
    let made = make_folder(folder)?;
    let (done, outcome) = run_all(runs, odd, console);
    if done.is_empty() {
        // Left behind if any output is in it, which is as it should be.
        made.iter().rev().for_each(|made| drop(std::fs::remove_dir(made)));
    } else {
        console.result(Total::of(&done).told(&arguments.output, outcome.as_ref().err()))?;
    }
    outcome
}

/// No output of the whole batch may replace an input of it, be it one of another conversion that is
/// reached through a link, nor another output.
fn check_files(
    pairs: &[(PathBuf, PathBuf)],
    arguments: &ConvertArguments,
    formats: &Formats,
) -> Result<()> {
    let mut files = Files::default();
    let beside = |input| formats.of(input).and_then(|format| format.beside(input));
    let beside: Vec<_> = pairs.iter().map(|(input, _)| beside(input)).collect();
    pairs.iter().for_each(|(input, _)| files.read(input, Use::Input));
    beside.iter().flatten().for_each(|(file, _)| files.read(file, Use::Input));
    let existing = if arguments.common.no_clobber { Existing::Refuse } else { Existing::Replace };
    let refuse = |clash: Clash, output: &Path| {
        Error::pipeline(format!("-o: {} {clash}", shown(output)))
            .help("convert into another folder")
    };
    for (_, output) in pairs {
        files.write(output).map_err(|clash| refuse(clash, output))?;
        refuse_existing(output, existing)?;
    }
    for ((_, output), beside) in pairs.iter().zip(&beside) {
        let wanted = formats.of(output).is_none_or(|format| format.wants_beside());
        let Some((from, extension)) = beside.as_ref().filter(|_| wanted) else { continue };
        let to = output.with_extension(extension);
        if files.copy(from, &to).map_err(|clash| refuse(clash, &to))? {
            refuse_existing(&to, existing)?;
        }
    }
    Ok(())
}

/// What several conversions came to.
struct Total {
    files: usize,
    points: u64,
    bytes: u64,
    peak_bytes: Option<u64>,
    seconds: f64,
}

impl Total {
    fn of(all: &[Done]) -> Total {
        let outputs = || all.iter().flat_map(|done| &done.report.run.outputs);
        Total {
            files: all.len(),
            points: all.iter().map(|done| done.report.result.ledger.kept).sum(),
            bytes: outputs().filter_map(|output| output.bytes).sum(),
            peak_bytes: all.iter().filter_map(|done| done.report.run.peak_memory_bytes).max(),
            seconds: all.iter().map(|done| done.report.run.seconds).sum(),
        }
    }

    /// The closing table; `failed` tells what became of the others.
    fn told(&self, folder: &str, failed: Option<&Error>) -> String {
        let Total { files, points, bytes, peak_bytes, seconds } = self;
        let mut told = format!("files      {files}\n");
        if let Some(failed) = failed {
            told += &format!("incomplete {failed}\n");
        }
        told += &format!("points     {}\n", Grouped(*points));
        if let Some(peak) = peak_bytes {
            told += &format!("memory     {} at most\n", Bytes(*peak));
        }
        told + &format!("time       {seconds:.1} s\noutput     {folder}, {}\n", Bytes(*bytes))
    }
}

/// Runs one pipeline after the other. One that fails is told at once and does not keep the others
/// from running, as do `odd` names, of which there can be no pipeline; the error in the end is of
/// the first failure's kind, rather than that a result is not accepted. Returned are those that are
/// done and what became of all.
fn run_all(
    runs: Vec<(PathBuf, Graph)>,
    odd: Vec<PathBuf>,
    console: &Console,
) -> (Vec<Done>, Result<()>) {
    let total = runs.len() + odd.len();
    let mut done = Vec::new();
    let mut failures: Vec<ErrorKind> = Vec::new();
    for error in odd.iter().map(|name| unreadable(name)) {
        failures.push(error.kind());
        console.error(&error);
    }
    for (input, pipeline) in runs {
        if console.cancelled() {
            return (done, Err(Error::interrupted()));
        }
        match mill(pipeline, console) {
            Ok(one) => {
                if let Err(error) = one.accepted() {
                    failures.push(error.kind());
                    console.error(&error.at(input));
                }
                done.push(one);
            }
            Err(error) if total == 1 || error.kind() == ErrorKind::Interrupted => {
                return (done, Err(error));
            }
            Err(error) => {
                failures.push(error.kind());
                console.error(&error.at(input));
            }
        }
    }
    let told = format!("{} of {total} conversions failed", failures.len());
    let is_worse = |kind: &&ErrorKind| **kind != ErrorKind::NotAccepted;
    let kind = failures.iter().find(is_worse).or(failures.first());
    (done, kind.map_or(Ok(()), |kind| Err(Error::new(*kind, told))))
}

fn pipeline(
    arguments: &ConvertArguments,
    inputs: Value,
    output: Value,
    registry: &Registry,
) -> Result<Graph> {
    let from = arguments.read.from.as_deref();
    let sets = given([
        convert_flags(arguments, Some(inputs.clone()), Some(output)),
        one_form(&paths(&inputs), from, &arguments.written, registry),
        common_flags(&arguments.common),
    ]);
    let filter = arguments.filter.is_given().then_some("filter");
    Graph::parse_with(&with_stages(CONVERT, filter.into_iter()), HIDDEN, registry, &sets)
}

/// The inputs of one pipeline, as they were typed.
fn paths(inputs: &Value) -> Vec<String> {
    let text = |value: &Value| value.as_str().map(str::to_owned);
    match inputs {
        Value::Array(all) => all.iter().filter_map(text).collect(),
        one => text(one).into_iter().collect(),
    }
}

/// The output in `folder` of every input: its name, with the extension of the format that is asked
/// for, or its own. No two may be the same.
fn outputs(
    inputs: &[PathBuf],
    folder: &Path,
    to: Option<&str>,
    formats: &Formats,
) -> Result<Vec<(PathBuf, PathBuf)>> {
    let mut taken: BTreeMap<PathBuf, &Path> = BTreeMap::new();
    let mut all = Vec::new();
    for input in inputs {
        let own = || formats.of(input).map(|format| format.extension());
        let asked = |to| formats.iter().find(|f| f.name() == to).map_or(to, |f| f.extension());
        let (Some(stem), Some(extension)) = (formats.stem(input), to.map(asked).or_else(own))
        else {
            let told = format!("{}: its name says no format", shown(input));
            let known = listed(formats.names(), "or");
            return Err(Error::pipeline(told).help(format!("add --to {known}")));
        };
        let name: OsString = [stem, ".".as_ref(), extension.as_ref()].into_iter().collect();
        let output = folder.join(name);
        if let Some(other) = taken.insert(output.clone(), input) {
            let (a, b, output) = (shown(other), shown(input), shown(&output));
            return Err(Error::pipeline(format!("{a} and {b} would both become {output}")));
        }
        all.push((input.clone(), output));
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(inputs: &[&str], to: Option<&str>) -> Result<Vec<String>> {
        let inputs: Vec<PathBuf> = inputs.iter().map(PathBuf::from).collect();
        let outputs = outputs(&inputs, Path::new("out"), to, Registry::builtin().formats())?;
        Ok(outputs.into_iter().map(|(_, output)| output.display().to_string()).collect())
    }

    #[test]
    fn outputs_keep_names_and_take_the_extension() {
        assert_eq!(of(&["a/x.y.las", "b.PLY"], Some("laz")).unwrap(), ["out/x.y.laz", "out/b.laz"]);
        assert_eq!(of(&["a/x.LAS", "b.ply"], None).unwrap(), ["out/x.las", "out/b.ply"]);
        let copc = ["a.copc.laz", "b.COPC.LAZ", "copc.laz"];
        assert_eq!(of(&copc, None).unwrap(), ["out/a.copc.laz", "out/b.copc.laz", "out/copc.laz"]);
        assert_eq!(of(&["a.copc.laz"], Some("las")).unwrap(), ["out/a.las"]);
        assert_eq!(of(&["a.b.las"], Some("copc")).unwrap(), ["out/a.b.copc.laz"]);
    }

    #[test]
    fn outputs_of_one_name_or_no_format_are_refused() {
        let told = of(&["a/x.las", "b/x.laz"], Some("ply")).unwrap_err().to_string();
        assert_eq!(told, "a/x.las and b/x.laz would both become out/x.ply");
        assert!(of(&["x.dat"], None).is_err());
    }
}
