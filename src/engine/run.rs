//! Running a plan: begin, stream or mill, account, publish.

use std::fs::{self, File};
use std::io::{BufRead, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use super::Watch;
use super::by_rank::LISTED;
use super::clock::Clock;
use super::finished::{Finished, FinishedBranch};
use super::job::{Each, Job};
use super::lines::TileLines;
use super::mill::mill;
use super::pass::Branch;
use super::publish::{Staged, make_folder, publish};
use super::room;
use super::room::Taken;
use super::scratch::{Scratch, Trouble, memory_warning};
use super::shares::Demands;
use super::stream::stream;
use super::tagger::{ClassOf, LEFT_OUT, NOT_FINITE};
use super::task::Task;
use crate::budget::Budget;
use crate::graph::{Nonfinite, SpillSetting};
use crate::host::process::peak_memory;
use crate::host::{Threads, lock};
use crate::point::names;
use crate::report::{
    Decision, FileFigures, Grouped, LatticeFigures, Ledger, Machine, Outcome, Removed, Report,
    RunFigures, check_written,
};
use crate::stage::{CreateSink, Input, Sink, SinkSummary, Source};
use crate::store::SpillArea;
use crate::{Error, Result};

/// A run that is done. Displayed as a few lines for the terminal.
#[derive(Debug)]
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
    /// Runs the task on threads of its own; outputs appear under their names when all of it is done.
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

    /// The files of a sink, one for each input where it is a folder.
    fn files(&self, sink: usize) -> &[Box<dyn CreateSink>] {
        match self.each.get(sink) {
            Some(each) if !each.is_empty() => each,
            _ => &self.sinks[sink..=sink],
        }
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

    /// Opens the sinks but those of the inputs, which are created one by one, when their records are
    /// known.
    fn create_sinks(&self, outputs: &[Vec<Staged>]) -> Result<Vec<Option<Box<dyn Sink>>>> {
        let schema = self.source.schema();
        let whole = !self.mills
            && self.transforms.is_empty()
            && self.settings.nonfinite == Nonfinite::Refuse;
        let mut metadata = self.source.metadata().clone();
        let mut sinks = Vec::new();
        for ((sink, staged), pipeline) in self.sinks.iter().zip(outputs).zip(self.pipelines()) {
            metadata.pipeline = (!whole).then_some(pipeline);
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

    /// Refuses disks that have no room for what is spilled and, where nothing is removed, for outputs;
    /// a warning where a disk may be too small.
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
        for (sink, staged) in self.sinks.iter().zip(outputs).filter(|_| keeps) {
            let Some(staged) = staged.first() else { continue };
            let each = sink.disk_bytes(self.source.schema(), self.source.metadata())?;
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

    /// The dimensions that nobody looks at: no sink, and neither what counts classes and tells records
    /// apart by class and flags. What a transform looks at is not known for sure.
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
        unread.retain(|name| !LOOKED_AT.contains(&name.as_str()) && !streams);
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
        let each = self.each.iter().zip(&self.sinks).zip(outputs).map(|((each, sink), staged)| {
            let chunk = sink.chunk(self.source.schema(), self.source.metadata());
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
            wants_normals: self.sinks.iter().map(|sink| sink.wants_normals()).collect(),
            in_input_order: &self.in_input_order,
            by_time: self.sinks.iter().map(|sink| sink.likes_time()).collect(),
            watch,
            warnings: Mutex::default(),
            failed: AtomicBool::new(false),
        }
    }

    /// The files of all sinks, each with the records that it was given and what it said.
    fn written<'a>(
        &'a self,
        finished: &'a Finished,
    ) -> impl Iterator<Item = (&'a dyn CreateSink, &'a (u64, SinkSummary))> {
        let files = (0..self.sinks.len()).flat_map(|sink| self.files(sink)).map(|file| &**file);
        files.zip(finished.written.iter().flatten())
    }

    /// What is known of the run when its output is written.
    fn figures(&self, finished: &Finished, budget: &Budget, spill_bytes: u64) -> RunFigures {
        let mut warnings = self.source.warnings();
        let all = finished.written.iter().flatten();
        warnings.extend(all.flat_map(|(_, sink)| sink.notes.iter().cloned()));
        let outputs = self.written(finished).map(|(sink, (_, summary))| {
            FileFigures::of(sink.path(), summary.points, Some(summary.bytes))
        });
        RunFigures {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            inputs: input_figures(&*self.source),
            outputs: outputs.collect(),
            machine: Machine::this(),
            threads: self.threads,
            memory_bytes: self.demands.limit,
            leased_bytes: budget.peak(),
            memory_holders: budget.at_peak(),
            spill_bytes,
            warnings,
            ..RunFigures::default()
        }
    }

    /// The report of a finished run, once its ledgers balance, and the lines of the tiles of each
    /// branch.
    fn account(
        &self,
        finished: Finished,
        mut run: RunFigures,
        clock: Clock<'_>,
    ) -> Result<(Report, Vec<Option<TileLines>>)> {
        for (sink, (given, summary)) in self.written(&finished) {
            check_written(sink.path(), *given, summary.points)?;
        }
        (run.seconds, run.cpu_seconds, run.phases) = clock.finish();
        run.peak_memory_bytes = peak_memory();
        run.work = finished.tally.work.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect();
        let (mut results, mut lines) = (Vec::new(), Vec::new());
        for (branch, came_to) in self.branches.iter().zip(finished.branches) {
            let (result, tiles) = self.outcome(branch, came_to, finished.read)?;
            results.push(result);
            lines.push(tiles);
        }
        let mut results = results.into_iter();
        let result = results.next().ok_or_else(|| Error::internal("a run came to nothing"))?;
        Ok((Report { result, further: results.collect(), run }, lines))
    }

    /// What a branch came to, of so many records that were read.
    fn outcome(
        &self,
        branch: &Branch,
        finished: FinishedBranch,
        read: u64,
    ) -> Result<(Outcome, Option<TileLines>)> {
        let ledger = Ledger::new(read, finished.kept, &finished.tally);
        ledger.check()?;
        let (tile_side, totals, tiles) = match finished.measured {
            Some(measured) => {
                (Some(measured.tile_side), Some(measured.totals), Some(measured.tiles))
            }
            None => (None, None, None),
        };
        let lattice = self.lattice.as_ref();
        let mut decisions = finished.decisions;
        if let Some(lattice) = lattice.filter(|lattice| lattice.z_scale() != 1.0) {
            let (stage, name) = ("run".to_owned(), "z_scale".to_owned());
            decisions.insert(0, Decision { stage, name, value: lattice.z_scale().into() });
        }
        let outcome = Outcome {
            pipeline: branch.stages.clone(),
            lattice: lattice.map(|l| LatticeFigures { step: l.step, shift: l.shift }),
            ledger,
            decisions,
            counts: finished.tally.counts.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect(),
            passes: finished.passes,
            tile_side,
            totals,
            classes: finished.classes,
        };
        Ok((outcome, tiles))
    }
}

/// Says that outputs are empty: that the input was so too, or what removed the points, by the settings
/// that say so where there are any: the stages of commands are nothing that their users know.
fn nothing_left(finished: &Finished, job: &Job<'_>) -> Vec<String> {
    if finished.read == 0 {
        return vec!["the inputs have no points: what is written has none either".to_owned()];
    }
    let behind = job.filters.iter().map(|filter| (&filter.kind, &filter.transform));
    let streams: Vec<_> =
        job.transforms.iter().map(|(kind, stage)| (kind, stage)).chain(behind).collect();
    let keys = |r: &Removed| -> Vec<&str> {
        let ours = streams.iter().filter(|(kind, _)| **kind == r.stage);
        let run = LEFT_OUT.iter().filter(|(reason, ..)| *reason == r.reason);
        let nonfinite = (r.reason == NOT_FINITE).then_some("run.nonfinite");
        let of_run = run.map(|(_, setting, _)| *setting).chain(nonfinite);
        ours.flat_map(|(_, stage)| stage.removes_by()).chain(of_run).collect()
    };
    let by = |r: &Removed| {
        let keys: Vec<String> = keys(r).iter().map(|key| format!("`{key}`")).collect();
        let by = if keys.is_empty() { r.stage.clone() } else { keys.join(" and ") };
        format!("{} {} ({by})", Grouped(r.records), r.reason)
    };
    let empty = finished.branches.iter().filter(|branch| branch.kept == 0);
    let ledgers = empty.map(|branch| Ledger::new(finished.read, branch.kept, &branch.tally));
    let told = ledgers.map(|ledger| {
        let by: Vec<String> = ledger.removed.iter().map(by).collect();
        format!("no point is left of {}: {}", Grouped(ledger.read), by.join(", "))
    });
    told.collect()
}

/// The lines of a branch's report tiles; none if it has none.
fn lines_of(tiles: &Option<TileLines>) -> Box<dyn BufRead + '_> {
    match tiles {
        Some(lines) => Box::new(lines.reader()),
        None => Box::new(std::io::empty()),
    }
}

/// Writes the report to `staged` and brings it to disk.
fn write_report(staged: &Path, report: &Report, tiles: &[Option<TileLines>]) -> Result<()> {
    let write = || {
        let mut out = BufWriter::new(File::create(staged)?);
        report.write_all(&mut out, tiles.iter().map(lines_of))?;
        out.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()
    };
    // Lines that the spill cannot give back are its error, about its file.
    write().map_err(|e| match e.downcast::<Error>() {
        Ok(error) => error,
        Err(e) => Error::io(staged, "write the report", e),
    })
}

fn input_figures(source: &dyn Source) -> Vec<FileFigures> {
    let figures = |input: Input| {
        let bytes = fs::metadata(&input.path).ok().map(|about| about.len());
        FileFigures::of(&input.path, input.points, bytes)
    };
    source.inputs().into_iter().map(figures).collect()
}

/// Bytes that a run spills: records, their order, packed positions twice (runs and merged scan),
/// states and fates twice (of the pass before and of the pass at work), and columns between passes.
/// Ranks in the input, and the lists that are sorted by them.
fn spilled(demands: &Demands, kept_in_memory: u64) -> u64 {
    let order = if demands.tagged { 12 } else { 8 } + if demands.ranked { 8 + LISTED } else { 0 };
    let columns = if demands.passes.len() > 1 { 1 + 4 + 12 + 8 } else { 0 };
    let each = demands.stride as u64 + order + 2 * 8 + 1 + 4 + columns;
    demands.points.saturating_mul(each).saturating_sub(kept_in_memory)
}
