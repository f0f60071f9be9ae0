//! Running a plan: begin, stream or mill, account, publish.
//!
//! Everything that can be refused is refused first: places for outputs are made, sinks are opened,
//! memory is divided and disks are asked before the first point is read. Nothing gets its name
//! before the ledgers balance, so a run that fails leaves what was there as it was.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Watch;
use super::account::nothing_left;
use super::by_rank::listed_bytes;
use super::by_split::{BySplit, SplitFile, SplitSink, others_of_split};
use super::clock::Clock;
use super::finished::Finished;
use super::job::Job;
use super::mill::mill;
use super::pass::StageOp;
use super::phase::RunPhase;
use super::provenance::Provenance;
use super::publish::{Staged, folder_of, make_folder, publish};
use super::room;
use super::room::Taken;
use super::row::RowLayout;
use super::scratch::{Scratch, Trouble, memory_warning};
use super::shares::{Demands, Shares};
use super::stream::stream;
use super::task::Task;
use crate::host::hashed::FileHash;
use crate::host::{Threads, lock};
use crate::point::Metadata;
use crate::report::{FileFigures, Report, RunFigures, check_written};
use crate::stage::Sink;
use crate::{Error, ErrorKind, Result};

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

impl Done {
    /// Fails with [`ErrorKind::NotAccepted`](crate::ErrorKind::NotAccepted), naming the rules that
    /// do not hold, if the result is not what the rules of the pipeline ask for. The outputs are
    /// written in any case.
    ///
    /// # Errors
    ///
    /// That, and nothing else.
    pub fn accepted(&self) -> Result<()> {
        let results = std::iter::once(&self.report.result).chain(&self.report.further);
        let rules = results.filter_map(|result| result.accept.as_ref()).flat_map(|all| &all.rules);
        let failed = rules.filter(|rule| !rule.passed).map(|rule| rule.told(self.unit));
        let failed: Vec<String> = failed.collect();
        if failed.is_empty() {
            return Ok(());
        }
        let told = format!("the result is not accepted: {}", failed.join(", "));
        Err(Error::new(ErrorKind::NotAccepted, told))
    }
}

impl std::fmt::Display for Done {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.report.table(self.report_path.as_deref()).in_unit(self.unit).fmt(f)
    }
}

impl Task {
    /// Runs the task, with its tile stages, on threads of its own; outputs appear under their names
    /// when all of it is done.
    pub fn run(&self, ops: Vec<StageOp>, watch: &dyn Watch) -> Result<Done> {
        Threads::start(self.threads, |threads| self.run_on(ops, threads, watch))
    }

    /// Runs the task on these threads.
    pub fn run_on(
        &self,
        ops: Vec<StageOp>,
        threads: Threads<'_>,
        watch: &dyn Watch,
    ) -> Result<Done> {
        let trouble = Trouble::default();
        let outcome = self.run_and_publish(ops, threads, watch, &trouble);
        // All scratch is gone by now, or will not go.
        lock(&trouble).iter().for_each(|told| watch.warn(told));
        outcome
    }

    fn run_and_publish(
        &self,
        ops: Vec<StageOp>,
        threads: Threads<'_>,
        watch: &dyn Watch,
        trouble: &Trouble,
    ) -> Result<Done> {
        let mut clock = Clock::new(watch, self.phases());
        let outputs = self.stage(trouble)?;
        let first = outputs.iter().flatten().next();
        let report_path = self.settings.report.as_deref();
        let staged_report = report_path.map(|path| self.place(first, path, trouble)).transpose()?;
        let tell = |error| outputs.iter().flatten().fold(error, |error, output| output.tell(error));
        let scratch = match (&self.settings.scratch, first.or(staged_report.as_ref())) {
            (None, Some(first)) => first.scratch().clone(),
            (None, None) => Arc::new(Scratch::below(&std::env::temp_dir(), trouble)),
            (Some(folder), _) => Arc::new(Scratch::below(folder, trouble)),
        };
        let (finished, mut run, split) =
            self.work(ops, &outputs, &scratch, threads, watch, &mut clock).map_err(tell)?;
        drop(scratch);
        let copies = first.map(|first| self.beside.iter().map(|copy| copy.make(first, trouble)));
        let beside: Vec<Staged> = copies.into_iter().flatten().collect::<Result<_>>()?;
        run.outputs.extend(beside.iter().zip(&self.beside).map(|(staged, copy)| {
            let bytes = fs::metadata(staged.file()).ok().map(|about| about.len());
            FileFigures::of(&copy.to, 0, bytes)
        }));
        clock.begin(RunPhase::Publish, None)?;
        self.check_size(&run.outputs)?;
        if staged_report.is_some() && matches!(self.provenance, Provenance::Told { .. }) {
            let written = outputs.iter().flatten().chain(&split).chain(&beside);
            hash_outputs(&mut run, written.collect(), watch)?;
        }
        let (report, tiles) = self.account(finished, run, clock)?;
        if let (Some(path), Some(staged)) = (report_path, &staged_report) {
            let sink = self.first_sink();
            let written = if self.is_split(sink) { &split[..] } else { &outputs[sink][..] };
            let places = (path, staged.file());
            let told = self.write_report(places, &report, &tiles, written);
            told.map_err(|error| staged.tell(error))?;
        }
        drop(tiles);
        // What an output refers to comes first, so that none refers to what is not there.
        let places = (0..).zip(outputs).filter(|(sink, _)| !self.is_split(*sink));
        let files = places.flat_map(|(_, staged)| staged).chain(split);
        let outputs: Vec<Staged> = beside.into_iter().chain(files).collect();
        publish(&outputs, staged_report.as_ref())?;
        let unit = self.source.metadata().units.sign();
        Ok(Done { report, report_path: self.settings.report.clone(), unit })
    }

    /// Refuses outputs that take other bytes than are wanted, and says to whoever planned the run
    /// how many these are.
    fn check_size(&self, outputs: &[FileFigures]) -> Result<()> {
        let Some(wanted) = &self.wanted else { return Ok(()) };
        let bytes = outputs.iter().filter_map(|output| output.bytes).sum();
        if wanted.bytes.contains(&bytes) {
            return Ok(());
        }
        let points = outputs.iter().map(|output| output.points).sum();
        wanted.unfit.get_or_init(|| (points, bytes));
        Err(Error::internal("outputs take other bytes than are wanted"))
    }

    /// Makes places for the files of all sinks.
    fn stage(&self, trouble: &Trouble) -> Result<Vec<Vec<Staged>>> {
        let mut outputs: Vec<Vec<Staged>> = Vec::new();
        for (n, sink) in self.sinks.iter().enumerate() {
            if sink.is_folder() {
                make_folder(sink.path())?;
            } else if sink.is_split() {
                make_folder(&folder_of(sink.path()))?;
            }
            let mut staged: Vec<Staged> = Vec::new();
            for file in self.files(n).iter().filter(|file| file.is_file()) {
                let first = staged.first().or(outputs.iter().flatten().next());
                staged.push(self.place(first, file.path(), trouble)?);
            }
            outputs.push(staged);
        }
        Ok(outputs)
    }

    /// A place for the file that is to be at `path`, beside the `first` if there is one.
    fn place(&self, first: Option<&Staged>, path: &Path, trouble: &Trouble) -> Result<Staged> {
        match first {
            Some(first) => first.also(path, trouble),
            None => Staged::beside(path, self.settings.existing, trouble),
        }
    }

    /// Opens the sinks but those of the inputs, which are created one by one, when their records
    /// are known. Those that are split set their records down.
    fn create_sinks(
        &self,
        job: &Job<'_>,
        splits: &[Option<Arc<BySplit>>],
    ) -> Result<Vec<Option<Box<dyn Sink>>>> {
        let (schema, outputs) = (self.schema(), job.outputs);
        let whole = !self.mills && self.transforms.is_empty() && !self.drops_nonfinite();
        let mut sinks: Vec<Option<Box<dyn Sink>>> = Vec::new();
        for (n, (sink, staged)) in self.sinks.iter().zip(outputs).enumerate() {
            let metadata = self.metadata(n, (!whole).then(|| self.pipeline(n)));
            if let Some(split) = &splits[n] {
                let chunk = sink.chunk(schema, &metadata)?;
                sinks.push(Some(Box::new(SplitSink::new(split.clone(), chunk))));
                continue;
            }
            let note = if sink.is_folder() { None } else { job.note(n, sink.path()) };
            let metadata = Metadata { note, ..metadata };
            let file = match sink.is_file() {
                true => staged.first().filter(|_| !sink.is_folder()).map(Staged::file),
                false => Some(Path::new("")),
            };
            let open = file.map(|file| sink.create(file, schema, &metadata, whole));
            sinks.push(open.transpose()?);
        }
        Ok(sinks)
    }

    /// Streams or mills into the outputs; what does not fit in memory is spilled to `scratch`.
    fn work(
        &self,
        ops: Vec<StageOp>,
        outputs: &[Vec<Staged>],
        scratch: &Arc<Scratch>,
        threads: Threads<'_>,
        watch: &dyn Watch,
        clock: &mut Clock<'_>,
    ) -> Result<(Finished, RunFigures, Vec<Staged>)> {
        let mut job = Job::new(self, ops, outputs, scratch, threads, watch)?;
        let splits = (0..self.sinks.len()).map(|n| self.by_split(&job, n));
        let splits: Vec<_> = splits.collect::<Result<_>>()?;
        let sinks = self.create_sinks(&job, &splits)?;
        let folder = scratch.parent();
        let doubts = self.check_room(&job, folder)?;
        self.warnings.iter().cloned().chain(doubts).for_each(|warning| job.warn(warning));
        let mut finished = match &self.lattice {
            Some(lattice) if self.mills => mill(&mut job, lattice, sinks, clock)?,
            lattice => {
                clock.begin(RunPhase::Convert, Some(self.source.points()))?;
                let sinks = sinks.into_iter().flatten().collect();
                let _working = job.budget.lease_all(&self.demands.stream(), "streaming")?;
                stream(&job, sinks, lattice.as_ref())?
            }
        };
        let files = self.write_split(&job, &splits, &mut finished, clock)?;
        if let Some(hashes) = &job.hashes {
            hashes.all()?;
        }
        let mut run = self.figures(&finished, &job);
        run.warnings.extend(nothing_left(&finished, &job));
        run.warnings.extend(self.left_beside(&finished));
        run.warnings.extend(memory_warning(folder, job.area.written()));
        run.warnings.iter().for_each(|warning| watch.warn(warning));
        run.warnings.splice(0..0, job.warned());
        Ok((finished, run, files))
    }

    /// What sorts the records of a sink by file, if it is split.
    fn by_split(&self, job: &Job<'_>, sink: usize) -> Result<Option<Arc<BySplit>>> {
        let layout = RowLayout::of(self.computed[sink].iter().map(|computed| computed.column));
        let split = self.splits[sink].as_ref();
        let split = split.map(|split| BySplit::new(job, sink, split, layout));
        Ok(split.transpose()?.map(Arc::new))
    }

    /// Writes the files of all splits; where they grew.
    fn write_split(
        &self,
        job: &Job<'_>,
        splits: &[Option<Arc<BySplit>>],
        finished: &mut Finished,
        clock: &mut Clock<'_>,
    ) -> Result<Vec<Staged>> {
        let mut staged = Vec::new();
        finished.split.resize_with(splits.len(), Vec::new);
        for (sink, split) in splits.iter().enumerate() {
            let Some(split) = split else { continue };
            clock.begin(RunPhase::Write(sink), Some(split.records()))?;
            let _working = job.budget.lease_all(&self.demands.splitting(), "split files")?;
            let (given, set_down) = (&mut finished.written[sink], split.records());
            check_written(self.sinks[sink].path(), given.iter().map(|(n, _)| n).sum(), set_down)?;
            given.clear();
            for SplitFile { path, staged: file, given: records, summary } in
                split.write(job, sink)?
            {
                given.push((records, summary));
                finished.split[sink].push(path);
                staged.push(file);
            }
        }
        Ok(staged)
    }

    /// What to say of files in the folder of a split that this run did not write, and whose names
    /// are those of the split's files all the same.
    fn left_beside(&self, finished: &Finished) -> Vec<String> {
        let of_each = self.sinks.iter().zip(&finished.split).filter(|(sink, _)| sink.is_split());
        of_each.filter_map(|(sink, written)| others_of_split(&**sink, written)).collect()
    }

    /// Refuses disks that have no room for what is spilled and, where nothing is removed, for
    /// outputs; a warning where a disk may be too small.
    fn check_room(&self, job: &Job<'_>, folder: &Path) -> Result<Vec<String>> {
        let mut all = Vec::new();
        if self.mills {
            let bytes = self.spilled(&job.shares);
            all.push(Taken { folder, spilled: true, bytes, again: 0 });
        }
        let split = self.splits.iter().flatten().count() as u64;
        if split > 0 {
            let each = (self.schema().stride as u64).saturating_mul(split);
            let bytes = self.source.points().saturating_mul(each);
            all.push(Taken { folder, spilled: true, bytes, again: 0 });
        }
        let keeps = !self.streams() && job.ops.is_empty() && !self.drops_nonfinite();
        let each = self.sinks.iter().zip(job.outputs).enumerate();
        for (n, (sink, staged)) in each.filter(|_| keeps) {
            let Some(staged) = staged.first() else { continue };
            let each = sink.disk_bytes(self.schema(), &self.metadata(n, None))?;
            let [bytes, again] = each.map(|bytes| self.source.points().saturating_mul(bytes));
            all.push(Taken { folder: staged.scratch().parent(), spilled: false, bytes, again });
        }
        room::check(all.into_iter())
    }
}

/// Enters the hashes of the files that were `written` and have no names yet.
fn hash_outputs(run: &mut RunFigures, written: Vec<&Staged>, watch: &dyn Watch) -> Result<()> {
    for staged in written {
        let name = staged.path().to_string_lossy();
        let Some(figures) = run.outputs.iter_mut().find(|output| output.path == name) else {
            continue;
        };
        let go_on = || if watch.cancelled() { Err(Error::interrupted()) } else { Ok(()) };
        let hash = FileHash::of(staged.file(), go_on).map_err(|error| staged.tell(error))?;
        figures.sha256 = Some(hash.sha256);
    }
    Ok(())
}

impl Task {
    /// Bytes that the run spills where memory is divided like this.
    pub fn spilled(&self, shares: &Shares) -> u64 {
        self.demands.stored_bytes().saturating_sub(self.kept_in_memory(shares))
    }
}

impl Demands {
    /// Bytes that a run sets down between its phases: records, their order, packed positions twice
    /// (runs and merged scan), states and fates twice (of the pass before and of the pass at work),
    /// and columns between passes. Ranks in the input, and the lists that are sorted by them.
    fn stored_bytes(&self) -> u64 {
        let order = if self.tagged { 12 } else { 8 }
            + if self.ranked { 8 + listed_bytes(self.columns.row) } else { 0 };
        let columns = self.columns.stored as u64 + if self.passes.len() > 1 { 1 + 4 } else { 0 };
        let each = self.stride as u64 + order + 2 * POSITION_BYTES + 1 + 4 + columns;
        self.points.saturating_mul(each)
    }

    /// The same without what is given back when the runs are merged.
    pub fn standing_bytes(&self) -> u64 {
        self.stored_bytes().saturating_sub(self.points.saturating_mul(POSITION_BYTES))
    }
}

/// Bytes that a packed position takes, about, where coordinates have the steps of a scan's headers.
const POSITION_BYTES: u64 = 8;
