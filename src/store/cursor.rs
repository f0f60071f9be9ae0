//! A walk along a part of a sorted run, from which the merge takes what comes next.
//!
//! It holds one block, so the memory of a merge follows from the number of runs and not from their
//! length. A run is mostly passed on in stretches: all positions before the next run's head are
//! found by one search in the block, instead of comparing them one by one.

use std::cmp::Ordering;

use super::block::{BLOCK, Block};
use super::emit::Emitter;
use super::intake::{SortedRun, TileStore};
use super::key::{first_of_prefix, morton_prefix};
use crate::Result;
use crate::budget::Bytes;
use crate::geom::morton::morton_cmp;
use crate::point::Position;

/// A range of Morton order.
pub(crate) struct Range {
    /// Where it begins; None where the scan does.
    pub from: Option<Position>,
    /// Where the next one begins; None behind the last.
    pub until: Option<Position>,
    /// A cube of side 2^level holds all of its positions.
    pub level: u32,
}

/// A walk along a range of a run.
pub(crate) struct RunCursor<'a> {
    store: &'a TileStore,
    run: &'a SortedRun,
    range: &'a Range,
    block: usize,
    at: usize,
    /// Positions of the block that it is at, up to the end of the range.
    positions: Vec<Position>,
    /// Tags of the block's records, if they have any.
    tags: Vec<u32>,
    /// Memory for the record at the head, for when equal positions must be ordered.
    pub spare: Vec<u8>,
}

impl<'a> RunCursor<'a> {
    /// Bytes that it holds: a block, the record at its head, and itself.
    pub fn bytes(stride: usize) -> Bytes {
        Bytes::from(BLOCK * Block::BYTES_PER_POSITION + 256) + Bytes::from(stride)
    }

    pub fn new(store: &'a TileStore, run: &'a SortedRun, range: &'a Range) -> Self {
        let (positions, tags, spare) = (Vec::new(), Vec::new(), Vec::new());
        RunCursor { store, run, range, block: 0, at: 0, positions, tags, spare }
    }

    /// Goes to the first record of the range; returns how many it has at most.
    pub fn seek(&mut self, buffer: &mut Vec<u8>) -> Result<u64> {
        let blocks = &self.run.blocks;
        let before = |p: &Position| {
            blocks.partition_point(|block| morton_cmp(&block.first, p) == Ordering::Less)
        };
        let end = self.range.until.as_ref().map_or(blocks.len(), before);
        // Records equal to `from` may begin in the block before the first that begins at or behind
        // it.
        self.block = self.range.from.as_ref().map_or(0, |p| before(p).saturating_sub(1));
        let most = (end.saturating_sub(self.block) * BLOCK) as u64;
        self.load(buffer)?;
        if let Some(from) = &self.range.from {
            loop {
                self.at = self.positions.partition_point(|p| morton_cmp(p, from) == Ordering::Less);
                if self.at < self.positions.len() || self.positions.is_empty() {
                    break;
                }
                self.block += 1;
                self.load(buffer)?;
            }
        }
        Ok(most)
    }

    /// Reads the block that it is at, none if that begins behind the range; `buffer` is memory to
    /// work in, which all cursors share.
    pub fn load(&mut self, buffer: &mut Vec<u8>) -> Result<()> {
        self.at = 0;
        self.positions.clear();
        self.tags.clear();
        let until = &self.range.until;
        let inside = |p: &Position| until.is_none_or(|end| morton_cmp(p, &end) == Ordering::Less);
        let Some(block) = self.run.blocks.get(self.block).filter(|block| inside(&block.first))
        else {
            return Ok(());
        };
        // Records of a run are not gathered: where distinct positions have copies, these have tags.
        let tags = self.store.tagged.then_some(&mut self.tags);
        block.read(&self.store.positions, buffer, &mut self.positions, tags)?;
        self.positions.truncate(self.positions.partition_point(inside));
        Ok(())
    }

    /// The position it stands at; None at the end of the range.
    pub fn head(&self) -> Option<Position> {
        self.positions.get(self.at).copied()
    }

    /// The key of [`head`](RunCursor::head).
    pub fn key(&self) -> Option<u64> {
        self.positions.get(self.at).map(|p| morton_prefix(*p, self.range.level))
    }

    /// The first of all positions that have the key of [`head`](RunCursor::head), be they there or
    /// not.
    pub fn first_of_key(&self) -> Option<Position> {
        self.head().map(|p| first_of_prefix(p, self.range.level))
    }

    /// Number of the record it stands at, among all of the store.
    pub fn number(&self) -> u64 {
        self.run.first_record + (self.block * BLOCK + self.at) as u64
    }

    /// The tag of the record it stands at.
    pub fn tag(&self) -> u32 {
        self.tags.get(self.at).copied().unwrap_or_default()
    }

    /// Emits its records from the head, which is before `until`, up to there or to the end of the
    /// block.
    pub fn emit_until(
        &mut self,
        until: Option<Position>,
        emitter: &mut Emitter<'_>,
        buffer: &mut Vec<u8>,
    ) -> Result<()> {
        let rest = &self.positions[self.at..];
        let count = until.map_or(rest.len(), |end| count_before(rest, &end));
        let taken = self.at..self.at + count;
        let tags = self.tags.get(taken.clone()).unwrap_or_default();
        emitter.take(&self.positions[taken], self.number(), tags)?;
        self.advance(count, buffer)
    }

    pub fn advance(&mut self, records: usize, buffer: &mut Vec<u8>) -> Result<()> {
        self.at += records;
        if self.at == self.positions.len() {
            self.block += 1;
            self.load(buffer)?;
        }
        Ok(())
    }

    /// Reads the record it stands at.
    pub fn read_record(&self, record: &mut Vec<u8>, buffer: &mut Vec<u8>) -> Result<()> {
        record.clear();
        record.extend_from_slice(self.store.records.get(self.number(), 1, buffer)?);
        // Equal records are told apart by their tags, by the input that they come from, and where
        // an output is in the order of the inputs by their place there.
        record.extend_from_slice(&self.tag().to_be_bytes());
        if let Some(places) = &self.store.places {
            record.extend(places.get(self.number(), 1, buffer)?.iter().rev());
        }
        Ok(())
    }
}

/// How many of `positions`, which are in order and the first of which is, are before `end`: the
/// search is quick where few are, and where all are.
fn count_before(positions: &[Position], end: &Position) -> usize {
    let is_before = |p: &Position| morton_cmp(p, end) == Ordering::Less;
    if !positions.get(1).is_some_and(is_before) {
        return positions.len().min(1);
    }
    if positions.last().is_none_or(is_before) {
        return positions.len();
    }
    let mut wide = 2;
    while positions.get(wide).is_some_and(is_before) {
        wide *= 2;
    }
    let from = wide / 2;
    let to = wide.min(positions.len());
    from + positions[from..to].partition_point(is_before)
}
