//! What every phase of a run shares: the task, the stages as they settled, the memory, and how it
//! is told to stop.
//!
//! Phases change none of it while their threads work, so threads share it without locks but for
//! warnings. Between phases stages settle by what is known of the scan by then; all else stays as
//! the plan made it. What belongs to one phase alone is not in it: that goes from the phase that
//! makes it to the one that needs it, and is dropped there.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use super::Watch;
use super::hashing::InputHashes;
use super::pass::{StageOp, StreamOp};
use super::publish::Staged;
use super::row::RowLayout;
use super::scratch::Scratch;
use super::shares::Shares;
use super::tagger::{ClassOf, LEFT_OUT};
use super::task::Task;
use crate::budget::{Budget, Lease};
use crate::error::shown;
use crate::geom::lattice::{Lattice, Misplaced};
use crate::graph::Headers;
use crate::host::{PhaseItems, Threads, lock};
use crate::point::{PointBatch, RunNote};
use crate::report::{Grouped, Tally};
use crate::stage::Part;
use crate::store::SpillArea;
use crate::{Error, ErrorKind, Result};

/// What every phase of a run needs.
pub(crate) struct Job<'a> {
    pub task: &'a Task,
    /// The tile stages, which settle as the scan becomes known.
    pub ops: Vec<StageOp>,
    /// For each sink, where its files grow.
    pub outputs: &'a [Vec<Staged>],
    /// Dimensions that nobody looks at.
    pub unread: Vec<String>,
    pub classes: ClassOf,
    pub shares: Shares,
    pub budget: Budget,
    /// What is set down between phases.
    pub area: Arc<SpillArea>,
    pub threads: Threads<'a>,
    pub watch: &'a dyn Watch,
    /// Those of the files that are read, if outputs or the report are to say them.
    pub hashes: Option<Arc<InputHashes>>,
    /// What the user was warned of before the end.
    warnings: Mutex<Vec<String>>,
    /// Set once a thread has failed.
    failed: AtomicBool,
    /// What stages hold of the whole scan.
    pub held: Vec<Lease>,
    _base: Vec<Lease>,
}

/// A part of the source that is being read.
pub(crate) struct OpenPart<'a> {
    part: Box<dyn Part + 'a>,
    /// The number of the record that comes next, if a stage reads such numbers.
    next: Option<u64>,
}

impl<'a> Job<'a> {
    /// The job of `task` with its tile stages, into files that grow at `outputs`; what does not fit
    /// in memory goes to `scratch`.
    ///
    /// # Errors
    ///
    /// A memory that does not do for the program and what it must hold.
    pub fn new(
        task: &'a Task,
        ops: Vec<StageOp>,
        outputs: &'a [Vec<Staged>],
        scratch: &Arc<Scratch>,
        threads: Threads<'a>,
        watch: &'a dyn Watch,
    ) -> Result<Self> {
        let shares = task.demands.divide()?;
        let budget = Budget::new(task.demands.limit);
        let base = budget.lease_all(&task.demands.base(), "program")?;
        let kept = task.kept_in_memory(&shares);
        Ok(Job {
            task,
            ops,
            outputs,
            unread: task.unread(),
            classes: ClassOf::new(task.schema()),
            shares,
            area: SpillArea::new(budget.clone(), kept, Box::new(scratch.clone())),
            budget,
            threads,
            watch,
            hashes: task.provenance.hashes(task.source.points())?,
            warnings: Mutex::default(),
            failed: AtomicBool::new(false),
            held: Vec::new(),
            _base: base,
        })
    }

    /// Opens a part of the source.
    pub fn open(&self, index: usize) -> Result<OpenPart<'_>> {
        let part = self.task.source.part_without(index, &self.unread)?;
        let is_numbered = self.task.transforms.iter().any(StreamOp::reads_record_numbers);
        let next = is_numbered.then(|| self.task.source.first_record(index)).flatten();
        Ok(OpenPart { part, next })
    }

    /// Reads the next batch of a part through the transforms; false at its end.
    pub fn read(
        &self,
        open: &mut OpenPart<'_>,
        batch: &mut PointBatch,
        tally: &mut Tally,
    ) -> Result<bool> {
        batch.clear();
        batch.relabel(self.task.source.schema());
        open.part.read(batch)?;
        let read = batch.len() as u64;
        if read == 0 {
            return Ok(false);
        }
        if let Some(next) = &mut open.next {
            batch.number_in_input(*next);
            *next += read;
        }
        tally.work("read", read);
        if let Some(hashes) = &self.hashes {
            hashes.follow(read)?;
        }
        self.classes.read(batch, tally);
        for (stage, leaves) in self.task.transforms.iter().zip(&self.task.schemas.left_by) {
            let before = batch.len();
            stage.apply(batch, tally)?;
            batch.relabel(leaves);
            tally.remove(&stage.kind, "removed", (before - batch.len()) as u64);
        }
        self.advance(read)?;
        Ok(true)
    }

    /// Warns of something now, and again in the report; once, if several branches give rise to it.
    pub fn warn(&self, message: String) {
        let mut warnings = lock(&self.warnings);
        if !warnings.contains(&message) {
            self.watch.warn(&message);
            warnings.push(message);
        }
    }

    /// What the output of a sink that is to be at `path` says of the run.
    pub fn note(&self, sink: usize, path: &Path) -> Option<Arc<RunNote>> {
        let is_several = self.task.sinks[sink].is_folder() || self.task.is_split(sink);
        let note = self.task.provenance.note(self.hashes.as_ref(), (sink, is_several), path);
        note.unwrap_or_else(|told| {
            self.warn(told);
            None
        })
    }

    /// What the user was warned of so far.
    pub fn warned(&self) -> Vec<String> {
        lock(&self.warnings).clone()
    }

    /// The rows of a sink's entries, where those of its pass are `all`: none if neither it nor a
    /// stage that streams above it looks at a column.
    pub fn layout(&self, sink: usize, all: &RowLayout) -> RowLayout {
        let reads = |filter: &usize| !self.task.filters[*filter].reads().is_empty();
        let streamed = self.task.changed_by[sink].iter().any(reads);
        let is_read = streamed || !self.task.computed[sink].is_empty();
        if is_read { all.clone() } else { RowLayout::default() }
    }

    /// True if a sink takes what the last stage of a branch leaves: classes are counted by its
    /// records.
    pub fn is_last(&self, sink: usize) -> bool {
        self.task.branches.iter().any(|branch| branch.last_sink == sink)
    }

    /// Says which transforms removed no point of all that were read.
    pub fn tell_idle(&self, tally: &Tally) {
        let removed = |kind: &str| tally.removed.keys().any(|(by, _)| by == kind);
        if tally.work.get("read").is_none_or(|&read| read == 0) {
            return;
        }
        let idle = self.task.transforms.iter().filter(|stage| !removed(&stage.kind));
        let told = idle.flat_map(|stage| stage.transform.idle(self.task.schema()));
        told.for_each(|told| self.warn(told));
    }

    /// Says what the decode left out without being asked, and which stages have nothing to do.
    pub fn tell_left_out(&self, tally: &Tally) {
        self.tell_idle(tally);
        for (reason, setting, which) in LEFT_OUT {
            let key = (self.task.source_kind.clone(), reason.into());
            if let Some(&points) = tally.removed.get(&key) {
                let points = Grouped(points);
                self.warn(format!(
                    "points {which} are left out, {points} of them; `{setting} = \"keep\"` keeps \
                     them, `{setting} = \"ignore\"` writes them as they are"
                ));
            }
        }
        if tally.work.get("placed").is_some_and(|&placed| placed > 0) {
            self.task
                .tagger
                .warnings(tally.selections)
                .into_iter()
                .for_each(|told| self.warn(told));
        }
    }

    /// Once all points are read: fails where they contradict their headers, or warns of it.
    pub fn check_headers(&self) -> Result<()> {
        let refuse = self.task.settings.headers == Headers::Refuse;
        let all = self.task.source.contradictions();
        let (wrong, odd): (Vec<_>, Vec<_>) =
            all.into_iter().partition(|told| told.is_damage && refuse);
        for told in odd {
            self.warn(format!("{}: {}", shown(&told.path), told.message));
        }
        let Some(first) = wrong.first() else { return Ok(()) };
        let (of_first, others): (Vec<_>, Vec<_>) =
            wrong.iter().partition(|told| told.path == first.path);
        let mut said: Vec<String> = of_first.iter().map(|told| told.message.clone()).collect();
        let others: BTreeSet<_> = others.iter().map(|told| &told.path).collect();
        if !others.is_empty() {
            said.push(format!("{} other inputs contradict their headers, too", others.len()));
        }
        Err(Error::data(&first.path, said.join("; ")).at_byte(first.byte).help(
            "the file is damaged: get another copy; or what wrote it did not keep its header up: \
             `run.headers = \"warn\"` reads it all the same",
        ))
    }

    /// Tells of progress, and hears whether to go on.
    pub fn advance(&self, points: u64) -> Result<()> {
        self.watch.advance(points);
        let stop = self.watch.cancelled() || self.failed.load(Ordering::Relaxed);
        if stop { Err(Error::interrupted()) } else { Ok(()) }
    }

    /// The `count` items of a phase; once one has failed, [`advance`](Job::advance) stops the
    /// others.
    pub fn items(&self, count: usize) -> PhaseItems<'_, impl Fn() + Sync> {
        self.threads.items(count, || self.failed.store(true, Ordering::Relaxed))
    }

    /// The error of a record that has no place on the lattice.
    pub fn misplaced(&self, batch: &PointBatch, index: usize, why: Misplaced) -> Error {
        let schema = batch.schema();
        let record = &batch.records()[index * schema.stride..(index + 1) * schema.stride];
        let point = schema.coordinates().map(|axes| axes.map(|d| d.world(record, schema.endian)));
        let (what, help) = match why {
            Misplaced::NotFinite => {
                let help = "`run.nonfinite = \"drop\"` leaves such points out".to_owned();
                ("is not finite", help)
            }
            Misplaced::TooFar => {
                let farthest = point
                    .unwrap_or_default()
                    .into_iter()
                    .fold(0.0, |far: f64, v| f64::max(far, v.abs()));
                let step = Lattice::reaching(farthest);
                let help = format!(
                    "`run.lattice = {step:e}` reaches it; or move the scan nearer to its origin"
                );
                ("lies beyond the lattice", help)
            }
        };
        let error = Error::new(
            ErrorKind::Data,
            format!("the point {:?} {what}", point.unwrap_or_default()),
        )
        .help(help);
        match self.task.source.inputs().get(batch.source as usize) {
            Some(input) => error.at(&input.path),
            None => error,
        }
    }
}
