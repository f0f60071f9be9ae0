//! The decode: all parts of the source, read side by side, placed on the lattice and handed to the
//! tile store.
//!
//! A part is an item. Records become positions of the lattice as they are decoded, so that
//! everything behind it decides on integers; and every record is decoded once, however many stages
//! and passes follow. A thread's intake goes on filling from one part to the next, however short
//! parts are, since the merge takes longer the more sorted runs there are. Where a run ends decides
//! nothing: the merge orders records of one position by their bytes.

use super::by_rank::{Starts, place};
use super::job::Job;
use super::placed::Placed;
use super::tagger::NOT_FINITE;
use super::task::Task;
use crate::Result;
use crate::geom::lattice::{Lattice, Misplaced};
use crate::point::PointBatch;
use crate::report::Tally;
use crate::stage::BATCH;
use crate::store::{Intake, TileStore};

pub(crate) fn decode(job: &Job<'_>, lattice: &Lattice) -> Result<(TileStore, Starts, Tally)> {
    let Task { source, tagger, in_input_order, .. } = job.task;
    let mut store = TileStore::new(&job.area, &job.budget, job.task.schema().stride, tagger.tags());
    let ranked = in_input_order.contains(&true);
    if ranked {
        store = store.with_places();
    }
    let (mut records, mut total) = (Vec::new(), Tally::default());
    job.items(source.parts()).run(
        || Arena {
            intake: Intake::new(&store, job.shares.run_records),
            batch: PointBatch::new(source.schema().clone(), BATCH),
            placed: Placed::default(),
        },
        |arena, index| decode_part(job, lattice, index, arena),
        |(read, tally)| {
            total.merge(&tally);
            records.extend(ranked.then_some(read));
        },
        |mut arena| arena.intake.flush(),
    )?;
    Ok((store, Starts::of(&records), total))
}

/// What a thread works with: a run that fills, and a batch of a part.
struct Arena<'a> {
    intake: Intake<'a>,
    batch: PointBatch,
    placed: Placed,
}

/// Hands the records of a part to the intake; how many there were, and what is counted of them.
fn decode_part(
    job: &Job<'_>,
    lattice: &Lattice,
    index: usize,
    arena: &mut Arena<'_>,
) -> Result<(u64, Tally)> {
    let Arena { intake, batch, placed } = arena;
    let mut part = job.open(index)?;
    let (mut read, mut tally) = (0, Tally::default());
    while job.read(&mut part, batch, &mut tally)? {
        placed.first = place(index, read);
        placed.place(job, lattice, batch, &mut tally)?;
        placed.hand_over(batch, intake)?;
        read += batch.len() as u64;
    }
    Ok((read, tally))
}

impl Placed {
    /// Places a batch's records on the lattice, and says what becomes of those that have no place.
    fn place(
        &mut self,
        job: &Job<'_>,
        lattice: &Lattice,
        batch: &PointBatch,
        tally: &mut Tally,
    ) -> Result<()> {
        let (stride, records) = (batch.schema().stride, batch.records());
        let Placed { positions, tags, left_out, useless, .. } = self;
        positions.clear();
        tags.clear();
        left_out.clear();
        useless.clear();
        let (mut misplaced, mut held) = (Vec::new(), Vec::new());
        let tagger = &job.task.tagger;
        tagger.conditions(batch, &mut held)?;
        let held = |i: usize| held.get(i).copied().unwrap_or(0);
        lattice.place(
            batch.schema(),
            records,
            |i, position| match tagger.look(
                &records[i * stride..(i + 1) * stride],
                batch.source,
                held(i),
            ) {
                Err(reason) => {
                    *useless.entry(reason).or_default() += 1;
                    left_out.push(i);
                }
                Ok(tag) => {
                    tally.selections |= tag.selections();
                    positions.push(position);
                    tags.push(tag);
                }
            },
            |i, why| misplaced.push((i, why)),
        );
        for (i, why) in misplaced {
            if why == Misplaced::NotFinite && job.task.drops_nonfinite() {
                tally.remove(&job.task.source_kind, NOT_FINITE, 1);
                left_out.push(i);
            } else {
                return Err(job.misplaced(batch, i, why));
            }
        }
        useless
            .iter()
            .for_each(|(reason, &count)| tally.remove(&job.task.source_kind, reason, count));
        tally.work("placed", positions.len() as u64);
        left_out.sort_unstable();
        Ok(())
    }

    /// Hands the records that have a place to the intake, each stretch between two that have none.
    fn hand_over(&self, batch: &PointBatch, intake: &mut Intake<'_>) -> Result<()> {
        let (stride, records) = (batch.schema().stride, batch.records());
        let (mut begin, mut at) = (0, 0);
        for end in self.left_out.iter().copied().chain([batch.len()]) {
            let count = end - begin;
            let (these, tags) = (&self.positions[at..at + count], &self.tags[at..at + count]);
            intake.place(self.first + begin as u64);
            intake.take(these, &records[begin * stride..end * stride], tags)?;
            (begin, at) = (end + 1, at + count);
        }
        Ok(())
    }
}
