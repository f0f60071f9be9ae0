//! Running a plan: begin, stream or mill, account, publish.

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use super::Watch;
use super::clock::Clock;
use super::each::Each;
use super::mill::mill;
use super::passes::{Pass, StageOp};
use super::plan::Plan;
use super::publish::{Staged, make_folder};
use super::scratch::{Scratch, free_space, memory_warning};
use super::settings::{Nonfinite, Spill};
use super::shares::{Demands, Shares};
use super::stream::stream;
use super::survey::{Lines, Measured};
use super::tagger::{ClassOf, Tagger};
use crate::budget::{Budget, Bytes};
use crate::geom::lattice::Misplaced;
use crate::point::PointBatch;
use crate::report::{
    ClassFigures, Decision, FileFigures, LatticeFigures, Ledger, Machine, Outcome, PassFigures,
    Report, RunFigures, Tally, check_written, peak_memory,
};
use crate::stage::{CreateSink, Input, Part, SinkSummary, Source, Transform};
use crate::tile::{SpillArea, lock, parallel};
use crate::{Error, ErrorKind, Result};

/// What every phase of a run needs.
pub(super) struct Job<'a> {
    pub source: &'a dyn Source,
    pub source_kind: String,
    pub transforms: Vec<(String, Box<dyn Transform>)>,
    pub ops: Vec<StageOp>,
    pub passes: Vec<Pass>,
    /// For each sink, where the outputs of the inputs go if each has its own.
    pub each: Vec<Option<Each<'a>>>,
    pub tagger: Tagger,
    pub classes: ClassOf,
    pub budget: Budget,
    pub threads: usize,
    pub drop_nonfinite: bool,
    pub tile_points: Option<usize>,
    pub run_records: Option<usize>,
    /// For each sink, whether it writes normals.
    pub wants_normals: Vec<bool>,
    /// A sink of what all stages leave.
    pub last_sink: usize,
    pub watch: &'a dyn Watch,
    /// What the user was warned of before the end.
    pub warnings: Mutex<Vec<String>>,
    /// Set once a thread has failed.
    pub failed: AtomicBool,
}

impl Job<'_> {
    /// Reads the next batch of a part through the transforms; false at its end.
    pub fn read(
        &self,
        part: &mut dyn Part,
        batch: &mut PointBatch,
        tally: &mut Tally,
    ) -> Result<bool> {
        batch.clear();
        part.read(batch)?;
        let read = batch.len() as u64;
        if read == 0 {
            return Ok(false);
        }
        tally.work("read", read);
        self.classes.read(batch, tally);
        for (kind, transform) in &self.transforms {
            let before = batch.len();
            transform.apply(batch)?;
            let removed = before
                .checked_sub(batch.len())
                .ok_or_else(|| Error::internal(format!("the stage {kind} made points up")))?;
            tally.remove(kind, "removed", removed as u64);
        }
        self.advance(read)?;
        Ok(true)
    }

    /// Warns of something now, and again in the report.
    pub fn warn(&self, message: String) {
        self.watch.warn(&message);
        lock(&self.warnings).push(message);
    }

    /// Tells of progress, and hears whether to go on.
    pub fn advance(&self, points: u64) -> Result<()> {
        self.watch.advance(points);
        let stop = self.watch.cancelled() || self.failed.load(Ordering::Relaxed);
        if stop { Err(Error::interrupted()) } else { Ok(()) }
    }

    /// Runs `work` on all threads; once one has failed, [`advance`](Job::advance) stops the others.
    pub fn parallel(&self, work: impl Fn() -> Result<()> + Sync) -> Result<()> {
        parallel(self.threads, |_| {
            let guard = StopOnDrop::new(|| self.failed.store(true, Ordering::Relaxed));
            work()?;
            guard.disarm();
            Ok(())
        })
    }

    /// The error of a record that has no place on the lattice.
    pub fn misplaced(&self, batch: &PointBatch, index: usize, why: Misplaced) -> Error {
        let schema = batch.schema();
        let record = &batch.records()[index * schema.stride..(index + 1) * schema.stride];
        let point = schema.coordinates().map(|axes| axes.map(|d| d.world(record, schema.endian)));
        let (what, help) = match why {
            Misplaced::NotFinite => {
                ("is not finite", "set nonfinite = \"drop\" under [run] to leave such points out")
            }
            Misplaced::TooFar => (
                "lies beyond the lattice",
                "set a larger `lattice` step under [run], or move the scan nearer to its origin",
            ),
        };
        let error = Error::new(
            ErrorKind::Data,
            format!("the point {:?} {what}", point.unwrap_or_default()),
        )
        .help(help);
        match self.source.inputs().get(batch.source as usize) {
            Some(input) => error.at(&input.path),
            None => error,
        }
    }
}

/// Calls its function when dropped, unless disarmed: what a thread does that leaves by an error or
/// a panic.
pub(super) struct StopOnDrop<F: Fn()>(Option<F>);

impl<F: Fn()> StopOnDrop<F> {
    pub fn new(stop: F) -> Self {
        StopOnDrop(Some(stop))
    }

    pub fn disarm(mut self) {
        self.0 = None;
    }
}

impl<F: Fn()> Drop for StopOnDrop<F> {
    fn drop(&mut self) {
        if let Some(stop) = &self.0 {
            stop();
        }
    }
}

/// What a stream or a mill came to.
pub(super) struct Finished {
    pub read: u64,
    pub kept: u64,
    /// For each file of each sink, the records that it was given, and what it says.
    pub written: Vec<Vec<(u64, SinkSummary)>>,
    pub tally: Tally,
    pub decisions: Vec<Decision>,
    pub classes: Vec<ClassFigures>,
    pub passes: Vec<PassFigures>,
    pub measured: Option<Measured>,
}

/// A run that is done. Displayed as a few lines for the terminal.
#[derive(Debug)]
pub struct Done {
    /// What it says it did; its tiles are in the file alone.
    pub report: Report,
    /// The file of the whole report, if one was wanted.
    pub report_path: Option<PathBuf>,
}

impl std::fmt::Display for Done {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.report.table(self.report_path.as_deref()).fmt(f)
    }
}

impl Plan {
    /// Runs the plan. Outputs appear under their names when all of it is done; an error or a stop
    /// that `watch` asks for leaves nothing behind.
    pub fn run(mut self, watch: &dyn Watch) -> Result<Done> {
        let mut clock = Clock::new(watch);
        let outputs = self.stage()?;
        let nothing = || Error::pipeline("the pipeline writes nothing");
        let first = outputs.iter().flatten().next().ok_or_else(nothing)?;
        let staged_report =
            self.settings.report.as_deref().map(|path| first.also(path)).transpose()?;
        let tell = |error| outputs.iter().flatten().fold(error, |error, output| output.tell(error));
        let (finished, run) = self.work(&outputs, &mut clock, watch).map_err(tell)?;
        let (report, tiles) = self.account(finished, run, clock)?;
        if let Some(staged) = &staged_report {
            write_report(staged.file(), &report, &tiles).map_err(|error| staged.tell(error))?;
        }
        drop(tiles);
        outputs.into_iter().flatten().try_for_each(Staged::publish)?;
        staged_report.map_or(Ok(()), Staged::publish)?;
        Ok(Done { report, report_path: self.settings.report })
    }

    /// The files of a sink, one for each input where it is a folder.
    fn files(&self, sink: usize) -> &[Box<dyn CreateSink>] {
        match self.each.get(sink) {
            Some(each) if !each.is_empty() => each,
            _ => &self.sinks[sink..=sink],
        }
    }

    /// Makes places for the files of all sinks.
    fn stage(&self) -> Result<Vec<Vec<Staged>>> {
        let mut outputs: Vec<Vec<Staged>> = Vec::new();
        for (n, sink) in self.sinks.iter().enumerate() {
            if sink.is_folder() {
                make_folder(sink.path())?;
            }
            let mut staged: Vec<Staged> = Vec::new();
            for file in self.files(n) {
                let one = match staged.first().or(outputs.iter().flatten().next()) {
                    Some(first) => first.also(file.path())?,
                    None => Staged::beside(file.path())?,
                };
                staged.push(one);
            }
            outputs.push(staged);
        }
        Ok(outputs)
    }

    /// Streams or mills into the staged outputs.
    fn work(
        &mut self,
        outputs: &[Vec<Staged>],
        clock: &mut Clock<'_>,
        watch: &dyn Watch,
    ) -> Result<(Finished, RunFigures)> {
        let (schema, metadata) = (self.source.schema(), self.source.metadata());
        let whole = !self.mills
            && self.transforms.is_empty()
            && self.settings.nonfinite == Nonfinite::Refuse;
        let mut sinks = Vec::new();
        for (sink, staged) in self.sinks.iter().zip(outputs) {
            // The outputs of the inputs are created one by one, when their records are known.
            let file = staged.first().filter(|_| !sink.is_folder());
            let open = file.map(|file| sink.create(file.file(), schema, metadata, whole));
            sinks.push(open.transpose()?);
        }
        let shares = self.demands.divide()?;
        let budget = Budget::new(self.demands.limit);
        let _base = budget.lease(shares.base, "program")?;
        let spill = match (&self.settings.scratch, outputs.iter().flatten().next()) {
            (None, Some(first)) => first.scratch().clone(),
            (Some(folder), _) => Arc::new(Scratch::below(folder)),
            (None, None) => return Err(Error::pipeline("the pipeline writes nothing")),
        };
        let kept_in_memory = match self.settings.spill {
            Spill::Auto => shares.kept_in_memory,
            Spill::Always => 0,
        };
        let area = SpillArea::new(budget.clone(), kept_in_memory, Box::new(spill.clone()));
        let transforms = std::mem::take(&mut self.transforms);
        let (ops, passes) = (std::mem::take(&mut self.ops), std::mem::take(&mut self.passes));
        let mut job = Job { transforms, ops, passes, ..self.job(outputs, &budget, &shares, watch) };
        let finished = match &self.lattice {
            Some(lattice) if self.mills => {
                check_disk(&self.demands, &spill, kept_in_memory)?;
                mill(&mut job, lattice, &shares, &self.demands, &area, sinks, clock)?
            }
            lattice => {
                clock.phase("convert", Some(self.source.points()));
                stream(&job, &shares, sinks.into_iter().flatten().collect(), lattice.as_ref())?
            }
        };
        let earlier = std::mem::take(&mut *lock(&job.warnings));
        drop(job);
        let mut run = self.figures(&finished, &budget, area.written());
        run.warnings.extend(memory_warning(spill.parent(), area.written()));
        run.warnings.iter().for_each(|warning| watch.warn(warning));
        run.warnings.splice(0..0, earlier);
        Ok((finished, run))
    }

    /// What every phase needs but the stages.
    fn job<'a>(
        &'a self,
        outputs: &'a [Vec<Staged>],
        budget: &Budget,
        shares: &Shares,
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
            transforms: Vec::new(),
            ops: Vec::new(),
            passes: Vec::new(),
            each: each.collect(),
            tagger: self.tagger.clone(),
            classes: ClassOf::new(self.source.schema()),
            budget: budget.clone(),
            threads: self.threads,
            drop_nonfinite: self.settings.nonfinite == Nonfinite::Drop,
            tile_points,
            run_records: tile_points.map(|n| n.saturating_mul(4).min(shares.run_records)),
            wants_normals: self.sinks.iter().map(|sink| sink.wants_normals()).collect(),
            last_sink: self.last_sink,
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
        let outputs = self.written(finished).map(|(sink, (_, summary))| FileFigures {
            path: sink.path().display().to_string(),
            points: summary.points,
            bytes: Some(summary.bytes),
        });
        RunFigures {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            inputs: input_figures(&*self.source),
            outputs: outputs.collect(),
            machine: Machine::this(),
            threads: self.threads,
            memory_bytes: self.demands.limit,
            leased_bytes: budget.peak(),
            spill_bytes,
            warnings,
            ..RunFigures::default()
        }
    }

    /// The report of a finished run, once its ledger balances, and the lines of its tiles.
    fn account(
        &self,
        finished: Finished,
        mut run: RunFigures,
        clock: Clock<'_>,
    ) -> Result<(Report, Option<Lines>)> {
        let ledger = Ledger::new(finished.read, finished.kept, &finished.tally);
        ledger.check()?;
        for (sink, (given, summary)) in self.written(&finished) {
            check_written(sink.path(), *given, summary.points)?;
        }
        (run.seconds, run.cpu_seconds, run.phases) = clock.finish();
        run.peak_memory_bytes = peak_memory();
        run.work = finished.tally.work.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect();
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
        let result = Outcome {
            pipeline: self.stages.clone(),
            lattice: lattice.map(|l| LatticeFigures { step: l.step, shift: l.shift }),
            ledger,
            decisions,
            counts: finished.tally.counts.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect(),
            passes: finished.passes,
            tile_side,
            totals,
            classes: finished.classes,
        };
        Ok((Report { result, run }, tiles))
    }
}

/// Writes the report to `staged` and brings it to disk.
fn write_report(staged: &Path, report: &Report, tiles: &Option<Lines>) -> Result<()> {
    let write = || {
        let mut out = BufWriter::new(File::create(staged)?);
        match tiles {
            Some(lines) => report.write(&mut out, &mut lines.reader())?,
            None => report.write(&mut out, &mut std::io::empty())?,
        }
        out.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()
    };
    write().map_err(|e| Error::io(staged, "write the report", e))
}

fn input_figures(source: &dyn Source) -> Vec<FileFigures> {
    let figures = |input: Input| FileFigures {
        bytes: fs::metadata(&input.path).ok().map(|m| m.len()),
        path: input.path.display().to_string(),
        points: input.points,
    };
    source.inputs().into_iter().map(figures).collect()
}

/// Refuses a run whose spill would not fit on the scratch disk.
fn check_disk(demands: &Demands, spill: &Scratch, kept_in_memory: u64) -> Result<()> {
    // Records, their order, packed positions twice (runs and merged scan), states and fates twice
    // (of the pass before and of the pass at work), and columns between passes.
    let order = if demands.tagged { 12 } else { 8 };
    let columns = if demands.passes.len() > 1 { 1 + 4 + 12 + 8 } else { 0 };
    let each = demands.stride as u64 + order + 2 * 8 + 1 + 4 + columns;
    let needed = demands.points.saturating_mul(each).saturating_sub(kept_in_memory);
    match free_space(spill.parent()) {
        Some(free) if free < needed => Err(Error::memory(format!(
            "the scan will spill about {}, and only {} are free here",
            Bytes(needed),
            Bytes(free)
        ))
        .at(spill.parent())
        .help("free some disk space, name another folder with --scratch, or give more --memory")),
        _ => Ok(()),
    }
}
