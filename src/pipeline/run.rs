//! Running a plan: begin, stream or mill, account, publish.

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::Watch;
use super::clock::Clock;
use super::mill::mill;
use super::plan::Plan;
use super::publish::Staged;
use super::scratch::{Scratch, free_space, memory_warning};
use super::settings::{Nonfinite, Spill};
use super::shares::Demands;
use super::stream::stream;
use super::survey::{Lines, Measured};
use crate::budget::{Budget, Bytes};
use crate::geom::lattice::Misplaced;
use crate::point::PointBatch;
use crate::report::{
    Decision, FileFigures, Ledger, Machine, Outcome, Report, RunFigures, Tally, peak_memory,
};
use crate::stage::{Input, Part, SinkSummary, Source, TileOp, Transform};
use crate::tile::{SpillArea, parallel};
use crate::{Error, ErrorKind, Result};

/// What every phase of a run needs.
pub(super) struct Job<'a> {
    pub source: &'a dyn Source,
    pub source_kind: String,
    pub transforms: Vec<(String, Box<dyn Transform>)>,
    pub ops: Vec<(String, Box<dyn TileOp>)>,
    pub budget: Budget,
    pub threads: usize,
    pub drop_nonfinite: bool,
    pub tile_points: Option<usize>,
    pub run_records: Option<usize>,
    pub wants_normals: bool,
    pub watch: &'a dyn Watch,
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
    pub written: SinkSummary,
    pub tally: Tally,
    pub decisions: Vec<Decision>,
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
        let output = Staged::beside(self.sink.path())?;
        let staged_report =
            self.settings.report.as_deref().map(|path| output.also(path)).transpose()?;
        let (finished, run) =
            self.work(&output, &mut clock, watch).map_err(|error| output.tell(error))?;
        let (report, tiles) = self.account(finished, run, clock)?;
        if let Some(staged) = &staged_report {
            write_report(staged.file(), &report, &tiles).map_err(|error| staged.tell(error))?;
        }
        drop(tiles);
        output.publish()?;
        staged_report.map_or(Ok(()), Staged::publish)?;
        Ok(Done { report, report_path: self.settings.report })
    }

    /// Streams or mills into the staged output.
    fn work(
        &mut self,
        output: &Staged,
        clock: &mut Clock<'_>,
        watch: &dyn Watch,
    ) -> Result<(Finished, RunFigures)> {
        let (schema, metadata) = (self.source.schema(), self.source.metadata());
        let whole = !self.mills
            && self.transforms.is_empty()
            && self.settings.nonfinite == Nonfinite::Refuse;
        let sink = self.sink.create(output.file(), schema, metadata, whole)?;
        let shares = self.demands.divide()?;
        let budget = Budget::new(self.demands.limit);
        let _base = budget.lease(shares.base, "program")?;
        let spill = match &self.settings.scratch {
            Some(folder) => Arc::new(Scratch::below(folder)),
            None => output.scratch().clone(),
        };
        let kept_in_memory = match self.settings.spill {
            Spill::Auto => shares.kept_in_memory,
            Spill::Always => 0,
        };
        let area = SpillArea::new(budget.clone(), kept_in_memory, Box::new(spill.clone()));
        let tile_points = self.settings.tile_points.map(usize::from);
        let mut job = Job {
            source: &*self.source,
            source_kind: self.source_kind.clone(),
            transforms: std::mem::take(&mut self.transforms),
            ops: std::mem::take(&mut self.ops),
            budget: budget.clone(),
            threads: self.threads,
            drop_nonfinite: self.settings.nonfinite == Nonfinite::Drop,
            tile_points,
            run_records: tile_points.map(|n| n.saturating_mul(4).min(shares.run_records)),
            wants_normals: self.sink.wants_normals(),
            watch,
            failed: AtomicBool::new(false),
        };
        let finished = match &self.lattice {
            Some(lattice) if self.mills => {
                check_disk(&self.demands, &spill, kept_in_memory)?;
                mill(&mut job, lattice, &shares, &self.demands, &area, sink, clock)?
            }
            lattice => {
                clock.phase("convert", Some(self.source.points()));
                stream(&job, &shares, sink, lattice.as_ref())?
            }
        };
        drop(job);
        let mut run = self.figures(&finished, &budget, area.written());
        run.warnings.extend(memory_warning(spill.parent(), area.written()));
        run.warnings.iter().for_each(|warning| watch.warn(warning));
        Ok((finished, run))
    }

    /// What is known of the run when its output is written.
    fn figures(&self, finished: &Finished, budget: &Budget, spill_bytes: u64) -> RunFigures {
        let mut warnings = self.source.warnings();
        warnings.extend(finished.written.notes.iter().cloned());
        RunFigures {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            inputs: input_figures(&*self.source),
            outputs: vec![FileFigures {
                path: self.sink.path().display().to_string(),
                points: finished.written.points,
                bytes: Some(finished.written.bytes),
            }],
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
        ledger.check_written(self.sink.path(), finished.written.points)?;
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
            lattice_step: lattice.map_or(0.0, |lattice| lattice.step),
            lattice_shift: lattice.map_or([0.0; 3], |lattice| lattice.shift),
            ledger,
            decisions,
            counts: finished.tally.counts.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect(),
            tile_side,
            totals,
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
    // Records, their order, packed positions twice (runs and merged scan) and fates.
    let each = demands.stride as u64 + 8 + 2 * 8 + 4;
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
