//! What every phase of a run shares: the source, the stages, the budget, and how it is told to stop.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use super::Watch;
use super::each::Each;
use super::passes::{Pass, StageOp};
use super::tagger::{ClassOf, Tagger};
use crate::budget::Budget;
use crate::geom::lattice::Misplaced;
use crate::geom::simd::Simd;
use crate::point::PointBatch;
use crate::report::Tally;
use crate::stage::{Part, Source, Transform};
use crate::tile::{lock, parallel};
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
    pub simd: Simd,
    pub drop_nonfinite: bool,
    pub tile_points: Option<usize>,
    /// For each sink, whether it writes normals.
    pub wants_normals: Vec<bool>,
    /// For each sink, whether it wants the order of the inputs.
    pub in_input_order: Vec<bool>,
    /// For each sink, whether the records of a chunk are ordered by time.
    pub by_time: Vec<bool>,
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
