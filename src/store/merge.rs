//! Sorted runs become one canonical sequence of distinct positions, each with its records.
//!
//! The lattice is cut into ranges of Morton order that the threads merge independently, each by
//! walking all runs at once; nothing is held but a block a run.
//!
//! Tiles could be read from the runs as they are. But with r runs a tile would be read in r places
//! each time that it is loaded, as part of a core or of a rim; merged, it is one stretch. Distinct
//! positions, their copies, exact counts for every cube size and the canonical order come out of
//! the same walk. What it costs is writing positions twice, about 6 bytes each.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::collections::binary_heap::PeekMut;

use super::cursor::{Range, RunCursor};
use super::emit::{Emitter, MergeOutput, Merged};
use super::intake::{SortedRun, TileStore};
use super::key::split_level;
use super::pieces::Pieces;
use super::record::ref_bytes;
use super::sealed::{SealedTiles, Sequence};
use super::spill::Spill;
use super::tournament::Tournament;
use crate::Result;
use crate::budget::Bytes;
use crate::geom::morton::morton_cmp;
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
    Ok(SealedTiles::new(sequence, out, store.records, store.places, lease))
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
