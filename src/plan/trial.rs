//! A trial: the stages of a pipeline on a part of its scan, by the road of every run.
//!
//! Which part that is, `trial_reading.rs` decides.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::fitted::Plan;
use super::rehearsal::{WrittenFiles, on_records, rehearsed};
use super::trial_reading::{TrialReading, TrialRecords, TrialSize};
use crate::engine::Watch;
use crate::engine::scratch::{Scratch, Trouble};
use crate::graph::{Graph, Overrides, RunSettings, SpillSetting};
use crate::host::process::{cpu_seconds, resident_now};
use crate::host::{Threads, lock};
use crate::memory::Records;
use crate::report::Outcome;
use crate::stage::{Role, SinkSummary, Source};
use crate::{Error, ErrorKind, Result};

/// Bytes of records that are held, at most.
const HELD_BYTES: u64 = 96 << 20;
/// Where a run is foretold.
const FORETOLD: TrialSize = TrialSize::of(240_000, 8);

/// A run of the same stages on a part of the scan.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Trial {
    /// Records that were read to choose from.
    pub read_points: u64,
    /// Records that the stages worked on.
    pub points: u64,
    /// Records of the scan by its headers.
    pub of_points: u64,
    /// Of the points that lie where those do, about the part that was read: less than 1 where they
    /// are in so many parts of the input that not all were read.
    pub density: f64,
    /// Wall-clock seconds that it took, reading included.
    pub seconds: f64,
}

/// A trial that saw a smaller part of the points where it looked tells little.
const WHOLE_ENOUGH: f64 = 0.75;

impl Trial {
    /// True if it tells little, as it saw too small a part of the points where it looked.
    pub(crate) fn is_thin(&self) -> bool {
        self.density < WHOLE_ENOUGH
    }
}

/// What a trial came to.
pub(super) struct TrialRun {
    /// How it went.
    pub trial: Trial,
    /// CPU seconds of the reading.
    pub reading: f64,
    /// CPU seconds by phase.
    pub phases: Vec<(&'static str, f64)>,
    /// What each sink got.
    pub outputs: Vec<SinkSummary>,
    /// Bytes of scratch files.
    pub spilled: u64,
    /// What became of the points.
    pub outcome: Outcome,
    /// Of the points in their places, the part that they are.
    pub density: f64,
}

/// Some of the points of a scan, on which pipelines are tried: those that
/// [`Plan::trial_points`] took.
pub struct TrialPoints {
    source: Box<dyn Source>,
    records: Records,
    /// What was read, and how long that took.
    trial: Trial,
    /// CPU seconds of the reading.
    reading: f64,
}

impl TrialPoints {
    /// Of the points in their places, the part that they are.
    pub(super) fn density(&self) -> f64 {
        if self.trial.density > 0.0 { self.trial.density } else { 1.0 }
    }
}

/// What a trial came to, or why there was none.
pub(super) type Tried = std::result::Result<TrialRun, String>;

impl Plan {
    /// Runs the stages of `again` on some of the points, or says why not.
    pub(super) fn try_on_some(&self, again: Graph, watch: &dyn Watch) -> Result<Tried> {
        if let Some(why) = self.no_trial() {
            return Ok(Err(why));
        }
        let points = self.read_some(&again, FORETOLD, watch);
        match points.and_then(|points| self.tried(&points, again, watch)) {
            Err(error) if error.kind() != ErrorKind::Interrupted => {
                Ok(Err(format!("a trial failed: {error}")))
            }
            tried => tried.map(Ok),
        }
    }

    /// Why there can be no trial, if so.
    pub(super) fn no_trial(&self) -> Option<String> {
        let source = &self.task.source;
        let why = match (source.is_read_once(), source.points()) {
            (true, _) => "the source gives its points once, and a run needs them",
            (false, 0) => "the inputs have no points to try",
            _ => return None,
        };
        Some(why.to_owned())
    }

    /// Reads the points that trials work on from the sources of `again`.
    pub(super) fn read_some(
        &self,
        again: &Graph,
        size: TrialSize,
        watch: &dyn Watch,
    ) -> Result<TrialPoints> {
        let (start, cpu_before) = (Instant::now(), cpu_seconds());
        // Parts are read from a source of their own: that of the plan counts what it gives.
        let source = opened(again)?;
        let (schema, limit) = (source.schema(), HELD_BYTES.min(self.task.demands.limit / 4));
        let unread = &self.task.unread();
        let read = Threads::start(self.task.threads, |threads| {
            let from = TrialReading { source: &*source, unread, threads, watch, limit, size };
            from.records(self.task.mills)
        })?;
        let reading = cpu_seconds() - cpu_before;
        let TrialRecords { read: read_points, chosen, density } = read;
        let points = (chosen.len() / schema.stride) as u64;
        let records = Records::new((**schema).clone(), chosen)?;
        let records = records.with_metadata(source.metadata().clone());
        let (of_points, seconds) = (source.points(), start.elapsed().as_secs_f64());
        let trial = Trial { read_points, points, of_points, density, seconds };
        Ok(TrialPoints { source, records, trial, reading })
    }

    /// Runs the stages of `again` on these points.
    pub(super) fn tried(
        &self,
        points: &TrialPoints,
        again: Graph,
        watch: &dyn Watch,
    ) -> Result<TrialRun> {
        self.tried_as(points, 1.0, again, watch)
    }

    /// The same, where the tried points stand for so many times as few of the scan as they are: if
    /// not all of their places was read, for those that are there.
    pub(super) fn tried_as(
        &self,
        points: &TrialPoints,
        density: f64,
        again: Graph,
        watch: &dyn Watch,
    ) -> Result<TrialRun> {
        let start = Instant::now();
        let TrialPoints { source, records, trial, reading } = points;
        let (trouble, written) = (Trouble::default(), WrittenFiles::default());
        let folder = self.task.settings.scratch.clone().unwrap_or_else(std::env::temp_dir);
        let scratch = Arc::new(Scratch::below(&folder, &trouble));
        let graph = on_records(again, records.clone());
        let of_all = trial.points as f64 / source.points().max(trial.points).max(1) as f64;
        let share = (of_all / density).min(1.0);
        let mut graph = rehearsed(graph, share, &**source, &scratch, &written)?;
        self.equip(&mut graph.settings, folder)?;
        let done = graph.plan(&Overrides::default())?.run(&Unheard(watch))?;
        drop(scratch);
        lock(&trouble).iter().for_each(|told| watch.warn(told));
        let seconds = trial.seconds + start.elapsed().as_secs_f64();
        let outputs = std::mem::take(&mut *lock(&written)).into_values().collect();
        Ok(TrialRun {
            trial: Trial { seconds, ..trial.clone() },
            reading: *reading,
            phases: done.report.run.cpu_by_phase,
            outputs,
            spilled: done.report.run.spill_bytes,
            density,
            outcome: done.report.result,
        })
    }

    /// Gives a trial the threads and the memory of the plan; it spills if the run will.
    fn equip(&self, settings: &mut RunSettings, scratch: PathBuf) -> Result<()> {
        let demands = &self.task.demands;
        let more = resident_now().unwrap_or(0).saturating_sub(demands.resident);
        settings.report = None;
        settings.provenance = Some(false);
        settings.scratch = Some(scratch);
        settings.threads = NonZeroUsize::new(self.task.threads);
        settings.memory = Some(demands.limit.saturating_add(more));
        if self.task.mills && self.task.spilled(&demands.divide()?) > 0 {
            settings.spill = SpillSetting::Always;
        }
        Ok(())
    }
}

/// The sources of a graph as one, open.
fn opened(graph: &Graph) -> Result<Box<dyn Source>> {
    let mut sources = graph.stages.iter().filter_map(|stage| match &stage.role {
        Role::Source(source) => Some(source),
        _ => None,
    });
    let first = sources.next().ok_or_else(|| Error::internal("a plan without a source"))?;
    let Some(second) = sources.next() else { return first.open() };
    let merged = first.merged(&**second)?;
    sources.try_fold(merged, |merged, next| merged.merged(&**next))?.open()
}

/// Lets a trial be stopped, and tells nobody of it.
struct Unheard<'a>(&'a dyn Watch);

impl Watch for Unheard<'_> {
    fn phase(&self, _: &'static str, _: Option<u64>) {}

    fn advance(&self, _: u64) {}

    fn warn(&self, _: &str) {}

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}
