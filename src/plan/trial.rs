//! A trial: the stages of a pipeline on a part of its scan, by the road of every run.
//!
//! Where stages work on tiles, the records of a stretch of the input are read, and those in a few
//! columns of space are taken, which have their neighbours. Where records stream, stretches spread
//! over the input are taken as they are, since encoders live on the order of records.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use serde::Serialize;

use super::fitted::Plan;
use super::rehearsal::{WrittenFiles, on_records, rehearsed};
use super::spots::Spots;
use crate::engine::Watch;
use crate::engine::scratch::{Scratch, Trouble};
use crate::graph::{Graph, Overrides, RunSettings, SpillSetting};
use crate::host::process::{cpu_seconds, resident_now};
use crate::host::{Threads, lock};
use crate::memory::Records;
use crate::point::{PointBatch, Schema};
use crate::stage::{Role, SinkSummary, Source};
use crate::{Error, ErrorKind, Result};

/// Records that are read to choose from, at most, and the bytes that they take.
const READ: u64 = 3_000_000;
const READ_BYTES: u64 = 96 << 20;
/// Records that the stages work on, about, and the columns or stretches that these are in.
const TRIED: usize = 240_000;
const SPOTS: usize = 8;
/// A scan of no more is tried as a whole.
const WHOLE: u64 = 300_000;
/// Records that are read at once.
const BATCH: usize = 8192;

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
    /// Wall-clock seconds that it took, reading included.
    pub seconds: f64,
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
}

/// What a trial came to, or why there was none.
pub(super) type Tried = std::result::Result<TrialRun, String>;

impl Plan {
    /// Runs the stages of `again` on some of the points, or says why not.
    pub(super) fn try_on_some(&self, again: Graph, watch: &dyn Watch) -> Result<Tried> {
        let source = &self.task.source;
        if source.is_read_once() {
            return Ok(Err("the source gives its points once, and a run needs them".to_owned()));
        }
        if source.points() == 0 {
            return Ok(Err("the inputs have no points to try".to_owned()));
        }
        match self.tried(again, watch) {
            Err(error) if error.kind() != ErrorKind::Interrupted => {
                Ok(Err(format!("a trial failed: {error}")))
            }
            tried => tried.map(Ok),
        }
    }

    fn tried(&self, again: Graph, watch: &dyn Watch) -> Result<TrialRun> {
        let (start, cpu_before) = (Instant::now(), cpu_seconds());
        // Parts are read from a source of their own: that of the plan counts what it gives.
        let source = opened(&again)?;
        let (schema, limit) = (source.schema(), READ_BYTES.min(self.task.demands.limit / 4));
        let read = Threads::start(self.task.threads, |threads| {
            let unread = &self.task.unread();
            let reading = TrialReading { source: &*source, unread, threads, watch, limit };
            reading.records(self.task.mills)
        })?;
        let reading = cpu_seconds() - cpu_before;
        let count = |bytes: usize| (bytes / schema.stride) as u64;
        let read_points = count(read.iter().map(Vec::len).sum());
        let chosen = if self.task.mills { in_spots(read, schema) } else { read.concat() };
        let points = count(chosen.len());
        let (trouble, written) = (Trouble::default(), WrittenFiles::default());
        let folder = self.task.settings.scratch.clone().unwrap_or_else(std::env::temp_dir);
        let scratch = Arc::new(Scratch::below(&folder, &trouble));
        let records = Records::new((**schema).clone(), chosen)?;
        let graph = on_records(again, records.with_metadata(source.metadata().clone()));
        let share = points as f64 / source.points().max(points).max(1) as f64;
        let mut graph = rehearsed(graph, share, &source.inputs(), &scratch, &written)?;
        self.equip(&mut graph.settings, folder)?;
        let done = graph.plan(&Overrides::default())?.run(&Unheard(watch))?;
        drop(scratch);
        lock(&trouble).iter().for_each(|told| watch.warn(told));
        let of_points = source.points();
        let seconds = start.elapsed().as_secs_f64();
        let outputs = std::mem::take(&mut *lock(&written)).into_values().collect();
        Ok(TrialRun {
            trial: Trial { read_points, points, of_points, seconds },
            reading,
            phases: done.report.run.cpu_by_phase,
            outputs,
            spilled: done.report.run.spill_bytes,
        })
    }

    /// Gives a trial the threads and the memory of the plan; it spills if the run will.
    fn equip(&self, settings: &mut RunSettings, scratch: PathBuf) -> Result<()> {
        let demands = &self.task.demands;
        let more = resident_now().unwrap_or(0).saturating_sub(demands.resident);
        settings.report = None;
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

/// Of records those in a few columns of space, or all if they are few.
fn in_spots(read: Vec<Vec<u8>>, schema: &Schema) -> Vec<u8> {
    let stride = schema.stride;
    let is_few = read.iter().map(Vec::len).sum::<usize>() as u64 <= WHOLE * stride as u64;
    let Some(axes) = schema.coordinates().filter(|_| !is_few) else { return read.concat() };
    let records = || read.iter().flat_map(|bytes| bytes.chunks_exact(stride));
    let at = |record: &[u8]| axes.map(|axis| axis.world(record, schema.endian));
    let chosen = Spots::of(records().map(at)).chosen(SPOTS, TRIED);
    let mut bytes = Vec::new();
    for (record, is_chosen) in records().zip(chosen) {
        if is_chosen {
            bytes.extend_from_slice(record);
        }
    }
    bytes
}

/// The reading of some of a source's records.
struct TrialReading<'a> {
    source: &'a dyn Source,
    unread: &'a [String],
    threads: Threads<'a>,
    watch: &'a dyn Watch,
    /// Bytes of records, at most.
    limit: u64,
}

impl TrialReading<'_> {
    /// A stretch from the middle of the input, or several that are spread over it.
    fn records(&self, in_one: bool) -> Result<Vec<Vec<u8>>> {
        let (parts, all) = (self.source.parts().max(1), self.source.points());
        let most = READ.min(self.limit / self.source.schema().stride.max(1) as u64).max(1);
        let whole = if in_one { most } else { WHOLE.min(most) };
        if all <= whole {
            return self.parts((0..self.source.parts()).collect(), most);
        }
        if !in_one {
            let mut some: Vec<usize> =
                (0..SPOTS).map(|n| parts * (2 * n + 1) / (2 * SPOTS)).collect();
            some.dedup();
            let each = most.min(TRIED as u64) / some.len() as u64;
            return self.parts(some, each);
        }
        let each = all.div_ceil(parts as u64).max(1);
        let count = usize::try_from(most / each).unwrap_or(parts).clamp(1, parts);
        let first = (parts - count) / 2;
        self.parts((first..first + count).collect(), most)
    }

    /// The records of these parts, so many of each at most.
    fn parts(&self, parts: Vec<usize>, most: u64) -> Result<Vec<Vec<u8>>> {
        let (schema, read) = (self.source.schema(), Mutex::new(BTreeMap::new()));
        let most = most.saturating_mul(schema.stride as u64);
        self.threads.items(parts.len(), || {}).run(
            || PointBatch::new(schema.clone(), BATCH),
            |batch, item| {
                let mut part = self.source.part_without(parts[item], self.unread)?;
                let mut bytes = Vec::new();
                while (bytes.len() as u64) < most {
                    if self.watch.cancelled() {
                        return Err(Error::interrupted());
                    }
                    part.read(batch)?;
                    if batch.is_empty() {
                        break;
                    }
                    bytes.extend_from_slice(batch.records());
                }
                lock(&read).insert(item, bytes);
                Ok(())
            },
            |()| {},
            |_| Ok(()),
        )?;
        Ok(std::mem::take(&mut *lock(&read)).into_values().collect())
    }
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
