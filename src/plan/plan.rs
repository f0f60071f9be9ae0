//! A pipeline that fits: its source open, its lattice fixed, its stages in passes, its memory divided.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use rayon::ThreadPool;

use super::look::{Unfit, look};
use super::passes::{Tap, check_limits, number_selections, unroll};
use super::stretch::Stretch;
use crate::engine::beside::Beside;
use crate::engine::by_input::{lists_bytes, ranks};
use crate::engine::by_rank;
use crate::engine::pass::{Op, StageOp};
use crate::engine::publish::check_place;
use crate::engine::shares::Demands;
use crate::engine::tagger::Tagger;
use crate::engine::task::Task;
use crate::engine::{Done, Watch};
use crate::error::shown;
use crate::geom::lattice::Lattice;
use crate::graph::{Graph, GraphStage};
use crate::graph::{MOST_THREADS, Nonfinite, Overrides, RunSettings};
use crate::host::process::default_memory;
use crate::host::{Clash, Files, Threads, Use};
use crate::point::{Schema, Units};
use crate::quantity::Figure;
use crate::stage::{ChunkSize, CreateSink, OpenSource, Order, Role, Source, Transform};
use crate::store::{CLASSED_INPUTS, TAGGED_INPUTS};
use crate::{Error, ErrorKind, Result};

/// A pipeline ready to run.
pub struct Plan(pub(crate) Task);

impl Plan {
    /// Runs the plan. Outputs appear under their names when all of it is done; an error or a stop
    /// that `watch` asks for leaves nothing behind.
    ///
    /// Outputs get their names one after the other, in the order of the pipeline's sinks and of the
    /// inputs, and the report gets its own behind them.
    pub fn run(self, watch: &dyn Watch) -> Result<Done> {
        self.0.run(watch)
    }

    /// Runs the plan as [`run`](Plan::run) does, on the threads of `pool`: on as many as were planned
    /// for, or on all if it has fewer. The outputs are the same on any pool.
    ///
    /// A run takes the threads that it works on for itself until it is done, so that other work of the
    /// pool waits.
    pub fn run_in(self, pool: &ThreadPool, watch: &dyn Watch) -> Result<Done> {
        let threads = Threads::of(pool, self.0.threads);
        self.0.run_on(threads, watch)
    }
}

/// The stages of a pipeline by role.
#[derive(Default)]
struct Sorted {
    source: Option<(String, Box<dyn OpenSource>)>,
    transforms: Vec<(String, Box<dyn Transform>)>,
    ops: Vec<StageOp>,
    sinks: Vec<(Box<dyn CreateSink>, Tap)>,
    /// For each stage of the graph, the tile stages down to it.
    above: Vec<usize>,
}

impl Graph {
    /// Opens the inputs' headers and fits the stages to them and to the memory.
    ///
    /// Fails if the stages do not fit each other, the inputs disagree, an output is an input or
    /// cannot appear where it should, or the memory cannot do.
    pub fn plan(self, overrides: &Overrides) -> Result<Plan> {
        let origin = self.origin;
        let settings = self.settings.with(overrides);
        let stages = self
            .stages
            .iter()
            .map(|stage| serde_json::json!({ "kind": stage.kind, "keys": stage.keys }))
            .collect();
        let in_file = |error: Error| if origin.is_empty() { error } else { error.at(&origin) };
        let mut sorted = sort(self.stages)?;
        let (source_kind, open) =
            sorted.source.ok_or_else(|| Error::pipeline("the pipeline reads nothing"))?;
        let (sinks, taps): (Vec<_>, Vec<_>) = sorted.sinks.into_iter().unzip();
        let last_sink = last_sink(&sorted.ops, &taps)?;
        let pipeline = self.file.as_deref();
        check_places(pipeline, &open.paths(), &sinks, &settings)?;
        let source = open.open()?;
        let mut files = check_places(pipeline, &all_read(&*open, &*source), &sinks, &settings)?;
        let (each, ranks) = each_input(&*source, &sinks, &settings, &mut files)?;
        let beside = copies(&*source, &sinks, &each, &settings, &mut files)?;
        let schema = source.schema();
        check_transforms(&sorted.transforms, schema).map_err(in_file)?;
        check_limits(&sorted.ops, schema)?;
        convert_lengths(&mut sorted.ops, &source.metadata().units)?;
        let selections = number_selections(&mut sorted.ops)?;
        let passes = unroll(&sorted.ops, schema, &taps)?;
        let classed = passes.iter().any(|pass| pass.reads_classes);
        if classed && ranks.len() > CLASSED_INPUTS as usize {
            let told = format!(
                "more than {CLASSED_INPUTS} inputs cannot have an output each where a stage looks at classes"
            );
            return Err(Error::pipeline(told).help("run them in several parts"));
        }
        let mut tagger = Tagger::new(schema, &selections, classed, ranks.clone());
        if !sorted.ops.is_empty() {
            tagger.treat(schema, &settings);
        }
        let mills = mills(&sorted.ops, &sinks)?;
        let Stretch { factor: z_scale, doubt } = stretch(&settings, &*source, &sorted.ops)?;
        let lattice = match mills || settings.nonfinite == Nonfinite::Drop {
            true => Some(Lattice::stretched(schema, settings.lattice, z_scale)?),
            false => None,
        };
        if let Some(lattice) = &lattice {
            check_lengths(&sorted.ops, lattice)?;
        }
        let simd = settings.simd.resolve().map_err(in_file)?;
        let threads = threads(&settings)?;
        let limit = settings.memory.unwrap_or_else(default_memory);
        let chunks = chunks(&sinks, &*source)?;
        let needs = passes.iter().map(|pass| pass.needs(&sorted.ops).collect()).collect();
        let gathers = sorted.ops.iter().any(|stage| matches!(stage.op, Op::Scan(_)));
        let has_cells = sorted.ops.iter().any(|stage| stage.op.tile().needs().cells);
        let folders = each.iter().filter(|each| !each.is_empty()).count() as u64;
        let removes = !(sorted.transforms.is_empty() && sorted.ops.is_empty());
        let ordered = if mills { in_input_order(&sinks, &*source)? } else { 0 };
        let demands = Demands {
            lists: folders
                .saturating_mul(lists_bytes(ranks.len()))
                .saturating_add(ordered.saturating_mul(by_rank::lists_bytes(source.points()))),
            ranked: ordered > 0,
            mills,
            passes: needs,
            tagged: tagger.tags(),
            run_most: settings.tile_points.map(|points| (points.get() as u64).saturating_mul(4)),
            gathers,
            has_cells,
            ..Demands::of(&*source, &chunks, limit, threads)
        };
        demands.divide()?;
        let mut warnings = warnings(&*source, &sinks, removes, &settings)?;
        let idle = sorted.transforms.iter().flat_map(|(_, stage)| stage.warnings(schema));
        warnings.extend(idle);
        warnings.extend(doubt);
        Ok(Plan(Task {
            warnings,
            settings,
            simd,
            threads,
            source,
            source_kind,
            transforms: sorted.transforms,
            ops: sorted.ops,
            passes,
            sinks,
            each,
            beside,
            ranks,
            last_sink,
            tagger,
            mills,
            lattice,
            stages,
            demands,
        }))
    }
}

fn sort(stages: Vec<GraphStage>) -> Result<Sorted> {
    let mut sorted = Sorted::default();
    for stage in stages {
        let GraphStage { kind, from, written, limits, role, .. } = stage;
        let misplaced =
            |why: &str| Err(written.wrong(format!("`{kind}` cannot stand here: {why}")));
        let tile_op =
            |op| StageOp { kind: kind.clone(), written: written.clone(), op, limits, selection: 0 };
        match role {
            Role::Source(_) if sorted.source.is_some() => {
                return misplaced("a pipeline has one source");
            }
            Role::Source(source) => sorted.source = Some((kind, source)),
            _ if sorted.source.is_none() => return misplaced("the first stage is a source"),
            Role::Sink(sink) => {
                let above = from.first().and_then(|&from| sorted.above.get(from));
                let ops = above.copied().unwrap_or(sorted.ops.len());
                let tap = Tap { ops, wants_normals: sink.wants_normals() };
                sorted.sinks.push((sink, tap));
            }
            Role::Transform(_) if !sorted.ops.is_empty() => {
                return misplaced("stages that stream come before those that work on tiles");
            }
            Role::Transform(_) if !sorted.sinks.is_empty() => {
                return misplaced("a stage that streams cannot follow a sink");
            }
            Role::Transform(transform) => sorted.transforms.push((kind, transform)),
            Role::TileOp(op) => sorted.ops.push(tile_op(Op::Tile(op))),
            Role::ScanOp(op) => sorted.ops.push(tile_op(Op::Scan(op))),
        }
        sorted.above.push(sorted.ops.len());
    }
    match sorted.sinks.is_empty() {
        true => Err(Error::pipeline("the pipeline writes nothing")),
        false => Ok(sorted),
    }
}

/// The first sink of what all stages leave; without one, the last stages would work for nothing.
fn last_sink(ops: &[StageOp], taps: &[Tap]) -> Result<usize> {
    let last = taps.iter().position(|tap| tap.ops == ops.len());
    last.ok_or_else(|| match ops.last() {
        Some(stage) => {
            let told = format!("no output takes what `{}` leaves", stage.kind);
            stage.written.wrong(told).help("add a `write` behind it that has no `from`")
        }
        None => Error::pipeline("the pipeline writes nothing"),
    })
}

/// Refuses outputs that would replace what is read or each other, or that cannot appear where they
/// should. The files of folders are not among them: [`each_input`] adds these to what is returned.
fn check_places(
    pipeline: Option<&Path>,
    inputs: &[PathBuf],
    sinks: &[Box<dyn CreateSink>],
    settings: &RunSettings,
) -> Result<Files> {
    let mut files = Files::default();
    pipeline.iter().for_each(|path| files.read(path, Use::Pipeline));
    inputs.iter().for_each(|path| files.read(path, Use::Input));
    let outputs = sinks.iter().map(|sink| (sink.path(), sink.is_folder()));
    for (path, is_folder) in outputs.chain(settings.report.as_deref().map(|path| (path, false))) {
        files.write(path).map_err(|clash| refuse(&clash, path))?;
        if !is_folder {
            check_place(path, settings.existing)?;
        }
    }
    match settings.scratch.as_ref().filter(|folder| !folder.is_dir()) {
        Some(folder) => Err(Error::new(ErrorKind::Io, "the folder for scratch does not exist")
            .at(folder)
            .help("create it first, or name another with `run.scratch`")),
        None => Ok(files),
    }
}

/// The inputs, and what their records refer to.
fn all_read(open: &dyn OpenSource, source: &dyn Source) -> Vec<PathBuf> {
    let beside = source.inputs().into_iter().filter_map(|input| input.beside);
    open.paths().into_iter().chain(beside.map(|(path, _)| path)).collect()
}

/// What is to be copied beside outputs, none of which is one of the other `files`.
fn copies(
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
type EachInput = (Vec<Vec<Box<dyn CreateSink>>>, Vec<u32>);

/// Names the outputs of folders; refuses those that cannot appear there, or that would replace one of
/// the other `files`.
fn each_input(
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

/// Converts lengths with a unit of their own to the unit of the scan.
fn convert_lengths(ops: &mut [StageOp], units: &Units) -> Result<()> {
    ops.iter_mut().try_for_each(|stage| stage.op.tile_mut().convert(units))
}

/// Refuses lengths that are longer than the lattice.
fn check_lengths(ops: &[StageOp], lattice: &Lattice) -> Result<()> {
    let longest = lattice.longest();
    let mut lengths = ops.iter().flat_map(|stage| stage.op.tile().lengths());
    match lengths.find(|(_, length)| *length > longest) {
        None => Ok(()),
        Some((key, length)) => {
            let (length, steps) = (Figure(length), Figure(lattice.step));
            let told = format!("`{key} = {length}` is longer than any scan in steps of {steps}");
            // In three digits, and never more than it is.
            Err(Error::pipeline(told).help(format!("give {:.2e} or less", longest * 0.995)))
        }
    }
}

fn check_transforms(transforms: &[(String, Box<dyn Transform>)], schema: &Schema) -> Result<()> {
    let mut written: Vec<String> = Vec::new();
    for (kind, transform) in transforms {
        let needs = transform.needs();
        let there = |name: &&String| schema.find(name).is_some() || written.contains(name);
        if let Some(missing) = needs.reads.iter().find(|name| !there(name)) {
            let told = format!("`{kind}` needs {missing}, which nothing before it gives");
            return Err(Error::pipeline(told).help("the input has no such dimension"));
        }
        transform.check(schema)?;
        written.extend(needs.writes);
    }
    Ok(())
}

/// What outputs will not hold. Records that they cannot hold are an error where all are written, and
/// a warning where a stage may remove them first (`removes`) and leave others.
fn warnings(
    source: &dyn Source,
    sinks: &[Box<dyn CreateSink>],
    removes: bool,
    settings: &RunSettings,
) -> Result<Vec<String>> {
    let lost = sinks.iter().flat_map(|sink| sink.warnings(source.schema(), source.metadata()));
    let mut warnings: Vec<String> = lost.collect();
    let Some(Unfit { error, none_fits }) =
        look(source, sinks, settings.nonfinite == Nonfinite::Drop)?
    else {
        return Ok(warnings);
    };
    // Where none fits there is nothing that stages could leave.
    if !removes || none_fits {
        return Err(error);
    }
    let help = error.remedy().map_or(String::new(), |help| format!("; {help}"));
    warnings.push(format!("{error}: the run fails if such a point is kept{help}"));
    Ok(warnings)
}

/// Threads that work at once.
fn threads(settings: &RunSettings) -> Result<usize> {
    match settings.threads.map(NonZeroUsize::get) {
        Some(threads) if threads > MOST_THREADS => {
            let told = format!("a run has at most {MOST_THREADS} threads, not {threads}");
            Err(Error::pipeline(told).help("leave `run.threads` out: all processors work"))
        }
        Some(threads) => Ok(threads),
        None => {
            let processors = std::thread::available_parallelism().map_or(1, usize::from);
            Ok(processors.min(MOST_THREADS))
        }
    }
}

/// How many outputs want the order of the inputs, which has to be kept where the run needs tiles.
fn in_input_order(sinks: &[Box<dyn CreateSink>], source: &dyn Source) -> Result<u64> {
    let ordered = sinks.iter().filter(|sink| sink.order() == Order::Input).count();
    if ordered > 0 && source.parts() > by_rank::MOST_PARTS {
        let told = "the inputs have too many parts for an output in their order";
        return Err(Error::pipeline(told).help("leave `write.order` out"));
    }
    Ok(ordered as u64)
}

/// The chunks of all outputs.
fn chunks(sinks: &[Box<dyn CreateSink>], source: &dyn Source) -> Result<Vec<ChunkSize>> {
    sinks.iter().map(|sink| sink.chunk(source.schema(), source.metadata())).collect()
}

/// What z is multiplied by where stages measure distances; else 1.
fn stretch(settings: &RunSettings, source: &dyn Source, ops: &[StageOp]) -> Result<Stretch> {
    if ops.is_empty() {
        return Ok(Stretch { factor: 1.0, doubt: None });
    }
    let first = source.inputs().into_iter().next();
    match (settings.stretch(source.metadata().units), first) {
        (Err(error), Some(input)) => Err(error.at(&input.path)),
        (Ok(Stretch { factor, doubt }), Some(input)) => {
            let doubt = doubt.map(|doubt| format!("{}: {doubt}", shown(&input.path)));
            Ok(Stretch { factor, doubt })
        }
        (stretch, None) => stretch,
    }
}

/// True if the run needs tiles: for its stages, or because an output is to be in canonical order.
fn mills(ops: &[StageOp], sinks: &[Box<dyn CreateSink>]) -> Result<bool> {
    let canonical = sinks.iter().any(|sink| sink.order() == Order::Canonical);
    match sinks.iter().find(|sink| sink.is_folder() && sink.order() == Order::Input) {
        None => Ok(!ops.is_empty() || canonical || sinks.iter().any(|sink| sink.is_folder())),
        Some(sink) => {
            Err(Error::pipeline("`write.order = \"input\"` is for one file of all inputs")
                .at(sink.path())
                .help("give `write.path` instead of `write.folder`, or leave `write.order` out"))
        }
    }
}
