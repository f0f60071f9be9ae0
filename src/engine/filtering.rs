//! Stages that stream, behind stages that work on tiles: what they remove of what a tile leaves.
//!
//! Such a stage sees records and no neighbours, so nothing of its work depends on tiles. What it
//! removes must be known when the next pass begins, though, and what it changes only as records are
//! written. So it is applied twice: here, to learn which records it keeps, and again to those that
//! are written (`encoding.rs`). It is a function of the record alone; the other way, to store
//! changed records anew, would hold the scan twice.

use std::ops::Range;

use super::encoding::edit;
use super::job::Job;
use super::pass::PassFilter;
use super::product::Product;
use super::row::RowLayout;
use crate::budget::Bytes;
use crate::point::PointBatch;
use crate::report::Tally;
use crate::store::{Fetch, RecordState, SealedTiles};
use crate::{Error, Result};

/// Records that are looked at together.
const AT_ONCE: usize = 4096;

/// Applies stages that stream to the products of tiles; one a thread.
pub(crate) struct Filtering<'a> {
    job: &'a Job<'a>,
    tiles: &'a SealedTiles,
    filters: &'a [usize],
    fetch: Fetch,
    batch: PointBatch,
    numbers: Vec<u64>,
    states: Vec<RecordState>,
}

impl<'a> Filtering<'a> {
    /// For these of the job's filters.
    pub fn new(job: &'a Job<'a>, tiles: &'a SealedTiles, filters: &'a [usize]) -> Self {
        Filtering {
            job,
            tiles,
            filters,
            fetch: Fetch::default(),
            batch: PointBatch::new(job.task.source.schema().clone(), AT_ONCE),
            numbers: Vec::with_capacity(AT_ONCE),
            states: Vec::with_capacity(AT_ONCE),
        }
    }

    /// Bytes that it holds for records of `stride` bytes.
    pub fn bytes(stride: usize) -> Bytes {
        let numbers = size_of::<u64>() + size_of::<RecordState>() + size_of::<u32>();
        let records = Bytes::of(AT_ONCE as u64, stride) + Bytes::of(AT_ONCE as u64, numbers);
        records + Fetch::bytes(AT_ONCE as u64, stride)
    }

    /// Enters into `product` which of its records the filters remove.
    pub fn apply(
        &mut self,
        product: &mut Product,
        layout: &RowLayout,
        tally: &mut Tally,
    ) -> Result<()> {
        let mut kept = Vec::new();
        let written: u64 = product.written().map(|(_, n, _)| n).sum();
        let mut done = 0;
        while done < written {
            let end = written.min(done + AT_ONCE as u64);
            self.look(product, done..end, &mut kept, tally)?;
            done = end;
        }
        product.keep(&kept, layout);
        Ok(())
    }

    /// Appends to `kept` whether each of those written records that have the places `span` is kept.
    fn look(
        &mut self,
        product: &Product,
        span: Range<u64>,
        kept: &mut Vec<bool>,
        tally: &mut Tally,
    ) -> Result<()> {
        self.numbers.clear();
        self.states.clear();
        let mut place = 0;
        for (first, count, state) in product.written() {
            let skipped = span.start.saturating_sub(place).min(count);
            let until = span.end.saturating_sub(place).min(count);
            self.numbers.extend(first + skipped..first + until.max(skipped));
            self.states.resize(self.numbers.len(), state);
            place += count;
        }
        self.batch.clear();
        self.tiles.fetch(&self.numbers, &mut self.fetch, &mut self.batch)?;
        edit(&mut self.batch, &self.states)?;
        self.batch.number_records();
        for &filter in self.filters {
            let PassFilter { kind, transform } = &self.job.task.filters[filter];
            let before = self.batch.len();
            transform.apply(&mut self.batch, tally)?;
            let removed = before
                .checked_sub(self.batch.len())
                .ok_or_else(|| Error::internal(format!("the stage {kind} made points up")))?;
            tally.remove(kind, "removed", removed as u64);
        }
        let numbers = self.batch.numbers().filter(|numbers| numbers.len() == self.batch.len());
        let numbers = numbers.ok_or_else(|| {
            Error::internal("a stage that streams removes records other than by `retain`")
        })?;
        let begin = kept.len();
        kept.resize(begin + self.numbers.len(), false);
        numbers.iter().for_each(|&number| kept[begin + number as usize] = true);
        Ok(())
    }
}
