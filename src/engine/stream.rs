//! Pipelines without tile stages stream: parts are decoded side by side, written in input order.

use std::sync::Mutex;

use super::finished::{Finished, FinishedBranch};
use super::job::Job;
use super::outlet::Outlet;
use super::shares::{BATCH, Shares};
use super::tagger::NOT_FINITE;
use crate::geom::lattice::{Lattice, Misplaced};
use crate::host::lock;
use crate::point::{PointBatch, Spare};
use crate::report::Tally;
use crate::stage::{Encoded, Sink};
use crate::{Error, Result};

/// Streams all parts of the source into each of `sinks`. With a lattice, points that have no position on it
/// are removed.
pub(crate) fn stream(
    job: &Job<'_>,
    shares: &Shares,
    sinks: Vec<Box<dyn Sink>>,
    lattice: Option<&Lattice>,
) -> Result<Finished> {
    let _working = job.budget.lease(shares.work, "streaming")?;
    let schema = job.source.schema();
    let encoders: Vec<_> = sinks.iter().map(|sink| sink.encoder()).collect();
    let empty = sinks.iter().map(|sink| PointBatch::new(schema.clone(), sink.chunk_points()));
    let spare_batches: Spare<PointBatch> = Spare::default();
    let spare_chunks: Vec<Spare<PointBatch>> = sinks.iter().map(|_| Spare::default()).collect();
    let open = Mutex::new((empty.collect::<Vec<_>>(), 0u64));
    let commit = |batch: PointBatch| -> Result<Vec<(usize, PointBatch)>> {
        let (chunks, kept) = &mut *lock(&open);
        *kept += batch.len() as u64;
        let mut full = Vec::new();
        for (sink, chunk) in chunks.iter_mut().enumerate() {
            chunked(&batch, chunk, &spare_chunks[sink], |chunk| full.push((sink, chunk)));
        }
        spare_batches.put(batch);
        Ok(full)
    };
    let encode = |(sink, chunk): (usize, PointBatch)| -> Result<(usize, Encoded)> {
        let encoder = encoders.get(sink).ok_or_else(|| Error::internal("no such sink"))?;
        let encoded = encoder.encode(&chunk)?;
        spare_chunks[sink].put(chunk);
        Ok((sink, encoded))
    };
    let outlet = Outlet::new(sinks, job.threads.count(), &commit);
    let (parts, mut tally) = (job.source.parts(), Tally::default());
    job.threads.items(parts, || outlet.stop()).run(
        || (),
        |(), index| {
            let mut part = job.source.part_without(index, &job.unread)?;
            let mut tally = Tally::default();
            for number in 0.. {
                let mut batch = spare_batches.take(|| PointBatch::new(schema.clone(), BATCH));
                let more = job.read(&mut *part, &mut batch, &mut tally)?;
                if let Some(lattice) = lattice {
                    drop_nonfinite(job, lattice, &mut batch, &mut tally)?;
                }
                job.classes.keep(&batch, &mut tally);
                outlet.deliver((index as u64, number), batch, !more, &mut |chunk| encode(chunk))?;
                if !more {
                    break;
                }
            }
            Ok(tally)
        },
        |of_part| tally.merge(&of_part),
        |()| outlet.drain(parts, &mut |chunk| encode(chunk)),
    )?;
    job.check_headers()?;
    let (rest, kept) = {
        let (chunks, kept) = &mut *lock(&open);
        let rest = std::mem::take(chunks).into_iter().enumerate();
        (rest.filter(|(_, chunk)| !chunk.is_empty()).collect(), *kept)
    };
    let written = outlet.close(rest, &mut |chunk| encode(chunk))?;
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
        written: written.into_iter().map(|summary| vec![(kept, summary)]).collect(),
        tally,
        branches: vec![branch],
    })
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
    tally.remove(&job.source_kind, NOT_FINITE, misplaced.len() as u64);
    if !misplaced.is_empty() {
        batch.retain(|i, _| misplaced.binary_search(&i).is_err());
    }
    Ok(())
}
