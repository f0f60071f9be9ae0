//! All records of a source, once, by several threads and without a run: for commands that look at
//! a scan and make nothing of it.

use std::fmt;
use std::sync::{Mutex, PoisonError};

use super::source::{BATCH, Source};
use crate::budget::{Bytes, whole_mebibytes};
use crate::host::process::{default_memory, processors};
use crate::host::{Threads, lock};
use crate::point::PointBatch;
use crate::{Error, Result};

/// Bytes of the process besides what threads hold: the program, headers, tables of chunks.
const BESIDE: u64 = 64 << 20;

/// Told how far a walk is; called from several threads.
pub trait WalkProgress: Sync {
    /// A walk begins over so many points, as far as headers tell.
    fn begin(&self, points: u64);

    /// So many more points were looked at.
    fn advance(&self, points: u64);
}

/// How many threads look at a scan, in how much memory, and who is told how far they are.
#[derive(Clone, Copy)]
pub struct PointWalk<'a> {
    /// Threads that work at once.
    pub threads: usize,
    /// Bytes of memory that the process may take.
    pub memory: u64,
    /// Who is told, if anybody.
    pub progress: Option<&'a dyn WalkProgress>,
}

impl Default for PointWalk<'_> {
    fn default() -> Self {
        PointWalk { threads: processors(), memory: default_memory(), progress: None }
    }
}

impl fmt::Debug for PointWalk<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PointWalk { threads, memory, .. } = self;
        f.debug_struct("PointWalk").field("threads", threads).field("memory", memory).finish()
    }
}

impl PointWalk<'_> {
    /// With what is given, and the defaults for the rest.
    pub(crate) fn with(threads: Option<usize>, memory: Option<u64>) -> Self {
        let usual = PointWalk::default();
        PointWalk {
            threads: threads.unwrap_or(usual.threads),
            memory: memory.unwrap_or(usual.memory),
            ..usual
        }
    }

    /// As many threads as have room, each of which holds `own` bytes besides what it reads.
    fn room(&self, source: &dyn Source, own: u64) -> Result<usize> {
        let batch = Bytes::of(BATCH as u64, source.schema().stride);
        let each = batch + Bytes(source.part_bytes()) + Bytes(own);
        let room = (self.memory.saturating_sub(BESIDE)) / each.0.max(1);
        if room == 0 {
            let enough = whole_mebibytes((each + Bytes(BESIDE)).0);
            let told = "the memory does not do for one thread that reads the points";
            let help = format!("give `run.memory = \"{enough}\"` or more");
            return Err(Error::memory(told).help(help));
        }
        Ok(self.threads.clamp(1, usize::try_from(room).unwrap_or(usize::MAX)))
    }

    /// Hands all records of `source` to `visit`, in batches, of which nobody looks at the
    /// dimensions `unread`: with what the thread gathers, the number of the part and how many of
    /// its records came before. Each thread begins with what `begin` gives, of `own` bytes at most;
    /// what all have in the end is returned, in no order. Where a part cannot be read to its end,
    /// `failed` decides if the walk ends.
    ///
    /// # Errors
    ///
    /// Those of `failed`, and a memory in which no thread has room.
    pub fn each_batch<S: Send>(
        &self,
        source: &dyn Source,
        unread: &[String],
        own: u64,
        begin: impl Fn() -> S + Sync,
        visit: impl Fn(&mut S, usize, u64, &PointBatch) + Sync,
        failed: impl Fn(&mut S, usize, Error) -> Result<()> + Sync,
    ) -> Result<Vec<S>> {
        let threads = self.room(source, own)?;
        self.progress.iter().for_each(|told| told.begin(source.points()));
        let arena = || (begin(), PointBatch::new(source.schema().clone(), BATCH));
        let part = |(state, batch): &mut (S, PointBatch), index| {
            let mut read = |state: &mut S| -> Result<()> {
                let mut part = source.part_without(index, unread)?;
                let mut before = 0;
                loop {
                    batch.clear();
                    part.read(batch)?;
                    if batch.is_empty() {
                        return Ok(());
                    }
                    visit(state, index, before, batch);
                    before += batch.len() as u64;
                    self.progress.iter().for_each(|told| told.advance(batch.len() as u64));
                }
            };
            read(state).or_else(|error| failed(state, index, error))
        };
        let states = Mutex::new(Vec::new());
        let end = |(state, _): (S, _)| {
            lock(&states).push(state);
            Ok(())
        };
        Threads::start(threads, |threads| {
            threads.items(source.parts(), || {}).run(arena, part, |()| {}, end)
        })?;
        Ok(states.into_inner().unwrap_or_else(PoisonError::into_inner))
    }
}
