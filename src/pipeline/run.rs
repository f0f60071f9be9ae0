//! Running a plan: begin, stream or mill, account, publish.

use std::fs::{self, File};
use std::io::{BufWriter, Cursor, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Watch;
use super::clock::Clock;
use super::mill::mill;
use super::plan::Plan;
use super::scratch::{Scratch, free_space};
use super::settings::{Nonfinite, Spill};
use super::shares::Shares;
use super::stream::stream;
use super::survey::Measured;
use crate::budget::{Budget, Bytes};
use crate::geom::lattice::Misplaced;
use crate::point::PointBatch;
use crate::report::{
    Decision, FileFigures, Ledger, Machine, Outcome, Report, RunFigures, Tally, peak_memory,
};
use crate::stage::{Input, Part, SinkSummary, Source, TileOp, Transform};
use crate::tile::SpillArea;
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
        if self.watch.cancelled() { Err(Error::interrupted()) } else { Ok(()) }
    }

    /// Positions that a tile's arena takes.
    pub fn tile_capacity(&self, shares: &Shares) -> usize {
        shares.tile_positions
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
        let path = self.sink.path().to_owned();
        let staging = Arc::new(Scratch::below(&existing_folder(&path)?));
        let staged = staging.path("output")?;
        let sink = self.sink.create(&staged, self.source.schema(), self.source.metadata())?;
        self.demands.chunk = (sink.chunk_points(), sink.chunk_bytes());
        let mut warnings = self.source.warnings();
        let shares = self.demands.divide()?;
        let budget = Budget::new(self.demands.limit);
        let _base = budget.lease(shares.base, "the program")?;
        let spill = match &self.settings.scratch {
            Some(folder) => Arc::new(Scratch::below(folder)),
            None => staging.clone(),
        };
        let kept_in_memory = match self.settings.spill {
            Spill::Auto => shares.kept_in_memory,
            Spill::Always => 0,
        };
        let area = SpillArea::new(budget.clone(), kept_in_memory, Box::new(spill.clone()));
        let mut job = Job {
            source: &*self.source,
            source_kind: self.source_kind.clone(),
            transforms: std::mem::take(&mut self.transforms),
            ops: std::mem::take(&mut self.ops),
            budget: budget.clone(),
            threads: self.threads,
            drop_nonfinite: self.settings.nonfinite == Nonfinite::Drop,
            tile_points: self.settings.tile_points.map(usize::from),
            run_records: self
                .settings
                .tile_points
                .map(|n| n.get().saturating_mul(4).min(shares.run_records)),
            wants_normals: self.sink.wants_normals(),
            watch,
        };
        let finished = match &self.lattice {
            Some(lattice) if self.mills => {
                check_disk(&self, &spill, kept_in_memory)?;
                mill(&mut job, lattice, &shares, &self.demands, &area, sink, &mut clock)?
            }
            lattice => {
                clock.phase("convert", Some(self.source.points()));
                stream(&job, sink, lattice.as_ref())?
            }
        };
        drop(job);
        warnings.extend(finished.written.notes.iter().cloned());
        warnings.iter().for_each(|warning| watch.warn(warning));
        let run = RunFigures {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            inputs: input_figures(&*self.source),
            outputs: vec![FileFigures {
                path: path.display().to_string(),
                points: finished.written.points,
                bytes: Some(finished.written.bytes),
            }],
            machine: Machine::this(),
            threads: self.threads,
            memory_bytes: self.demands.limit,
            spill_bytes: area.written(),
            warnings,
            ..RunFigures::default()
        };
        drop(area);
        let (report, tiles) = self.account(finished, run, clock, &budget)?;
        self.publish(&staged, &path, &report, &tiles)?;
        Ok(Done { report, report_path: self.settings.report })
    }

    /// The report of a finished run, once its ledger balances, and the lines of its tiles.
    fn account(
        &self,
        finished: Finished,
        mut run: RunFigures,
        clock: Clock<'_>,
        budget: &Budget,
    ) -> Result<(Report, Vec<u8>)> {
        let ledger = Ledger::new(finished.read, finished.kept, &finished.tally);
        ledger.check()?;
        ledger.check_written(self.sink.path(), finished.written.points)?;
        (run.seconds, run.cpu_seconds, run.phases) = clock.finish();
        run.leased_bytes = budget.peak();
        run.peak_memory_bytes = peak_memory();
        run.work = finished.tally.work.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect();
        let (tile_side, totals, tiles) = match finished.measured {
            Some(measured) => (Some(measured.tile_side), Some(measured.totals), measured.tiles),
            None => (None, None, Vec::new()),
        };
        let lattice = self.lattice.as_ref();
        let result = Outcome {
            pipeline: self.stages.clone(),
            lattice_step: lattice.map_or(0.0, |lattice| lattice.step),
            lattice_shift: lattice.map_or([0.0; 3], |lattice| lattice.shift),
            ledger,
            decisions: finished.decisions,
            counts: finished.tally.counts.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect(),
            tile_side,
            totals,
        };
        Ok((Report { result, run }, tiles))
    }

    /// Gives the output its name, and writes the report where one is wanted.
    fn publish(&self, staged: &Path, path: &Path, report: &Report, tiles: &[u8]) -> Result<()> {
        let staged_report = match &self.settings.report {
            Some(to) => Some((to, stage_report(to, report, tiles)?)),
            None => None,
        };
        fs::rename(staged, path).map_err(|e| Error::io(path, "put the output in place", e))?;
        if let Some((to, (_scratch, from))) = staged_report {
            fs::rename(from, to).map_err(|e| Error::io(to, "put the report in place", e))?;
        }
        Ok(())
    }
}

fn stage_report(to: &Path, report: &Report, tiles: &[u8]) -> Result<(Scratch, PathBuf)> {
    let scratch = Scratch::below(&existing_folder(to)?);
    let staged = scratch.path("report")?;
    let write = || {
        let mut out = BufWriter::new(File::create(&staged)?);
        report.write(&mut out, &mut Cursor::new(tiles))?;
        out.into_inner().map_err(std::io::IntoInnerError::into_error)?.flush()
    };
    write().map_err(|e| Error::io(to, "write the report", e))?;
    Ok((scratch, staged))
}

/// The folder that `path` is to appear in, which must be there.
fn existing_folder(path: &Path) -> Result<PathBuf> {
    let folder = Scratch::parent_of(path);
    if path.is_dir() {
        return Err(Error::pipeline("this is a folder, not a file to write").at(path));
    }
    if folder.is_dir() {
        return Ok(folder);
    }
    Err(Error::new(ErrorKind::Io, "the folder of the output does not exist")
        .at(folder)
        .help("create it first"))
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
fn check_disk(plan: &Plan, spill: &Scratch, kept_in_memory: u64) -> Result<()> {
    // Records, their order, packed positions twice (runs and merged scan) and fates.
    let each = plan.demands.stride as u64 + 8 + 2 * 8 + 4;
    let needed = (plan.demands.points * each).saturating_sub(kept_in_memory);
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
