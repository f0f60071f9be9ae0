//! Running a plan: begin, stream or mill, account, publish.
//!
//! Everything that can be refused is refused first: places for outputs are made, sinks are opened,
//! memory is divided and disks are asked before the first point is read. Nothing gets its name
//! before the ledgers balance, so a run that fails leaves what was there as it was.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use super::Watch;
use super::account::{nothing_left, write_report};
use super::by_rank::listed_bytes;
use super::clock::Clock;
use super::demands::Demands;
use super::finished::Finished;
use super::job::{Each, Job};
use super::mill::mill;
use super::publish::{Staged, make_folder, publish};
use super::room;
use super::room::Taken;
use super::scratch::{Scratch, Trouble, memory_warning};
use super::stream::stream;
use super::tagger::ClassOf;
use super::task::Task;
use crate::budget::Budget;
use crate::graph::{Nonfinite, SpillSetting};
use crate::host::{Threads, lock};
use crate::point::names;
use crate::report::{FileFigures, Report, RunFigures};
use crate::stage::Sink;
use crate::store::SpillArea;
use crate::{Error, Result};

/// A run that is done. Displayed as a few lines for the terminal.
#[derive(Debug)]
#[non_exhaustive]
pub struct Done {
    /// What it says it did; its tiles are in the file alone.
    pub report: Report,
    /// The file of the whole report, if one was wanted.
    pub report_path: Option<PathBuf>,
    /// The sign of the unit that lengths are in, where the scan says it.
    pub unit: Option<&'static str>,
}

impl std::fmt::Display for Done {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.report.table(self.report_path.as_deref()).in_unit(self.unit).fmt(f)
    }
}

impl Task {
    /// Runs the task on threads of its own; outputs appear under their names when all of it is
    /// done.
    pub fn run(self, watch: &dyn Watch) -> Result<Done> {
        Threads::start(self.threads, |threads| self.run_on(threads, watch))
    }

    /// Runs the task on these threads.
    pub fn run_on(mut self, threads: Threads<'_>, watch: &dyn Watch) -> Result<Done> {
        self.threads = threads.count();
        let trouble = Trouble::default();
        let outcome = self.run_and_publish(threads, watch, &trouble);
        // All scratch is gone by now, or will not go.
        lock(&trouble).iter().for_each(|told| watch.warn(told));
        outcome
    }

    fn run_and_publish(
        mut self,
        threads: Threads<'_>,
        watch: &dyn Watch,
        trouble: &Trouble,
    ) -> Result<Done> {
        let mut clock = Clock::new(watch);
        let outputs = self.stage(trouble)?;
        let nothing = || Error::pipeline("the pipeline writes nothing");
        let first = outputs.iter().flatten().next().ok_or_else(nothing)?;
        let staged_report =
            self.settings.report.as_deref().map(|path| first.also(path, trouble)).transpose()?;
        let tell = |error| outputs.iter().flatten().fold(error, |error, output| output.tell(error));
        let (finished, mut run) =
            self.work(&outputs, threads, &mut clock, watch, trouble).map_err(tell)?;
        let beside: Vec<Staged> =
            self.beside.iter().map(|copy| copy.make(first, trouble)).collect::<Result<_>>()?;
        run.outputs.extend(beside.iter().zip(&self.beside).map(|(staged, copy)| {
            let bytes = fs::metadata(staged.file()).ok().map(|about| about.len());
            FileFigures::of(&copy.to, 0, bytes)
        }));
        let (report, tiles) = self.account(finished, run, clock)?;
        if let Some(staged) = &staged_report {
            write_report(staged.file(), &report, &tiles).map_err(|error| staged.tell(error))?;
        }
        drop(tiles);
        // What an output refers to comes first, so that none refers to what is not there.
        let outputs: Vec<Staged> =
            beside.into_iter().chain(outputs.into_iter().flatten()).collect();
        publish(&outputs, staged_report.as_ref())?;
        let unit = self.source.metadata().units.sign();
        Ok(Done { report, report_path: self.settings.report, unit })
    }

    /// Makes places for the files of all sinks.
    fn stage(&self, trouble: &Trouble) -> Result<Vec<Vec<Staged>>> {
        let mut outputs: Vec<Vec<Staged>> = Vec::new();
        for (n, sink) in self.sinks.iter().enumerate() {
            if sink.is_folder() {
                make_folder(sink.path())?;
            }
            let mut staged: Vec<Staged> = Vec::new();
            for file in self.files(n) {
                let one = match staged.first().or(outputs.iter().flatten().next()) {
                    Some(first) => first.also(file.path(), trouble)?,
                    None => Staged::beside(file.path(), self.settings.existing, trouble)?,
                };
                staged.push(one);
            }
            outputs.push(staged);
        }
        Ok(outputs)
    }

    /// Opens the sinks but those of the inputs, which are created one by one, when their records
    /// are known.
    fn create_sinks(&self, outputs: &[Vec<Staged>]) -> Result<Vec<Option<Box<dyn Sink>>>> {
        let schema = self.source.schema();
        let whole = !self.mills
            && self.transforms.is_empty()
            && self.settings.nonfinite == Nonfinite::Refuse;
        let mut sinks = Vec::new();
        let each = self.sinks.iter().zip(outputs).zip(self.pipelines()).enumerate();
        for (n, ((sink, staged), pipeline)) in each {
            let metadata = self.metadata(n, (!whole).then_some(pipeline));
            let file = staged.first().filter(|_| !sink.is_folder());
            let open = file.map(|file| sink.create(file.file(), schema, &metadata, whole));
            sinks.push(open.transpose()?);
        }
        Ok(sinks)
    }

    /// Streams or mills into the staged outputs.
    fn work(
        &mut self,
        outputs: &[Vec<Staged>],
        threads: Threads<'_>,
        clock: &mut Clock<'_>,
        watch: &dyn Watch,
        trouble: &Trouble,
    ) -> Result<(Finished, RunFigures)> {
        let sinks = self.create_sinks(outputs)?;
        let shares = self.demands.divide()?;
        let budget = Budget::new(self.demands.limit);
        let _base = budget.lease_all(&self.demands.base(), "program")?;
        let spill = match (&self.settings.scratch, outputs.iter().flatten().next()) {
            (None, Some(first)) => first.scratch().clone(),
            (Some(folder), _) => Arc::new(Scratch::below(folder, trouble)),
            (None, None) => return Err(Error::pipeline("the pipeline writes nothing")),
        };
        let kept_in_memory = match self.settings.spill {
            SpillSetting::Auto => shares.kept_in_memory,
            SpillSetting::Always => 0,
        };
        let area = SpillArea::new(budget.clone(), kept_in_memory, Box::new(spill.clone()));
        let unread = self.unread();
        let transforms = std::mem::take(&mut self.transforms);
        let (ops, passes) = (std::mem::take(&mut self.ops), std::mem::take(&mut self.passes));
        let mut job =
            Job { transforms, ops, passes, unread, ..self.job(outputs, &budget, threads, watch) };
        let doubts = self.check_room(outputs, spill.parent(), kept_in_memory, &job)?;
        self.warnings.iter().cloned().chain(doubts).for_each(|warning| job.warn(warning));
        let finished = match &self.lattice {
            Some(lattice) if self.mills => {
                mill(&mut job, lattice, &shares, &self.demands, &area, sinks, clock)?
            }
            lattice => {
                clock.phase("convert", Some(self.source.points()));
                let sinks = sinks.into_iter().flatten().collect();
                let _working = budget.lease_all(&self.demands.stream(), "streaming")?;
                stream(&job, sinks, lattice.as_ref())?
            }
        };
        let earlier = std::mem::take(&mut *lock(&job.warnings));
        let nothing_left = nothing_left(&finished, &job);
        drop(job);
        let mut run = self.figures(&finished, &budget, area.written());
        run.warnings.extend(nothing_left);
        run.warnings.extend(memory_warning(spill.parent(), area.written()));
        run.warnings.iter().for_each(|warning| watch.warn(warning));
        run.warnings.splice(0..0, earlier);
        Ok((finished, run))
    }

    /// Refuses disks that have no room for what is spilled and, where nothing is removed, for
    /// outputs; a warning where a disk may be too small.
    fn check_room(
        &self,
        outputs: &[Vec<Staged>],
        spill: &Path,
        kept_in_memory: u64,
        job: &Job<'_>,
    ) -> Result<Vec<String>> {
        let mut all = Vec::new();
        if self.mills {
            let bytes = spilled(&self.demands, kept_in_memory);
            all.push(Taken { folder: spill, spilled: true, bytes, again: 0 });
        }
        let streams = !job.transforms.is_empty() || !job.filters.is_empty();
        let keeps = !streams && job.ops.is_empty() && !job.drop_nonfinite;
        for (n, (sink, staged)) in self.sinks.iter().zip(outputs).enumerate().filter(|_| keeps) {
            let Some(staged) = staged.first() else { continue };
            let each = sink.disk_bytes(self.source.schema(), &self.metadata(n, None))?;
            let [bytes, again] = each.map(|bytes| self.source.points().saturating_mul(bytes));
            all.push(Taken { folder: staged.scratch().parent(), spilled: false, bytes, again });
        }
        room::check(all.into_iter())
    }

    /// The stages on the branch of each sink, as outputs name them.
    fn pipelines(&self) -> Vec<Arc<str>> {
        let named: Vec<Arc<str>> =
            self.branches.iter().map(|branch| branch.stages.to_string().into()).collect();
        self.branch_of.iter().map(|&branch| named[branch].clone()).collect()
    }

    /// The dimensions that nobody looks at: no sink, and neither what counts classes and tells
    /// records apart by class and flags. What a transform looks at is not known for sure.
    fn unread(&self) -> Vec<String> {
        const LOOKED_AT: [&str; 5] = [
            names::CLASSIFICATION,
            names::SYNTHETIC,
            names::KEY_POINT,
            names::WITHHELD,
            names::OVERLAP,
        ];
        let Some((first, others)) = self.sinks.split_first() else { return Vec::new() };
        let by_all = |name: &&String| others.iter().all(|sink| sink.unread().contains(*name));
        let mut unread: Vec<String> = first.unread().iter().filter(by_all).cloned().collect();
        let streams = !self.transforms.is_empty() || !self.filters.is_empty();
        let columns = || self.passes.iter().flat_map(|pass| &pass.dimensions);
        let is_column = |name: &str| columns().any(|column| column.name() == name);
        let is_read = |name: &str| streams || LOOKED_AT.contains(&name) || is_column(name);
        unread.retain(|name| !is_read(name));
        unread
    }

    /// What every phase needs but the stages.
    fn job<'a>(
        &'a self,
        outputs: &'a [Vec<Staged>],
        budget: &Budget,
        threads: Threads<'a>,
        watch: &'a dyn Watch,
    ) -> Job<'a> {
        let outputs = self.each.iter().zip(&self.sinks).zip(outputs).enumerate();
        let each = outputs.map(|(n, ((each, sink), staged))| {
            let chunk = sink.chunk(self.source.schema(), &self.metadata(n, None));
            let chunk_points = chunk.map_or(self.demands.chunk.points, |chunk| chunk.points);
            let ranks = &self.ranks;
            (!each.is_empty()).then_some(Each { sinks: each, staged, ranks, chunk_points })
        });
        let tile_points = self.settings.tile_points.map(usize::from);
        Job {
            source: &*self.source,
            source_kind: self.source_kind.clone(),
            pipelines: self.pipelines(),
            transforms: Vec::new(),
            unread: Vec::new(),
            ops: Vec::new(),
            filters: &self.filters,
            changed_by: &self.changed_by,
            passes: Vec::new(),
            branches: &self.branches,
            each: each.collect(),
            tagger: self.tagger.clone(),
            classes: ClassOf::new(self.source.schema()),
            budget: budget.clone(),
            threads,
            simd: self.simd,
            drop_nonfinite: self.settings.nonfinite == Nonfinite::Drop,
            headers: self.settings.headers,
            tile_points,
            computed: &self.computed,
            in_input_order: &self.in_input_order,
            by_time: self.sinks.iter().map(|sink| sink.likes_time()).collect(),
            watch,
            warnings: Mutex::default(),
            failed: AtomicBool::new(false),
        }
    }
}

/// Bytes that a run spills: records, their order, packed positions twice (runs and merged scan),
/// states and fates twice (of the pass before and of the pass at work), and columns between passes.
/// Ranks in the input, and the lists that are sorted by them.
fn spilled(demands: &Demands, kept_in_memory: u64) -> u64 {
    let order = if demands.tagged { 12 } else { 8 }
        + if demands.ranked { 8 + listed_bytes(demands.columns.row) } else { 0 };
    let columns = demands.columns.stored as u64 + if demands.passes.len() > 1 { 1 + 4 } else { 0 };
    let each = demands.stride as u64 + order + 2 * 8 + 1 + 4 + columns;
    demands.points.saturating_mul(each).saturating_sub(kept_in_memory)
}
