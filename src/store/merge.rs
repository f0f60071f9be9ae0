//! Sorted runs become one canonical sequence of distinct positions, each with its records.
//!
//! The lattice is cut into ranges of Morton order that the threads merge independently, each by
//! walking all runs at once; nothing is held but a block a run.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;
use std::collections::binary_heap::PeekMut;

use super::block::{BLOCK, Block};
use super::emit::{Emitter, MergeOutput, Merged};
use super::intake::{SortedRun, TileStore};
use super::key::{first_of_prefix, morton_cmp, morton_prefix, split_level};
use super::pieces::Pieces;
use super::record::ref_bytes;
use super::sealed::{SealedTiles, Sequence};
use super::spill::Spill;
use super::tournament::Tournament;
use crate::Result;
use crate::budget::Bytes;
use crate::host::{Threads, lock};
use crate::point::{Bounds, Position};

/// Blocks of all runs that one range has, about, at least.
const RANGE_BLOCKS: usize = 256;
/// Blocks of one run that a range has, about, at least: where it begins and ends, blocks of every
/// run are read for a part of them.
const RANGE_BLOCKS_EACH: usize = 4;
/// Bytes that a thread holds while it merges `runs` runs of records of `stride` bytes.
pub fn merge_bytes(runs: u64, stride: usize) -> Bytes {
    RunCursor::bytes(stride) * runs + Bytes::from(Emitter::BYTES)
}

/// Merges the runs of `store`, a range an item; `advance` is told of records merged and says
/// whether to go on.
pub fn seal(
    store: TileStore,
    threads: Threads<'_>,
    advance: &(dyn Fn(u64) -> Result<()> + Sync),
) -> Result<SealedTiles> {
    let runs = std::mem::take(&mut *lock(&store.runs));
    let working = merge_bytes(runs.len() as u64, store.stride) * threads.count() as u64;
    let _working = store.budget.lease(working.0, "merging of sorted runs")?;
    let ranges = ranges(&runs);
    // The merge leaves no more blocks than the runs have, but for one that is not full in each
    // range.
    let blocks = runs.iter().map(|run| run.blocks.len()).sum::<usize>() + ranges.len();
    let index = |blocks: usize| Bytes::of(blocks as u64, SealedTiles::BYTES_PER_BLOCK);
    let mut lease = store.budget.lease(index(blocks).0, "index of the scan")?;
    let out = MergeOutput {
        positions: Spill::new(&store.area, "positions"),
        refs: Pieces::new(&store.area, "order", ref_bytes(store.tagged)),
        tagged: store.tagged,
    };
    let mut merged = Vec::with_capacity(ranges.len());
    threads.items(ranges.len(), || {}).run(
        || (),
        |(), number| {
            let merged = merge_range(&store, &runs, &ranges[number], &out)?;
            advance(merged.records)?;
            Ok(merged)
        },
        |range| merged.push(range),
        |()| Ok(()),
    )?;
    drop(runs);
    let sequence = join(merged, blocks);
    lease.shrink_to(index(sequence.blocks.len()).0);
    let refs = (out.refs, out.tagged);
    Ok(SealedTiles::new(sequence, out.positions, refs, (store.records, store.places), lease))
}

/// A range of Morton order.
struct Range {
    /// Where it begins; None where the scan does.
    from: Option<Position>,
    /// Where the next one begins; None behind the last.
    until: Option<Position>,
    /// A cube of side 2^level holds all of its positions.
    level: u32,
}

/// The scan in ranges, which end at every so many blocks' first positions.
fn ranges(runs: &[SortedRun]) -> Vec<Range> {
    let blocks = || runs.iter().flat_map(|run| &run.blocks);
    let mut firsts: Vec<Position> = blocks().map(|block| block.first).collect();
    firsts.sort_unstable_by(morton_cmp);
    let each = RANGE_BLOCKS.max(RANGE_BLOCKS_EACH * runs.len());
    let mut borders: Vec<Position> = firsts.into_iter().skip(each).step_by(each).collect();
    borders.dedup();
    let bounds = blocks().fold(Bounds::EMPTY, |all, block| all.union(&block.bounds));
    let begins = std::iter::once(None).chain(borders.iter().copied().map(Some));
    let ends = borders.iter().copied().map(Some).chain([None]);
    begins
        .zip(ends)
        .map(|(from, until)| {
            // No corner of the box comes before its lowest, and none after its highest.
            let (first, last) = (from.unwrap_or(bounds.lo), until.unwrap_or(bounds.hi));
            let level = split_level(first, last).map_or(0, |bit| bit + 1);
            Range { from, until, level }
        })
        .collect()
}

fn join(ranges: Vec<Merged>, most_blocks: usize) -> Sequence {
    let blocks = Vec::with_capacity(most_blocks);
    let mut all = Sequence { blocks, ..Sequence::default() };
    let mut last = None;
    for range in ranges {
        let Some((first, end)) = range.ends else { continue };
        // A range does not know what came before it: its first position is counted here.
        all.levels.add(last, first);
        all.levels.merge(&range.levels);
        last = Some(end);
        if let Some(block) = range.blocks.first() {
            all.stretches.push((all.blocks.len(), block.first_record, all.records));
        }
        all.records += range.records;
        for mut block in range.blocks {
            block.first_position = all.positions;
            all.positions += block.len() as u64;
            all.bounds = all.bounds.union(&block.bounds);
            all.blocks.push(block);
        }
    }
    all
}

fn merge_range(
    store: &TileStore,
    runs: &[SortedRun],
    range: &Range,
    out: &MergeOutput,
) -> Result<Merged> {
    let mut cursors = Vec::with_capacity(runs.len());
    let mut tournament = Tournament::new(runs.len());
    let mut buffer = Vec::new();
    let mut most = 0;
    for (number, run) in runs.iter().enumerate() {
        let mut cursor = RunCursor::new(store, run, range);
        most += cursor.seek(&mut buffer)?;
        tournament.set(number, cursor.key());
        cursors.push(cursor);
    }
    let mut emitter = Emitter::new(out, most)?;
    let mut equals = Equals::default();
    while let Some(first) = tournament.first() {
        let second = tournament.second();
        if second.is_some_and(|second| second.key == first.key) {
            equals.emit(first.key, &mut tournament, &mut cursors, &mut emitter, &mut buffer)?;
            continue;
        }
        // Up to the key with which another run goes on, nothing is to be compared. Several may go
        // on with it: their first position is known when they are all asked.
        let until = second.and_then(|second| cursors[second.run].first_of_key());
        let cursor = &mut cursors[first.run];
        cursor.emit_until(until, &mut emitter, &mut buffer)?;
        tournament.set(first.run, cursor.key());
    }
    emitter.finish()
}

/// Orders what keys leave open: runs of which the heads have the same key, be the positions equal
/// or not. Holds memory to work in.
#[derive(Default)]
struct Equals {
    runs: Vec<usize>,
    records: BinaryHeap<Reverse<(Vec<u8>, usize)>>,
}

impl Equals {
    /// Emits all positions of that key.
    fn emit(
        &mut self,
        key: u64,
        tournament: &mut Tournament,
        cursors: &mut [RunCursor<'_>],
        emitter: &mut Emitter<'_>,
        buffer: &mut Vec<u8>,
    ) -> Result<()> {
        let mut open = Vec::new();
        while let Some(head) = tournament.first().filter(|head| head.key == key) {
            open.push(head.run);
            tournament.set(head.run, None);
        }
        loop {
            let heads = open.iter().filter(|run| cursors[**run].key() == Some(key));
            let Some(first) = heads.filter_map(|run| cursors[*run].head()).min_by(morton_cmp)
            else {
                break;
            };
            self.runs.clear();
            self.runs.extend(open.iter().filter(|run| cursors[**run].head() == Some(first)));
            emit_equal(cursors, &self.runs, first, emitter, &mut self.records, buffer)?;
        }
        open.iter().for_each(|&run| tournament.set(run, cursors[run].key()));
        Ok(())
    }
}

/// Emits the records of one position from the runs that have it, smallest record first; `records`
/// is an empty heap to work in, with the record at the head of each run.
fn emit_equal(
    cursors: &mut [RunCursor<'_>],
    runs: &[usize],
    position: Position,
    emitter: &mut Emitter<'_>,
    records: &mut BinaryHeap<Reverse<(Vec<u8>, usize)>>,
    buffer: &mut Vec<u8>,
) -> Result<()> {
    let mut last = runs.first().copied();
    if runs.len() > 1 {
        for &run in runs {
            let mut record = std::mem::take(&mut cursors[run].spare);
            cursors[run].read_record(&mut record, buffer)?;
            records.push(Reverse((record, run)));
        }
        while records.len() > 1
            && let Some(mut smallest) = records.peek_mut()
        {
            let Reverse((record, run)) = &mut *smallest;
            let cursor = &mut cursors[*run];
            emitter.take(&[position], cursor.number(), &[cursor.tag()])?;
            cursor.advance(1, buffer)?;
            if cursor.head() == Some(position) {
                cursor.read_record(record, buffer)?;
            } else {
                cursor.spare = PeekMut::pop(smallest).0.0;
            }
        }
        // What the last run has left is in order, and nothing is left to compare it to.
        last = records.pop().map(|Reverse((record, run))| {
            cursors[run].spare = record;
            run
        });
    }
    let Some(run) = last else { return Ok(()) };
    let cursor = &mut cursors[run];
    while cursor.head() == Some(position) {
        emitter.take(&[position], cursor.number(), &[cursor.tag()])?;
        cursor.advance(1, buffer)?;
    }
    Ok(())
}

/// A walk along a range of a run.
struct RunCursor<'a> {
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
    spare: Vec<u8>,
}

impl<'a> RunCursor<'a> {
    /// Bytes that it holds: a block, the record at its head, and itself.
    fn bytes(stride: usize) -> Bytes {
        Bytes::from(BLOCK * Block::BYTES_PER_POSITION + 256) + Bytes::from(stride)
    }

    fn new(store: &'a TileStore, run: &'a SortedRun, range: &'a Range) -> Self {
        let (positions, tags, spare) = (Vec::new(), Vec::new(), Vec::new());
        RunCursor { store, run, range, block: 0, at: 0, positions, tags, spare }
    }

    /// Goes to the first record of the range; returns how many it has at most.
    fn seek(&mut self, buffer: &mut Vec<u8>) -> Result<u64> {
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
    fn load(&mut self, buffer: &mut Vec<u8>) -> Result<()> {
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
    fn head(&self) -> Option<Position> {
        self.positions.get(self.at).copied()
    }

    /// The key of [`head`](Cursor::head).
    fn key(&self) -> Option<u64> {
        self.positions.get(self.at).map(|p| morton_prefix(*p, self.range.level))
    }

    /// The first of all positions that have the key of [`head`](Cursor::head), be they there or
    /// not.
    fn first_of_key(&self) -> Option<Position> {
        self.head().map(|p| first_of_prefix(p, self.range.level))
    }

    /// Number of the record it stands at, among all of the store.
    fn number(&self) -> u64 {
        self.run.first_record + (self.block * BLOCK + self.at) as u64
    }

    /// The tag of the record it stands at.
    fn tag(&self) -> u32 {
        self.tags.get(self.at).copied().unwrap_or_default()
    }

    /// Emits its records from the head, which is before `until`, up to there or to the end of the
    /// block.
    fn emit_until(
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

    fn advance(&mut self, records: usize, buffer: &mut Vec<u8>) -> Result<()> {
        self.at += records;
        if self.at == self.positions.len() {
            self.block += 1;
            self.load(buffer)?;
        }
        Ok(())
    }

    /// Reads the record it stands at.
    fn read_record(&self, record: &mut Vec<u8>, buffer: &mut Vec<u8>) -> Result<()> {
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
