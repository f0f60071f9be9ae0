//! A pipeline that fits: its source open, its lattice fixed, its stages in passes, its memory divided.

use std::path::Path;

use super::each::{lists_bytes, paths, ranks};
use super::files::{Clash, Files, Use};
use super::passes::{Op, Pass, StageOp, Tap, blame, number_selections, unroll};
use super::publish::check_place;
use super::settings::{Nonfinite, Overrides, RunSettings, Withheld};
use super::shares::Demands;
use super::tagger::Tagger;
use super::text::{Pipeline, PlacedStage};
use crate::budget::default_limit;
use crate::geom::lattice::Lattice;
use crate::geom::simd::Simd;
use crate::point::Schema;
use crate::stage::{ChunkSize, CreateSink, OpenSource, Order, Role, Source, Transform};
use crate::tile::TAGGED_INPUTS;
use crate::{Error, ErrorKind, Result};

/// A pipeline ready to run.
pub struct Plan {
    pub(super) settings: RunSettings,
    pub(super) threads: usize,
    pub(super) simd: Simd,
    pub(super) source: Box<dyn Source>,
    pub(super) source_kind: String,
    pub(super) transforms: Vec<(String, Box<dyn Transform>)>,
    pub(super) ops: Vec<StageOp>,
    pub(super) passes: Vec<Pass>,
    pub(super) sinks: Vec<Box<dyn CreateSink>>,
    /// For each sink, those of the inputs if it is a folder; else none.
    pub(super) each: Vec<Vec<Box<dyn CreateSink>>>,
    /// See [`ranks`].
    pub(super) ranks: Vec<u32>,
    /// A sink of what all stages leave.
    pub(super) last_sink: usize,
    pub(super) tagger: Tagger,
    /// True if the run needs tiles: for its stages, or to sort.
    pub(super) mills: bool,
    /// Where points are; None for a stream that does not ask.
    pub(super) lattice: Option<Lattice>,
    /// The stages as the report names them.
    pub(super) stages: serde_json::Value,
    pub(super) demands: Demands,
}

/// The stages of a pipeline by role.
#[derive(Default)]
struct Sorted {
    source: Option<(String, Box<dyn OpenSource>)>,
    transforms: Vec<(String, Box<dyn Transform>)>,
    ops: Vec<StageOp>,
    sinks: Vec<(Box<dyn CreateSink>, Tap)>,
    /// Names of stages, each with the tile stages down to it.
    names: Vec<(String, usize)>,
}

impl Pipeline {
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
        let in_file = |error: Error| match error.path() {
            None => error.at(&origin),
            Some(_) => error,
        };
        let mut sorted = sort(self.stages).map_err(in_file)?;
        let (source_kind, open) =
            sorted.source.ok_or_else(|| Error::pipeline("the pipeline reads nothing"))?;
        let (sinks, taps): (Vec<_>, Vec<_>) = sorted.sinks.into_iter().unzip();
        let last_sink = last_sink(&sorted.ops, &taps).map_err(in_file)?;
        let mut files = check_places(self.file.as_deref(), &*open, &sinks, &settings)?;
        let source = open.open()?;
        let (each, ranks) = each_input(&*source, &sinks, &settings, &mut files)?;
        let schema = source.schema();
        check_transforms(&sorted.transforms, schema).map_err(in_file)?;
        let selections = number_selections(&mut sorted.ops).map_err(in_file)?;
        let passes = unroll(&sorted.ops, schema, &taps).map_err(in_file)?;
        let withheld = match sorted.ops.is_empty() {
            true => Withheld::Keep,
            false => settings.withheld,
        };
        let tagger = Tagger::new(schema, &selections, withheld, ranks.clone()).map_err(in_file)?;
        let mills = mills(&sorted.ops, &sinks)?;
        let z_scale = z_scale(&settings, &*source, &sorted.ops)?;
        let lattice = match mills || settings.nonfinite == Nonfinite::Drop {
            true => Some(Lattice::stretched(schema, settings.lattice, z_scale)?),
            false => None,
        };
        let simd = settings.simd.resolve().map_err(in_file)?;
        let threads = match settings.threads {
            Some(threads) => threads.get(),
            None => std::thread::available_parallelism().map_or(1, usize::from),
        };
        let limit = settings.memory.unwrap_or_else(default_limit);
        let chunks = chunks(&sinks, &*source)?;
        let needs = passes.iter().map(|pass| pass.needs(&sorted.ops).collect()).collect();
        let folders = each.iter().filter(|each| !each.is_empty()).count() as u64;
        let demands = Demands {
            lists: folders.saturating_mul(lists_bytes(ranks.len())),
            mills,
            passes: needs,
            tagged: tagger.tags(),
            ..Demands::of(&*source, &chunks, limit, threads)
        };
        demands.divide()?;
        Ok(Plan {
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
            ranks,
            last_sink,
            tagger,
            mills,
            lattice,
            stages,
            demands,
        })
    }
}

fn sort(stages: Vec<PlacedStage>) -> Result<Sorted> {
    let mut sorted = Sorted::default();
    for stage in stages {
        let PlacedStage { kind, name, from, line, limits, role, .. } = stage;
        let misplaced = |why: &str| {
            Err(Error::pipeline(format!("line {line}: `{kind}` cannot stand here: {why}")))
        };
        let tile_op = |op| StageOp { kind: kind.clone(), line, op, limits, selection: 0 };
        match role {
            Role::Source(_) if sorted.source.is_some() => {
                return misplaced("a pipeline has one source");
            }
            Role::Source(source) => sorted.source = Some((kind, source)),
            _ if sorted.source.is_none() => return misplaced("the first stage is a source"),
            Role::Sink(sink) => {
                let named = |name: &String| sorted.names.iter().find(|(other, _)| other == name);
                let ops = from.as_ref().and_then(named).map_or(sorted.ops.len(), |(_, ops)| *ops);
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
        sorted.names.extend(name.map(|name| (name, sorted.ops.len())));
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
            blame(stage, told).help("add a `write` behind it that has no `from`")
        }
        None => Error::pipeline("the pipeline writes nothing"),
    })
}

/// Refuses outputs that would replace what is read or each other, or that cannot appear where they
/// should. The files of folders are not among them: [`each_input`] adds these to what is returned.
fn check_places(
    pipeline: Option<&Path>,
    source: &dyn OpenSource,
    sinks: &[Box<dyn CreateSink>],
    settings: &RunSettings,
) -> Result<Files> {
    let mut files = Files::default();
    pipeline.iter().for_each(|path| files.read(path, Use::Pipeline));
    source.paths().iter().for_each(|path| files.read(path, Use::Input));
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
            .help("create it first, or name another with --scratch")),
        None => Ok(files),
    }
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
        for path in paths(&own) {
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

fn check_transforms(transforms: &[(String, Box<dyn Transform>)], schema: &Schema) -> Result<()> {
    let mut written: Vec<String> = Vec::new();
    for (kind, transform) in transforms {
        let needs = transform.needs();
        let there = |name: &&String| schema.find(name).is_some() || written.contains(name);
        if let Some(missing) = needs.reads.iter().find(|name| !there(name)) {
            let told = format!("`{kind}` needs {missing}, which nothing before it gives");
            return Err(Error::pipeline(told).help("the input has no such dimension"));
        }
        written.extend(needs.writes);
    }
    Ok(())
}

/// The chunks of all outputs.
fn chunks(sinks: &[Box<dyn CreateSink>], source: &dyn Source) -> Result<Vec<ChunkSize>> {
    sinks.iter().map(|sink| sink.chunk(source.schema(), source.metadata())).collect()
}

/// What z is multiplied by where stages measure distances; else 1.
fn z_scale(settings: &RunSettings, source: &dyn Source, ops: &[StageOp]) -> Result<f64> {
    if ops.is_empty() {
        return Ok(1.0);
    }
    let stretch = settings.stretch(source.metadata().units);
    stretch.map_err(|error| match source.inputs().first() {
        Some(input) => error.at(&input.path),
        None => error,
    })
}

/// True if the run needs tiles: for its stages, or because an output is to be in canonical order.
fn mills(ops: &[StageOp], sinks: &[Box<dyn CreateSink>]) -> Result<bool> {
    let of = |order: Order| sinks.iter().find(move |sink| sink.order() == order);
    let (canonical, input) = (of(Order::Canonical), of(Order::Input));
    let folder = sinks.iter().any(|sink| sink.is_folder());
    let mills = !ops.is_empty() || canonical.is_some() || folder;
    match input.filter(|_| mills) {
        None => Ok(mills),
        Some(sink) => {
            let told = match ops.is_empty() {
                true => {
                    "order = \"input\" is not possible in or beside an output in canonical order"
                }
                false => {
                    "order = \"input\" is for pipelines that stream; tiles write the canonical order"
                }
            };
            Err(Error::pipeline(told).at(sink.path()).help("leave `order` out"))
        }
    }
}
