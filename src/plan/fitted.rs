//! A pipeline that fits: its source open, its lattice fixed, its stages in passes, its memory
//! divided.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use rayon::ThreadPool;

use super::accepted::accepted;
use super::demanded::{FilesOfOutputs, demands};
use super::limits::{check_limits, number_selections};
use super::look::{Unfit, look, look_at_corners};
use super::meshes::{connected, triangulations};
use super::order::WriteOrder;
use super::passes::{Passes, unroll};
use super::places::{all_read, check_places, copies, each_input, not_beside, splits};
use super::sorted::{Sorted, blame};
use super::stretch::Stretch;
use super::told::ToldGraph;
use super::transforms::{check_numbers, fit_transforms};
use crate::budget::Bytes;
use crate::engine::pass::{Pass, StageOp};
use crate::engine::shares::Demands;
use crate::engine::tagger::Tagger;
use crate::engine::task::{GivenLengths, Schemas, Task};
use crate::engine::{Done, Watch};
use crate::error::shown;
use crate::expression::Choice;
use crate::geom::lattice::Lattice;
use crate::graph::Graph;
use crate::graph::{Nonfinite, Overrides, RunSettings};
use crate::host::Threads;
use crate::point::{Schema, Units};
use crate::quantity::Figure;
use crate::report::AcceptTable;
use crate::stage::{CreateSink, PointWalk, PointsAhead, Source};
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
        let (origin, file, traits) = (self.origin.clone(), self.file.clone(), self.traits);
        let (settings, rules) = (self.settings.clone().with(overrides), self.accept.clone());
        let told = ToldGraph::of(&self, &settings);
        let mut sorted = Sorted::new(self)?;
        let places = |read: &[PathBuf], sinks: &[Box<dyn CreateSink>]| {
            check_places(file.as_deref(), read, sinks, &settings)
        };
        let (_, wrong) = places(&sorted.source.1.paths(), &sorted.sinks);
        let FittedStages { source, schemas, choices, passes, given, accept } =
            fit_stages(&mut sorted, rules, wrong)?;
        settle(&mut sorted, &*source, &settings)?;
        let (schema, read) = (&schemas.last, all_read(&*sorted.source.1, &*source));
        let mut files = right(places(&read, &sorted.sinks))?;
        let (each, ranks) = each_input(&*source, &sorted.sinks, &settings, &mut files)?;
        let (splits, wide) = splits((&*source, schema), &sorted.sinks, &settings, &read)?;
        let beside = copies(&*source, &sorted.sinks, &each, &settings, &mut files)?;
        let tagger = tagger(&sorted.ops, &passes.passes, &choices, &ranks, schema, &settings)?;
        let order = WriteOrder::new(&sorted, &*source)?;
        let (lattice, doubt) = lattice(&settings, (&*source, schema), &sorted.ops, order.mills)?;
        let files = FilesOfOutputs { each: &each, splits: &splits, ranks: &ranks };
        let (from, ordered) = ((&*source, schema), (&order, &lattice));
        let demands = demands(&sorted, &passes, from, ordered, files, &settings)?;
        let demands = divided(demands, connected(&sorted, &*source), tagger.tags())?;
        let mut warnings = warnings(&*source, &sorted, &schemas, &settings)?;
        warnings.extend(doubt.into_iter().chain(wide).chain(not_beside(&*source, &sorted.sinks)));
        let task = Task {
            meshes: triangulations(&*source, &sorted, &passes.changed_by)?,
            provenance: told.provenance(&sorted, &order, &settings),
            warnings,
            simd: settings.simd.resolve().map_err(|error| located(error, &origin))?,
            threads: demands.threads,
            settings,
            accept,
            traits,
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
            splits,
            given,
            beside,
            ranks,
            tagger,
            mills: order.mills,
            lattice,
            demands,
            wanted: None,
        };
        Ok(Plan { task, ops: sorted.ops })
    }
}

/// An error of what the file `origin` says.
fn located(error: Error, origin: &str) -> Error {
    if origin.is_empty() { error } else { error.at(origin) }
}

/// What was looked at, unless something is wrong with it.
fn right<T>((found, wrong): (T, Vec<Error>)) -> Result<T> {
    Error::all(wrong)?;
    Ok(found)
}

/// The demands with such a mesh besides, if the memory does for them.
fn divided(demands: Demands, connected: Bytes, tagged: bool) -> Result<Demands> {
    let demands = Demands { tagged, connected, ..demands };
    demands.divide()?;
    Ok(demands)
}

/// Stages that fit each other and the headers of the inputs.
struct FittedStages {
    source: Box<dyn Source>,
    schemas: Schemas,
    choices: Vec<Choice>,
    passes: Passes,
    given: Vec<GivenLengths>,
    accept: AcceptTable,
}

/// Opens the inputs and fits the stages to them. What is `wrong` so far is told with what is found
/// here.
fn fit_stages(
    sorted: &mut Sorted,
    rules: AcceptTable,
    mut wrong: Vec<Error>,
) -> Result<FittedStages> {
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
    let (unfit, given) = fit(&mut sorted.ops, &source.metadata().units);
    wrong.extend(unfit);
    let choices = number_selections(&mut sorted.ops)?;
    let passes = unroll(sorted, &schemas.last, &mut wrong)?;
    let accept = accepted(rules, sorted, (&*source, &schemas.last), &mut wrong);
    Error::all(wrong)?;
    Ok(FittedStages { source, schemas, choices, passes, given, accept })
}

/// Has sinks find in the points what they are asked to find there.
fn settle(sorted: &mut Sorted, source: &dyn Source, settings: &RunSettings) -> Result<()> {
    let mut streaming = sorted.transforms.iter().chain(&sorted.filters);
    let mover = streaming.find(|stage| stage.moves());
    let ahead = PointsAhead {
        source,
        walk: PointWalk::with(settings.threads.map(NonZeroUsize::get), settings.memory),
        moved_by: mover.map(|stage| stage.kind.as_str()),
    };
    for sink in &mut sorted.sinks {
        if let Some(settled) = sink.settled(&ahead)? {
            *sink = settled;
        }
    }
    Ok(())
}

/// Fits tile stages to the units of the scan: lengths with a unit of their own are converted. What
/// is wrong, and of each stage what its lengths were given as.
fn fit(ops: &mut [StageOp], units: &Units) -> (Vec<Error>, Vec<GivenLengths>) {
    let (mut wrong, mut given) = (Vec::new(), Vec::new());
    for stage in ops {
        let lengths = stage.op.tile().lengths();
        let unfit = stage.op.tile_mut().convert(units).err();
        wrong.extend(unfit.map(|error| blame(&*stage.written, error)));
        let texts = lengths.into_iter().filter(|(_, length)| length.has_unit());
        given.push(texts.map(|(key, length)| (key, length.to_string())).collect());
    }
    (wrong, given)
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

/// Refuses lengths that are longer than the lattice.
fn check_lengths(ops: &[StageOp], lattice: &Lattice) -> Result<()> {
    let longest = lattice.longest();
    let mut lengths = ops.iter().flat_map(|stage| stage.op.tile().lengths());
    match lengths.find(|(_, length)| length.value() > longest) {
        None => Ok(()),
        Some((key, length)) => {
            let (length, steps) = (Figure(length.value()), Figure(lattice.step));
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
    } else if let Some(error) = look_at_corners(source, sinks, (transforms, schemas))? {
        let help = error.remedy().map_or(String::new(), |help| format!("; {help}"));
        warnings.push(format!(
            "{error}: the box in the header of the input reaches there, and the run fails if a \
             point that is kept does{help}"
        ));
    }
    let unmoved = transforms.iter().take_while(|stage| !stage.moves());
    if let Some(claimed) = source.claimed_box() {
        warnings.extend(unmoved.filter_map(|stage| stage.transform.misses(claimed)));
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
