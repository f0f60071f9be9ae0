//! Pipelines without tile stages stream: parts are decoded side by side, written in input order.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::outlet::{Hands, Outlet};
use super::run::{Finished, Job, StopOnDrop};
use super::shares::{BATCH, Shares};
use crate::Result;
use crate::geom::lattice::{Lattice, Misplaced};
use crate::point::PointBatch;
use crate::report::Tally;
use crate::stage::{Encoded, Sink};
use crate::tile::{lock, parallel};

/// Streams all parts of the source into `sink`. With a lattice, points that have no position on it
/// are removed.
pub(super) fn stream(
    job: &Job<'_>,
    shares: &Shares,
    sink: Box<dyn Sink>,
    lattice: Option<&Lattice>,
) -> Result<Finished> {
    let _working = job.budget.lease(shares.work, "streaming")?;
    let (encoder, chunk_points) = (sink.encoder(), sink.chunk_points());
    let outlet: Outlet<PointBatch, PointBatch> = Outlet::new(sink, job.threads);
    let schema = job.source.schema();
    let open = Mutex::new((PointBatch::new(schema.clone(), chunk_points), 0u64));
    let commit = |batch: PointBatch| -> Result<Vec<PointBatch>> {
        let (chunk, kept) = &mut *lock(&open);
        *kept += batch.len() as u64;
        Ok(chunked(&batch, chunk))
    };
    let total = Mutex::new(Tally::default());
    let next = AtomicUsize::new(0);
    let parts = job.source.parts();
    parallel(job.threads, |_| {
        let guard = StopOnDrop::new(|| outlet.stop());
        let mut encode = |chunk: PointBatch| -> Result<Encoded> { encoder.encode(&chunk) };
        let mut hands = Hands { commit: &commit, encode: &mut encode };
        let mut tally = Tally::default();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= parts {
                break;
            }
            let mut part = job.source.part(index)?;
            for number in 0.. {
                let mut batch = PointBatch::new(schema.clone(), BATCH);
                let more = job.read(&mut *part, &mut batch, &mut tally)?;
                if let Some(lattice) = lattice {
                    drop_nonfinite(job, lattice, &mut batch, &mut tally)?;
                }
                outlet.deliver((index as u64, number), batch, !more, &mut hands)?;
                if !more {
                    break;
                }
            }
        }
        outlet.drain(&mut hands, |turn| turn.0 >= parts as u64)?;
        lock(&total).merge(&tally);
        guard.disarm();
        Ok(())
    })?;
    let (rest, kept) = {
        let (chunk, kept) = &mut *lock(&open);
        let rest = std::mem::replace(chunk, PointBatch::new(schema.clone(), 0));
        (if rest.is_empty() { Vec::new() } else { vec![rest] }, *kept)
    };
    let mut encode = |chunk: PointBatch| -> Result<Encoded> { encoder.encode(&chunk) };
    let written = outlet.close(rest, &mut Hands { commit: &commit, encode: &mut encode })?;
    let mut tally = std::mem::take(&mut *lock(&total));
    Ok(Finished {
        read: tally.work.remove("read").unwrap_or(0),
        kept,
        written,
        tally,
        decisions: Vec::new(),
        measured: None,
    })
}

/// Fills `chunk` from `batch` and returns the chunks that this completed.
fn chunked(batch: &PointBatch, chunk: &mut PointBatch) -> Vec<PointBatch> {
    let stride = batch.schema().stride;
    let mut records = batch.records();
    let mut full = Vec::new();
    while !records.is_empty() {
        let room = (chunk.capacity() - chunk.len()) * stride;
        let (now, later) = records.split_at(room.min(records.len()));
        chunk.extend(now);
        records = later;
        if chunk.len() == chunk.capacity() {
            let empty = PointBatch::new(batch.schema().clone(), chunk.capacity());
            full.push(std::mem::replace(chunk, empty));
        }
    }
    full
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
    tally.remove(&job.source_kind, "not finite", misplaced.len() as u64);
    if !misplaced.is_empty() {
        batch.retain(|i, _| misplaced.binary_search(&i).is_err());
    }
    Ok(())
}
