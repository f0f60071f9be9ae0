//! Stages that stream, behind stages that work on tiles: what they remove of what a tile leaves.
//!
//! Such a stage sees records and no neighbours, so nothing of its work depends on tiles. What it
//! removes must be known when the next pass begins, though, and what it changes only as records are
//! written. So it is applied twice: here, to learn which records it keeps, and again to those that
//! are written (`encoding.rs`). It is a function of the record alone; the other way, to store
//! changed records anew, would hold the scan twice.

use std::ops::Range;

use super::encoding::{change, edit};
use super::job::Job;
use super::pass::Pass;
use super::product::Product;
use super::row::RowLayout;
use crate::budget::Bytes;
use crate::point::PointBatch;
use crate::report::Tally;
use crate::store::{Fetch, RecordState, SealedTiles};
use crate::{Error, Result};

/// Records that are looked at together.
const AT_ONCE: usize = 4096;

/// Applies stages that stream to the products of tiles, and chooses the records that the stage
/// behind them is limited to; one a thread.
pub(crate) struct Filtering<'a> {
    job: &'a Job<'a>,
    tiles: &'a SealedTiles,
    pass: &'a Pass,
    fetch: Fetch,
    batch: PointBatch,
    numbers: Vec<u64>,
    states: Vec<RecordState>,
}

impl<'a> Filtering<'a> {
    /// For the products of `pass`.
    pub fn new(job: &'a Job<'a>, tiles: &'a SealedTiles, pass: &'a Pass) -> Self {
        Filtering {
            job,
            tiles,
            pass,
            fetch: Fetch::default(),
            batch: PointBatch::new(job.task.schema().clone(), AT_ONCE),
            numbers: Vec::with_capacity(AT_ONCE),
            states: Vec::with_capacity(AT_ONCE),
        }
    }

    /// Bytes that it holds for records of `stride` bytes and rows of `row`: the records twice where
    /// a stage works on some of them.
    pub fn bytes(stride: usize, row: usize) -> Bytes {
        let numbers = size_of::<u64>() + size_of::<RecordState>() + size_of::<u32>();
        let records = Bytes::of(2 * AT_ONCE as u64, stride + row);
        let records = records + Bytes::of(AT_ONCE as u64, numbers + row);
        records + Fetch::bytes(AT_ONCE as u64, stride)
    }

    /// Enters into `product` what becomes of its records.
    pub fn apply(
        &mut self,
        product: &mut Product,
        layout: &RowLayout,
        tally: &mut Tally,
    ) -> Result<()> {
        let mut states = Vec::new();
        let written: u64 = product.written().map(|(_, entry)| u64::from(entry.count)).sum();
        let mut done = 0;
        while done < written {
            let end = written.min(done + AT_ONCE as u64);
            self.fetch(product, layout, done..end)?;
            self.look(&mut states, tally)?;
            done = end;
        }
        product.replace(&states, layout);
        Ok(())
    }

    /// Fetches those written records of `product` that have the places `span`.
    fn fetch(&mut self, product: &Product, layout: &RowLayout, span: Range<u64>) -> Result<()> {
        self.numbers.clear();
        self.states.clear();
        let (mut place, mut rows, mut counts) = (0, Vec::new(), Vec::new());
        for (n, entry) in product.written() {
            let count = u64::from(entry.count);
            let skipped = span.start.saturating_sub(place).min(count);
            let until = span.end.saturating_sub(place).min(count).max(skipped);
            place += count;
            if until > skipped {
                self.numbers.extend(entry.number + skipped..entry.number + until);
                self.states.resize(self.numbers.len(), entry.now);
                layout.enter(product.row(n, layout), &mut rows);
                counts.push((until - skipped) as usize);
            }
        }
        self.batch.clear();
        self.tiles.fetch(&self.numbers, &mut self.fetch, &mut self.batch)?;
        edit(&mut self.batch, &self.states)?;
        self.batch.columns = layout.spread(&rows, counts.into_iter());
        change(self.job, &self.pass.changed_by, &mut self.batch)
    }

    /// Appends to `states` what becomes of each of the fetched records.
    fn look(&mut self, states: &mut Vec<RecordState>, tally: &mut Tally) -> Result<()> {
        self.batch.number_records();
        for &filter in &self.pass.filters {
            let stage = &self.job.task.filters[filter];
            let before = self.batch.len();
            stage.apply(&mut self.batch, tally)?;
            tally.remove(&stage.kind, "removed", (before - self.batch.len()) as u64);
        }
        let mut chosen = Vec::new();
        if let Some(op) = self.pass.chooses {
            self.job.ops[op].limits.choice.holds(&self.batch, &mut chosen)?;
        }
        let numbers = self.batch.numbers().filter(|numbers| numbers.len() == self.batch.len());
        let numbers = numbers.ok_or_else(|| {
            Error::internal("a stage that streams removes records other than by `retain`")
        })?;
        let begin = states.len();
        states.resize(begin + self.numbers.len(), RecordState::REMOVED);
        for (n, &number) in numbers.iter().enumerate() {
            let was = self.states[number as usize];
            let now = chosen.get(n).map_or(was, |is_chosen| was.chosen(*is_chosen));
            states[begin + number as usize] = now;
        }
        Ok(())
    }
}
