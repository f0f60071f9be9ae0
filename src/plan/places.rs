//! Where outputs are to appear: none replaces what is read or another output, and each can appear
//! where it should. Found out before any point is read.

use std::path::{Path, PathBuf};

use crate::engine::beside::Beside;
use crate::engine::by_input::ranks;
use crate::engine::by_square::MOST_SQUARES;
use crate::engine::publish::{check_place, folder_of, refuse_existing};
use crate::error::shown;
use crate::graph::RunSettings;
use crate::host::{Clash, Files, Use};
use crate::report::Grouped;
use crate::stage::{CreateSink, OpenSource, Source};
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
    let outputs = files_of.map(|sink| (sink.path(), sink.is_folder() || sink.has_squares()));
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

/// For each sink the side of the squares that it is cut into, and what users should know of these.
pub(super) type SquareSides = (Vec<Option<f64>>, Vec<String>);

/// For each sink the side of the squares that it is cut into. Refuses squares of which one could
/// have the path of a file that is `read`, or that is there already and must not be replaced.
pub(super) fn square_sides(
    source: &dyn Source,
    sinks: &[Box<dyn CreateSink>],
    settings: &RunSettings,
    read: &[PathBuf],
) -> Result<SquareSides> {
    let units = source.metadata().units;
    let mut wide = Vec::new();
    let mut side = |sink: &dyn CreateSink| {
        let Some(side) = sink.square_side(&units)? else { return Ok(None) };
        if let Some(input) = read.iter().find(|input| sink.may_name(input)) {
            let told = format!("a square could have the name of the input {}", shown(input));
            return Err(Error::pipeline(told).at(sink.path()).help("write into another folder"));
        }
        let refer = source.inputs().into_iter().find(|input| input.beside.is_some());
        if let Some(input) = refer {
            let told = "its records refer to waveforms in a file beside it, which has no copy \
                        beside each square";
            return Err(Error::pipeline(told).at(&input.path).help("write one file"));
        }
        let area = source.claimed_box();
        wide.extend(area.and_then(|area| too_many(area, side, sink.path())));
        let there = std::fs::read_dir(folder_of(sink.path())).into_iter().flatten().flatten();
        let there = there.map(|entry| entry.path()).find(|path| sink.may_name(path));
        there.map_or(Ok(()), |path| refuse_existing(&path, settings.existing))?;
        Ok(Some(side))
    };
    let sides = sinks.iter().map(|sink| side(&**sink)).collect::<Result<_>>()?;
    Ok((sides, wide))
}

/// What to say where the box that headers claim has more squares than may have points.
fn too_many([lo, hi]: [[f64; 3]; 2], side: f64, path: &Path) -> Option<String> {
    let [columns, rows] = [0, 1].map(|axis| ((hi[axis] - lo[axis]) / side).ceil().max(1.0));
    let (most, all) = (MOST_SQUARES, columns * rows);
    (all > most as f64).then(|| {
        format!(
            "{}: the box of the input's header has {} squares of `write.side = {side}`; the run \
             fails if more than {most} of them have points",
            shown(path),
            Grouped(all as u64)
        )
    })
}
