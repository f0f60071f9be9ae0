//! `convert`: all inputs to one file, or each to its own.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::arguments::{BulkArguments, ConvertArguments};
use super::batch::{BatchRun, BatchWork, jobs_for, run_all, threads_of};
use super::console::Console;
use super::flags::{common_flags, convert_flags, given};
use super::form::with_form;
use super::mistyped::marked;
use super::pipeline::{HIDDEN, with_stages};
use super::run::{finish, mill};
use crate::compare::is_current;
use crate::engine::{make_folder, refuse_existing};
use crate::error::{listed, shown};
use crate::graph::Existing;
use crate::graph::Graph;
use crate::host::{Clash, Files, Use, standard};
use crate::io::ends::{MirroredFile, expand_mirrored, unreadable};
use crate::language::Registry;
use crate::stage::Formats;
use crate::{Error, Result};

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
        refuse_bulk(&arguments.bulk, &arguments.output)?;
        let one = pipeline(arguments, json!(arguments.inputs), json!(arguments.output), registry);
        return finish(&mill(one?, console)?, console);
    }
    let (inputs, odd): (Vec<MirroredFile>, Vec<MirroredFile>) =
        expand_mirrored(&arguments.inputs, formats)?
            .into_iter()
            .partition(|input| input.file.to_str().is_some());
    if let ([], [first, ..]) = (&inputs[..], &odd[..]) {
        return Err(unreadable(&first.file));
    }
    if inputs.len() > 1 && arguments.common.report.is_some() {
        let told = "--report: is for one output, and this makes several";
        let report = arguments.common.report.as_deref().unwrap_or_default();
        let note = "leave --report out, or convert the files one by one; --summary tells of all";
        return Err(Error::pipeline(marked(told, report, note)));
    }
    let pairs = outputs(&inputs, folder, arguments.to.as_deref(), formats)?;
    // Every pipeline is checked before the first is run.
    let mut runs: Vec<BatchRun> = odd.into_iter().map(|odd| refused(odd.file)).collect();
    for (input, output) in pairs {
        // Names of inputs are text, and so is what is added to them.
        let text = |path: &Path| json!(path.to_string_lossy());
        let graph = pipeline(arguments, text(&input), text(&output), registry)?;
        let is_current = arguments.bulk.resume && is_current(&graph, &output, formats);
        let work =
            if is_current { BatchWork::Current } else { BatchWork::Convert(Box::new(graph)) };
        runs.push(BatchRun { input, output: Some(output), work });
    }
    check_files(&runs, arguments, formats)?;
    run_batch(runs, arguments, folder, console)
}

/// Runs all conversions and tells what became of them.
fn run_batch(
    runs: Vec<BatchRun>,
    arguments: &ConvertArguments,
    folder: &Path,
    console: &Console,
) -> Result<()> {
    let graph = |run: &BatchRun| match &run.work {
        BatchWork::Convert(graph) => Some(threads_of(&graph.settings)),
        _ => None,
    };
    let threads = runs.iter().find_map(graph).unwrap_or(1);
    let inputs: Vec<PathBuf> = runs.iter().map(|run| run.input.clone()).collect();
    let jobs = arguments.bulk.jobs.unwrap_or_else(|| jobs_for(&inputs, threads));
    let mut made = make_folder(folder)?;
    let parents = runs.iter().filter_map(|run| run.output.as_ref()?.parent());
    for parent in parents.collect::<BTreeSet<_>>() {
        made.extend(make_folder(parent)?);
    }
    let all = run_all(runs, jobs, console);
    // Left behind if any output is in one, which is as it should be.
    made.iter().rev().for_each(|made| drop(std::fs::remove_dir(made)));
    if let Some(path) = &arguments.bulk.summary {
        all.write_summary(path, console)?;
    }
    if all.has_outputs() {
        console.result(all.told(&arguments.output))?;
    }
    all.outcome()
}

/// An input of whose name there can be no pipeline.
fn refused(input: PathBuf) -> BatchRun {
    let error = unreadable(&input);
    BatchRun { input, output: None, work: BatchWork::Refused(error) }
}

/// Refuses what is for several outputs where there is one.
fn refuse_bulk(bulk: &BulkArguments, output: &str) -> Result<()> {
    let given = [
        ("--jobs", bulk.jobs.is_some()),
        ("--resume", bulk.resume),
        ("--summary", bulk.summary.is_some()),
    ];
    match given.into_iter().find(|(_, is_given)| *is_given) {
        None => Ok(()),
        Some((flag, _)) => {
            let told = format!("{flag}: is for a folder of outputs, and this makes one file");
            Err(Error::pipeline(told).help(format!(
                "leave {flag} out, or give a folder: `-o {}/`",
                shown(&Path::new(output).with_extension(""))
            )))
        }
    }
}

/// No output of the whole batch may replace an input of it, be it one of another conversion that is
/// reached through a link, nor another output.
fn check_files(runs: &[BatchRun], arguments: &ConvertArguments, formats: &Formats) -> Result<()> {
    let mut files = Files::default();
    let beside = |input: &Path| formats.of(input).and_then(|format| format.beside(input));
    let beside: Vec<_> = runs.iter().map(|run| beside(&run.input)).collect();
    runs.iter().for_each(|run| files.read(&run.input, Use::Input));
    beside.iter().flatten().for_each(|(file, _)| files.read(file, Use::Input));
    let refuses = arguments.common.no_clobber;
    let refuse = |clash: Clash, output: &Path| {
        Error::pipeline(format!("-o: {} {clash}", shown(output)))
            .help("convert into another folder")
    };
    for (run, beside) in runs.iter().zip(&beside) {
        let Some(output) = &run.output else { continue };
        files.write(output).map_err(|clash| refuse(clash, output))?;
        // What stands is not written again.
        let stands = matches!(run.work, BatchWork::Current);
        let existing = if refuses && !stands { Existing::Refuse } else { Existing::Replace };
        refuse_existing(output, existing)?;
        let wanted = formats.of(output).is_none_or(|format| format.wants_beside());
        let Some((from, extension)) = beside.as_ref().filter(|_| wanted) else { continue };
        let to = output.with_extension(extension);
        if files.copy(from, &to).map_err(|clash| refuse(clash, &to))? {
            refuse_existing(&to, existing)?;
        }
    }
    if let Some(summary) = &arguments.bulk.summary {
        let refuse = |clash: Clash| {
            Error::pipeline(format!("--summary: {} {clash}", shown(summary)))
                .help("give it another name")
        };
        files.write(summary).map_err(refuse)?;
        refuse_existing(summary, if refuses { Existing::Refuse } else { Existing::Replace })?;
    }
    Ok(())
}

fn pipeline(
    arguments: &ConvertArguments,
    inputs: Value,
    output: Value,
    registry: &Registry,
) -> Result<Graph> {
    let (files, ends) = (paths(&inputs), (&arguments.read, &arguments.written));
    let all = convert_flags(arguments, Some(inputs), Some(output));
    let [all, form] = with_form(all, &files, ends, registry);
    let sets = given([all, form, common_flags(&arguments.common)]);
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

/// The output in `folder` of every input: its way from the folder that was named, with the
/// extension of the format that is asked for, or its own. No two may be the same.
fn outputs(
    inputs: &[MirroredFile],
    folder: &Path,
    to: Option<&str>,
    formats: &Formats,
) -> Result<Vec<(PathBuf, PathBuf)>> {
    let mut taken: BTreeMap<PathBuf, &Path> = BTreeMap::new();
    let mut all = Vec::new();
    for MirroredFile { file: input, way } in inputs {
        if standard::is_input(input) {
            let told = "standard input has no name that its output in a folder could have";
            return Err(Error::pipeline(told).help("name the file: `-o FILE`"));
        }
        let own = || formats.of(input).map(|format| format.extension());
        let asked = |to| formats.iter().find(|f| f.name() == to).map_or(to, |f| f.extension());
        let (Some(stem), Some(extension)) = (formats.stem(input), to.map(asked).or_else(own))
        else {
            let told = format!("{}: its name says no format", shown(input));
            let known = listed(formats.names(), "or");
            return Err(Error::pipeline(told).help(format!("add --to {known}")));
        };
        let name: OsString = [stem, ".".as_ref(), extension.as_ref()].into_iter().collect();
        let output = folder.join(way).with_file_name(name);
        if let Some(other) = taken.insert(output.clone(), input) {
            let (a, b, output) = (shown(other), shown(input), shown(&output));
            let told = format!("{a} and {b} would both become {output}");
            return Err(Error::pipeline(told).help(
                "convert them into two folders; a quoted pattern, such as 'survey/**/*.laz', keeps \
                 folders apart, and so does @LIST",
            ));
        }
        all.push((input.clone(), output));
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(inputs: &[&str], to: Option<&str>) -> Result<Vec<String>> {
        let file = |file: &PathBuf| MirroredFile {
            way: file.file_name().map(PathBuf::from).unwrap_or_default(),
            file: file.clone(),
        };
        let inputs: Vec<MirroredFile> =
            inputs.iter().map(PathBuf::from).map(|p| file(&p)).collect();
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
