//! Where outputs are to appear: none replaces what is read or another output, and each can appear
//! where it should. Found out before any point is read.

use std::path::{Path, PathBuf};

use crate::engine::beside::{Beside, missing};
use crate::engine::by_input::ranks;
use crate::engine::by_split::MOST_FILES;
use crate::engine::publish::{check_place, folder_of, refuse_existing};
use crate::error::shown;
use crate::graph::RunSettings;
use crate::host::{Clash, Files, Use};
use crate::point::Schema;
use crate::report::Grouped;
use crate::stage::{CreateSink, OpenSource, OutputSplit, Source};
use crate::store::TAGGED_INPUTS;
use crate::{Error, ErrorKind, Result};

/// The files of a run, and what is wrong with outputs: that they would replace what is read or each
/// other, or cannot appear where they should. The files of folders are not among them:
/// [`each_input`] adds these to what is returned.
pub(super) fn check_places(
    pipeline: Option<&Path>,
    inputs: &[PathBuf],
    sinks: &[Box<dyn CreateSink>],
    settings: &RunSettings,
) -> (Files, Vec<Error>) {
    let mut files = Files::default();
    pipeline.iter().for_each(|path| files.read(path, Use::Pipeline));
    inputs.iter().for_each(|path| files.read(path, Use::Input));
    let files_of = sinks.iter().filter(|sink| sink.is_file());
    // Those of several files are looked at when these are known.
    let outputs = files_of.map(|sink| (sink.path(), sink.is_folder() || sink.is_split()));
    let mut wrong = Vec::new();
    for (path, is_several) in outputs.chain(settings.report.as_deref().map(|path| (path, false))) {
        match files.write(path) {
            Err(clash) => wrong.push(refuse(&clash, path)),
            Ok(()) if is_several => {}
            Ok(()) => wrong.extend(check_place(path, settings.existing).err()),
        }
    }
    if let Some(folder) = settings.scratch.as_ref().filter(|folder| !folder.is_dir()) {
        let told = Error::new(ErrorKind::Io, "the folder for scratch does not exist").at(folder);
        wrong.push(told.help("create it first, or name another with `run.scratch`"));
    }
    (files, wrong)
}

/// The inputs, and what their records refer to.
pub(super) fn all_read(open: &dyn OpenSource, source: &dyn Source) -> Vec<PathBuf> {
    let beside = source.inputs().into_iter().filter_map(|input| input.beside);
    open.paths().into_iter().chain(beside.map(|(path, _)| path)).collect()
}

/// What is to be copied beside outputs, none of which is one of the other `files`.
pub(super) fn copies(
    source: &dyn Source,
    sinks: &[Box<dyn CreateSink>],
    each: &[Vec<Box<dyn CreateSink>>],
    settings: &RunSettings,
    files: &mut Files,
) -> Result<Vec<Beside>> {
    let mut copies = Vec::new();
    for (n, input) in source.inputs().iter().enumerate() {
        for (sink, own) in sinks.iter().zip(each) {
            let sink = own.get(n).unwrap_or(sink);
            let copy = Beside::of(input, &**sink, files);
            if let Some(copy) = copy.map_err(|(to, clash)| refuse(&clash, &to))? {
                // A folder that the run makes first has nothing in it.
                if own.is_empty() || copy.to.parent().is_some_and(Path::is_dir) {
                    check_place(&copy.to, settings.existing)?;
                }
                copies.push(copy);
            }
        }
    }
    Ok(copies)
}

/// What to say of records whose waveforms are not beside them in an output.
pub(super) fn not_beside(source: &dyn Source, sinks: &[Box<dyn CreateSink>]) -> Vec<String> {
    let inputs = source.inputs();
    sinks.iter().filter_map(|sink| missing(&inputs, &**sink)).collect()
}

fn refuse(clash: &Clash, output: &Path) -> Error {
    Error::pipeline(format!("this {clash}")).at(output).help("write to another file")
}

/// Sinks of the inputs for each output that is a folder, and the ranks of the inputs if one is.
pub(super) type EachInput = (Vec<Vec<Box<dyn CreateSink>>>, Vec<u32>);

/// Names the outputs of folders; refuses those that cannot appear there, or that would replace one
/// of the other `files`.
pub(super) fn each_input(
    source: &dyn Source,
    sinks: &[Box<dyn CreateSink>],
    settings: &RunSettings,
    files: &mut Files,
) -> Result<EachInput> {
    let inputs = source.inputs();
    if inputs.len() > TAGGED_INPUTS as usize && sinks.iter().any(|sink| sink.is_folder()) {
        let told = format!("more than {TAGGED_INPUTS} inputs cannot have an output each");
        return Err(Error::pipeline(told).help("run them in several parts"));
    }
    let mut each = Vec::new();
    for sink in sinks {
        let own = sink.each_input(&inputs)?.unwrap_or_default();
        for path in own.iter().map(|sink| sink.path().to_owned()) {
            files.write(&path).map_err(|clash| refuse(&clash, &path))?;
            if sink.path().is_dir() {
                check_place(&path, settings.existing)?;
            }
        }
        each.push(own);
    }
    let folders = each.iter().any(|own| !own.is_empty());
    Ok((each, if folders { ranks(&inputs) } else { Vec::new() }))
}

/// For each sink into which files it is split, and what users should know of these.
pub(super) type Splits = (Vec<Option<OutputSplit>>, Vec<String>);

/// For each sink into which files records of `schema` are split. Refuses files of which one could
/// have the path of a file that is `read`, or that is there already and must not be replaced.
pub(super) fn splits(
    (source, schema): (&dyn Source, &Schema),
    sinks: &[Box<dyn CreateSink>],
    settings: &RunSettings,
    read: &[PathBuf],
) -> Result<Splits> {
    let units = source.metadata().units;
    let mut many = Vec::new();
    let mut split = |sink: &dyn CreateSink| {
        let Some(split) = sink.split(schema, &units)? else { return Ok(None) };
        if let Some(input) = read.iter().find(|input| sink.may_name(input)) {
            let told =
                format!("one of the files could have the name of the input {}", shown(input));
            return Err(Error::pipeline(told).at(sink.path()).help("write into another folder"));
        }
        let refer = source.inputs().into_iter().find(|input| input.beside.is_some());
        if let Some(input) = refer {
            let told = "its records refer to waveforms in a file beside it, which has no copy \
                        beside each of several outputs";
            return Err(Error::pipeline(told).at(&input.path).help("write one file"));
        }
        many.extend(too_many(source, &split, sink.path()));
        let there = std::fs::read_dir(folder_of(sink.path())).into_iter().flatten().flatten();
        let there = there.map(|entry| entry.path()).find(|path| sink.may_name(path));
        there.map_or(Ok(()), |path| refuse_existing(&path, settings.existing))?;
        Ok(Some(split))
    };
    let splits = sinks.iter().map(|sink| split(&**sink)).collect::<Result<_>>()?;
    Ok((splits, many))
}

/// What to say where headers claim that there are more files than there may be.
fn too_many(source: &dyn Source, split: &OutputSplit, path: &Path) -> Option<String> {
    let (path, most) = (shown(path), MOST_FILES);
    match split {
        OutputSplit::Squares(side) => {
            let [lo, hi] = source.claimed_box()?;
            let [columns, rows] = [0, 1].map(|axis| ((hi[axis] - lo[axis]) / side).ceil().max(1.0));
            let all = columns * rows;
            (all > most as f64).then(|| {
                let all = Grouped(all as u64);
                format!(
                    "{path}: the box of the input's header has {all} squares of `write.side = \
                     {side}`; the run fails if more than {most} of them have points"
                )
            })
        }
        OutputSplit::Points(points) => {
            let all = source.points().div_ceil(*points);
            (all > most as u64).then(|| {
                let all = Grouped(all);
                format!(
                    "{path}: the input's points are {all} files of `write.points = {points}`; the \
                     run fails if more than {most} are to be written"
                )
            })
        }
        OutputSplit::Values(_) | OutputSplit::Bytes(_) => None,
    }
}
