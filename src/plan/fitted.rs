//! A pipeline that fits: its source open, its lattice fixed, its stages in passes, its memory
//! divided.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Arc;

use rayon::ThreadPool;

use super::limits::{check_limits, number_selections};
use super::look::{Unfit, look};
use super::passes::{Passes, unroll};
use super::places::{all_read, check_places, copies, each_input};
use super::sorted::{Sorted, blame};
use super::stretch::Stretch;
use super::transforms::{check_numbers, fit_transforms};
use crate::engine::by_input::lists_bytes;
use crate::engine::by_rank;
use crate::engine::pass::{ColumnBytes, Op, Pass, StageOp, standings};
use crate::engine::shares::Demands;
use crate::engine::tagger::Tagger;
use crate::engine::task::{Schemas, Task};
use crate::engine::{Done, Watch};
use crate::error::shown;
use crate::expression::Choice;
use crate::geom::lattice::Lattice;
use crate::graph::Graph;
use crate::graph::{MOST_THREADS, Nonfinite, Overrides, RunSettings};
use crate::host::Threads;
use crate::host::process::default_memory;
use crate::point::{ComputedDimension, Metadata, Schema, Units};
use crate::quantity::Figure;
use crate::stage::{ChunkSize, CreateSink, Order, Source};
use crate::store::CLASSED_INPUTS;
use crate::{Error, Result};

/// A pipeline ready to run: headers are read, no point is.
///
/// ```
/// use pointmill::{Graph, Overrides, Registry};
///
/// # fn main() -> pointmill::Result<()> {
/// let text = "stage = [
///     {kind = 'synth', scene = 'plane', points = 1_000},
///     {kind = 'grid', side = 0.5},
///     {kind = 'write', path = 'plane.ply'},
/// ]";
/// let graph = Graph::parse(text, "thin.toml", &Registry::builtin())?;
/// let plan = graph.plan(&Overrides::default())?;
/// assert_eq!(plan.outline().points, 1_000);
/// // What `pointmill plan` prints.
/// assert!(plan.to_string().contains("order    canonical"));
/// # Ok(())
/// # }
/// ```
pub struct Plan {
    pub(crate) task: Task,
    /// The tile stages; a run consumes them, since they settle and could not begin a second time.
    pub(crate) ops: Vec<StageOp>,
}

impl Plan {
    /// Runs the plan. Outputs appear under their names when all of it is done; an error or a stop
    /// that `watch` asks for leaves nothing behind.
    ///
    /// Outputs get their names one after the other, in the order of the pipeline's sinks and of the
    /// inputs, and the report gets its own behind them.
    ///
    /// # Errors
    ///
    /// What the system refuses, damage in the inputs, a budget that turns out too small, records
    /// that an output cannot hold, and [`ErrorKind::Interrupted`](crate::ErrorKind::Interrupted)
    /// where `watch` asked to stop.
    pub fn run(self, watch: &dyn Watch) -> Result<Done> {
        self.task.run(self.ops, watch)
    }

    /// Runs the plan as [`run`](Plan::run) does, on the threads of `pool`: on as many as were
    /// planned for, or on all if it has fewer. The outputs are the same on any pool.
    ///
    /// A run takes the threads that it works on for itself until it is done, so that other work of
    /// the pool waits.
    ///
    /// # Errors
    ///
    /// As [`run`](Plan::run).
    pub fn run_in(self, pool: &ThreadPool, watch: &dyn Watch) -> Result<Done> {
        let threads = Threads::of(pool, self.task.threads);
        self.task.run_on(self.ops, threads, watch)
    }
}

impl Graph {
    /// Opens the inputs' headers and fits the stages to them and to the memory.
    ///
    /// # Errors
    ///
    /// Stages that do not fit each other, inputs that disagree, an output that is an input or
    /// cannot appear where it should, and a memory that cannot do, with the size that would.
    pub fn plan(self, overrides: &Overrides) -> Result<Plan> {
        let (origin, file) = (self.origin.clone(), self.file.clone());
        let settings = self.settings.clone().with(overrides);
        let in_file = |error: Error| if origin.is_empty() { error } else { error.at(&origin) };
        let mut sorted = Sorted::new(self)?;
        let open = &*sorted.source.1;
        let places = |read: &[PathBuf], sinks: &[Box<dyn CreateSink>]| {
            check_places(file.as_deref(), read, sinks, &settings)
        };
        let (_, wrong) = places(&open.paths(), &sorted.sinks);
        let FittedStages { source, schemas, choices, passes } = fit_stages(&mut sorted, wrong)?;
        let schema = &schemas.last;
        let open = &*sorted.source.1;
        let read = all_read(open, &*source);
        let (mut files, wrong) = places(&read, &sorted.sinks);
        Error::all(wrong)?;
        let (each, ranks) = each_input(&*source, &sorted.sinks, &settings, &mut files)?;
        let beside = copies(&*source, &sorted.sinks, &each, &settings, &mut files)?;
        let tagger = tagger(&sorted.ops, &passes.passes, &choices, &ranks, schema, &settings)?;
        let order = WriteOrder::new(&sorted, &*source)?;
        let (lattice, doubt) = lattice(&settings, (&*source, schema), &sorted.ops, order.mills)?;
        let simd = settings.simd.resolve().map_err(in_file)?;
        let demands = demands(&sorted, &passes, (&*source, schema), &order, &settings)?;
        let folders = each.iter().filter(|each| !each.is_empty()).count() as u64;
        let demands = Demands {
            lists: demands.lists + lists_bytes(ranks.len()) * folders,
            tagged: tagger.tags(),
            ..demands
        };
        demands.divide()?;
        let mut warnings = warnings(&*source, &sorted, &schemas, &settings)?;
        warnings.extend(doubt);
        let task = Task {
            warnings,
            simd,
            threads: demands.threads,
            settings,
            source,
            source_kind: sorted.source.0,
            transforms: sorted.transforms,
            schemas,
            filters: sorted.filters,
            passes: passes.passes,
            branches: passes.branches,
            sinks: sorted.sinks,
            changed_by: passes.changed_by,
            branch_of: passes.branch_of,
            computed: passes.computed,
            in_input_order: order.in_input_order,
            each,
            beside,
            ranks,
            tagger,
            mills: order.mills,
            lattice,
            demands,
        };
        Ok(Plan { task, ops: sorted.ops })
    }
}

/// Stages that fit each other and the headers of the inputs.
struct FittedStages {
    source: Box<dyn Source>,
    schemas: Schemas,
    choices: Vec<Choice>,
    passes: Passes,
}

/// Opens the inputs and fits the stages to them. What is `wrong` so far is told with what is found
/// here.
fn fit_stages(sorted: &mut Sorted, mut wrong: Vec<Error>) -> Result<FittedStages> {
    let source = match sorted.source.1.open() {
        Ok(source) => source,
        Err(error) => {
            wrong.push(error);
            return Err(Error::several(wrong));
        }
    };
    let (schemas, unfit) = fit_transforms(sorted, source.schema());
    wrong.extend(unfit);
    wrong.extend(check_limits(sorted, &schemas.last));
    wrong.extend(check_numbers(sorted, &*source).err());
    wrong.extend(fit(&mut sorted.ops, &source.metadata().units));
    let choices = number_selections(&mut sorted.ops)?;
    let passes = unroll(sorted, &schemas.last, &mut wrong)?;
    Error::all(wrong)?;
    Ok(FittedStages { source, schemas, choices, passes })
}

/// Fits tile stages to the units of the scan: lengths with a unit of their own are converted.
fn fit(ops: &mut [StageOp], units: &Units) -> Vec<Error> {
    let unfit = |stage: &mut StageOp| {
        let error = stage.op.tile_mut().convert(units).err()?;
        Some(blame(&*stage.written, error))
    };
    ops.iter_mut().filter_map(unfit).collect()
}

/// What tells records apart as they are decoded.
fn tagger(
    ops: &[StageOp],
    passes: &[Pass],
    choices: &[Choice],
    ranks: &[u32],
    schema: &Schema,
    settings: &RunSettings,
) -> Result<Tagger> {
    let classed = passes.iter().any(|pass| pass.reads_classes);
    if classed && ranks.len() > CLASSED_INPUTS as usize {
        let told = format!(
            "more than {CLASSED_INPUTS} inputs cannot have an output each where a stage looks at \
             classes"
        );
        return Err(Error::pipeline(told).help("run them in several parts"));
    }
    let mut tagger = Tagger::new(schema, choices, classed, ranks.to_vec());
    if !ops.is_empty() {
        tagger.treat(schema, settings);
    }
    Ok(tagger)
}

/// Where points are, for a run that asks, and why z may be measured wrong.
fn lattice(
    settings: &RunSettings,
    (source, schema): (&dyn Source, &Schema),
    ops: &[StageOp],
    mills: bool,
) -> Result<(Option<Lattice>, Option<String>)> {
    let Stretch { factor, doubt } = stretch(settings, source, ops)?;
    if !mills && settings.nonfinite != Nonfinite::Drop {
        return Ok((None, doubt));
    }
    let lattice = Lattice::stretched(schema, settings.lattice, factor)?;
    check_lengths(ops, &lattice)?;
    Ok((Some(lattice), doubt))
}

/// What a run depends on in its memory, but the lists of outputs that are one for each input.
fn demands(
    sorted: &Sorted,
    Passes { passes, computed, .. }: &Passes,
    (source, schema): (&dyn Source, &Arc<Schema>),
    order: &WriteOrder,
    settings: &RunSettings,
) -> Result<Demands> {
    let limit = settings.memory.unwrap_or_else(default_memory);
    let chunks = chunks(sorted, computed, (source, schema))?;
    let columns = passes.iter().map(|pass| pass.column_bytes(computed));
    let ranked =
        order.in_input_order.iter().filter(|ranked| **ranked && order.mills).count() as u64;
    Ok(Demands {
        lists: by_rank::lists_bytes(source.points()) * ranked,
        ranked: ranked > 0,
        mills: order.mills,
        filters: passes.iter().any(Pass::streams),
        standings: standings(passes),
        columns: columns.fold(ColumnBytes::default(), ColumnBytes::larger),
        passes: passes.iter().map(|pass| pass.needs(&sorted.ops).collect()).collect(),
        run_most: settings.tile_points.map(|points| (points.get() as u64).saturating_mul(4)),
        gathers: sorted.ops.iter().any(|stage| matches!(stage.op, Op::Scan(_))),
        has_cells: sorted.ops.iter().any(|stage| stage.op.tile().needs().cells),
        ..Demands::of(source, &chunks, limit, threads(settings)?)
    })
}

/// In which order records are written.
struct WriteOrder {
    /// True if the run needs tiles: for its stages, or because an output is to be in canonical
    /// order.
    mills: bool,
    /// For each sink, whether it gets the order of the inputs.
    in_input_order: Vec<bool>,
}

impl WriteOrder {
    fn new(sorted: &Sorted, source: &dyn Source) -> Result<WriteOrder> {
        let sinks = &sorted.sinks;
        // Branches of stages that stream go by tiles, and keep the order that a stream has.
        let (ops, streams) = (!sorted.ops.is_empty(), !sorted.filters.is_empty());
        let each = || sinks.iter().map(|sink| &**sink);
        let sorts = |sink: &dyn CreateSink| sink.is_folder() || sink.order() == Order::Canonical;
        let mills = ops || streams || each().any(sorts);
        let keeps = |sink: &dyn CreateSink| match sink.order() {
            Order::Input => true,
            Order::Auto => streams && !ops && !sink.is_folder(),
            Order::Canonical => false,
        };
        let in_input_order: Vec<bool> = each().map(keeps).collect();
        if mills && in_input_order.contains(&true) && source.parts() > by_rank::MOST_PARTS {
            let told = "the inputs have too many parts for an output in their order";
            return Err(Error::pipeline(told).help("leave `write.order` out"));
        }
        Ok(WriteOrder { mills, in_input_order })
    }
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

/// What outputs will not hold. Records that they cannot hold are an error where all are written,
/// and a warning where a stage may remove them first and leave others. Then what stages have
/// nothing to do of.
fn warnings(
    source: &dyn Source,
    sorted: &Sorted,
    schemas: &Schemas,
    settings: &RunSettings,
) -> Result<Vec<String>> {
    let Sorted { sinks, transforms, filters, ops, .. } = sorted;
    let schema = &schemas.last;
    let lost = sinks.iter().flat_map(|sink| sink.warnings(schema, source.metadata()));
    let mut warnings: Vec<String> = lost.collect();
    let unfit = look(source, sinks, (transforms, schemas), settings.nonfinite == Nonfinite::Drop)?;
    if let Some(Unfit { error, none_fits }) = unfit {
        // Where none fits there is nothing that stages could leave.
        if none_fits || transforms.is_empty() && filters.is_empty() && ops.is_empty() {
            return Err(error);
        }
        let help = error.remedy().map_or(String::new(), |help| format!("; {help}"));
        warnings.push(format!("{error}: the run fails if such a point is kept{help}"));
    }
    let seen = [source.schema()].into_iter().chain(&schemas.left_by);
    let decoded = transforms.iter().zip(seen);
    let all = decoded.chain(filters.iter().map(|stage| (stage, schema)));
    warnings.extend(all.flat_map(|(stage, schema)| stage.transform.warnings(schema)));
    let mover = transforms.iter().find(|stage| stage.moves());
    warnings.extend(mover.filter(|_| source.metadata().crs.is_some()).map(|stage| {
        format!(
            "outputs carry on the coordinate reference system of the input, which may not hold for \
             the points that `{}` moves",
            stage.kind
        )
    }));
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

/// The chunks of all outputs.
fn chunks(
    sorted: &Sorted,
    computed: &[Vec<ComputedDimension>],
    (source, schema): (&dyn Source, &Arc<Schema>),
) -> Result<Vec<ChunkSize>> {
    let (mut chunks, mut wrong) = (Vec::new(), Vec::new());
    let sinks = sorted.sinks.iter().zip(&sorted.written_sinks);
    for ((sink, written), computed) in sinks.zip(computed) {
        let metadata = Metadata { computed: computed.clone(), ..source.metadata().clone() };
        match sink.chunk(schema, &metadata) {
            Ok(chunk) => chunks.push(chunk),
            Err(error) => wrong.push(blame(&**written, error)),
        }
    }
    Error::all(wrong).map(|()| chunks)
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
