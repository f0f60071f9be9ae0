//! Pipelines without tile stages: parts are decoded side by side and written in input order.
//!
//! No stage looks at neighbours, so nothing is sorted and nothing is stored: a part of the input is
//! an item, read batch by batch, and the outlet brings the batches of all threads into order. The
//! mill would do the same work with the same outputs, and sort in vain.

use std::sync::{Arc, Mutex};

use super::finished::{Finished, FinishedBranch};
use super::job::Job;
use super::outlet::{Outlet, finished};
use super::tagger::NOT_FINITE;
use crate::geom::lattice::{Lattice, Misplaced};
use crate::host::lock;
use crate::point::{PointBatch, Schema, Spare};
use crate::report::Tally;
use crate::stage::{BATCH, Encode, Encoded, Sink};
use crate::{Error, Result};

/// Streams all parts of the source into each of `sinks`. With a lattice, points that have no
/// position on it are removed.
pub(crate) fn stream(
    job: &Job<'_>,
    sinks: Vec<Box<dyn Sink>>,
    lattice: Option<&Lattice>,
) -> Result<Finished> {
    let chunks = SinkChunks::new(job.task.schema(), &sinks);
    let (commit, encode) = (|batch| Ok(chunks.commit(batch)), |chunk| chunks.encode(chunk));
    let outlet = Outlet::new(sinks, job.threads.count(), &commit);
    let (parts, mut tally) = (job.task.source.parts(), Tally::default());
    job.threads.items(parts, || outlet.stop()).run(
        || (),
        |(), index| stream_part(job, lattice, index, &chunks, &outlet),
        |of_part| tally.merge(&of_part),
        |()| outlet.drain(parts, &mut |chunk| encode(chunk)),
    )?;
    job.check_headers()?;
    let (rest, kept) = chunks.rest();
    let written = finished(outlet.close(rest, &mut |chunk| encode(chunk))?)?;
    job.tell_idle(&tally);
    let read = tally.work.remove("read").unwrap_or(0);
    let branch = FinishedBranch {
        kept,
        classes: tally.classes.take().map_or(Vec::new(), |classes| classes.figures()),
        tally: tally.clone(),
        decisions: Vec::new(),
        passes: Vec::new(),
        measured: None,
    };
    Ok(Finished {
        read,
        split: Vec::new(),
        written: written.into_iter().map(|summary| vec![(kept, summary)]).collect(),
        tally,
        branches: vec![branch],
    })
}

/// Delivers a part batch by batch; what is counted of it.
fn stream_part(
    job: &Job<'_>,
    lattice: Option<&Lattice>,
    index: usize,
    chunks: &SinkChunks,
    outlet: &Outlet<'_, PointBatch, SinkChunk>,
) -> Result<Tally> {
    let mut part = job.open(index)?;
    let (schema, mut tally) = (job.task.source.schema(), Tally::default());
    for number in 0.. {
        let mut batch = chunks.spare_batches.take(|| PointBatch::new(schema.clone(), BATCH));
        let more = job.read(&mut part, &mut batch, &mut tally)?;
        if let Some(lattice) = lattice {
            drop_nonfinite(job, lattice, &mut batch, &mut tally)?;
        }
        job.classes.keep(&batch, &mut tally);
        let place = (index as u64, number);
        outlet.deliver(place, batch, !more, &mut |chunk| chunks.encode(chunk))?;
        if !more {
            break;
        }
    }
    Ok(tally)
}

/// A chunk and the number of its sink.
type SinkChunk = (usize, PointBatch);

/// The chunks of all sinks, which all threads fill. Batches and chunks are used again.
struct SinkChunks {
    encoders: Vec<Arc<dyn Encode>>,
    spare_batches: Spare<PointBatch>,
    spare_chunks: Vec<Spare<PointBatch>>,
    /// For each sink the chunk that is not full, and how many records were committed.
    open: Mutex<(Vec<PointBatch>, u64)>,
}

impl SinkChunks {
    fn new(schema: &Arc<Schema>, sinks: &[Box<dyn Sink>]) -> Self {
        let empty = sinks.iter().map(|sink| PointBatch::new(schema.clone(), sink.chunk_points()));
        SinkChunks {
            encoders: sinks.iter().map(|sink| sink.encoder()).collect(),
            spare_batches: Spare::default(),
            spare_chunks: sinks.iter().map(|_| Spare::default()).collect(),
            open: Mutex::new((empty.collect(), 0)),
        }
    }

    /// The chunks that a batch completes.
    fn commit(&self, batch: PointBatch) -> Vec<SinkChunk> {
        let (chunks, kept) = &mut *lock(&self.open);
        *kept += batch.len() as u64;
        let mut full = Vec::new();
        for (sink, chunk) in chunks.iter_mut().enumerate() {
            chunked(&batch, chunk, &self.spare_chunks[sink], |chunk| full.push((sink, chunk)));
        }
        self.spare_batches.put(batch);
        full
    }

    fn encode(&self, (sink, chunk): SinkChunk) -> Result<(usize, Encoded)> {
        let encoder = self.encoders.get(sink).ok_or_else(|| Error::internal("no such sink"))?;
        let encoded = encoder.encode(&chunk)?;
        self.spare_chunks[sink].put(chunk);
        Ok((sink, encoded))
    }

    /// The chunks that are not full, and how many records there were in all.
    fn rest(&self) -> (Vec<SinkChunk>, u64) {
        let (chunks, kept) = &mut *lock(&self.open);
        let rest = std::mem::take(chunks).into_iter().enumerate();
        (rest.filter(|(_, chunk)| !chunk.is_empty()).collect(), *kept)
    }
}

/// Fills `chunk` from `batch` and calls `full` with the chunks that this completed.
fn chunked(
    batch: &PointBatch,
    chunk: &mut PointBatch,
    spare: &Spare<PointBatch>,
    mut full: impl FnMut(PointBatch),
) {
    let stride = batch.schema().stride;
    let mut records = batch.records();
    while !records.is_empty() {
        let room = (chunk.capacity() - chunk.len()) * stride;
        let (now, later) = records.split_at(room.min(records.len()));
        chunk.extend(now);
        records = later;
        if chunk.len() == chunk.capacity() {
            let capacity = chunk.capacity();
            let mut empty = spare.take(|| PointBatch::new(batch.schema().clone(), capacity));
            empty.clear();
            full(std::mem::replace(chunk, empty));
        }
    }
}

fn drop_nonfinite(
    job: &Job<'_>,
    lattice: &Lattice,
    batch: &mut PointBatch,
    tally: &mut Tally,
) -> Result<()> {
    let mut misplaced = Vec::new();
    lattice.place(
        batch.schema(),
        batch.records(),
        |_, _| {},
        |i, why| {
            if why == Misplaced::NotFinite {
                misplaced.push(i);
            }
        },
    );
    tally.remove(&job.task.source_kind, NOT_FINITE, misplaced.len() as u64);
    if !misplaced.is_empty() {
        batch.retain(|i, _| misplaced.binary_search(&i).is_err());
    }
    Ok(())
}
