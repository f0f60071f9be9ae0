//! Sorted runs become one canonical sequence of distinct positions, each with its records.
//!
//! The lattice is cut into ranges of Morton order that the threads merge independently, each by
//! walking all runs at once; nothing is held but a block a run.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;
use std::collections::binary_heap::PeekMut;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering as Atomic};

use super::block::{BLOCK, Block};
use super::emit::{Emitter, Merged, Output};
use super::intake::{Run, TileStore};
use super::key::morton_cmp;
use super::parallel;
use super::sealed::{SealedTiles, Sequence, ref_bytes};
use super::spill::{Pieces, Spill, lock};
use crate::Result;
use crate::point::Position;

/// Blocks of all runs that one range has, about, at least.
const RANGE_BLOCKS: usize = 256;
/// Blocks of one run that a range has, about, at least: where it begins and ends, blocks of every
/// run are read for a part of them.
const RANGE_BLOCKS_EACH: usize = 4;
/// Bytes that a thread holds while it merges `runs` runs of records of `stride` bytes.
pub fn merge_bytes(runs: usize, stride: usize) -> u64 {
    let cursor = BLOCK * (size_of::<Position>() + 4) + stride + 256;
    (runs * cursor + Emitter::BYTES) as u64
}

/// Merges the runs of `store` on `threads` threads; `advance` is told of records merged and says
/// whether to go on.
pub fn seal(
    store: TileStore,
    threads: usize,
    advance: &(dyn Fn(u64) -> Result<()> + Sync),
) -> Result<SealedTiles> {
    let runs = std::mem::take(&mut *lock(&store.runs));
    let _working = store
        .budget
        .lease(merge_bytes(runs.len(), store.stride) * threads as u64, "merging of sorted runs")?;
    let borders = borders(&runs);
    // The merge leaves no more blocks than the runs have, but for one that is not full in each range.
    let blocks = runs.iter().map(|run| run.blocks.len()).sum::<usize>() + borders.len() + 1;
    let each = size_of::<Block>() as u64 + 8;
    let mut lease = store.budget.lease(blocks as u64 * each, "index of the tiles")?;
    let out = Output {
        positions: Spill::new(&store.area, "positions"),
        refs: Pieces::new(&store.area, "order", ref_bytes(store.tagged)),
        tagged: store.tagged,
    };
    let ranges: Vec<Mutex<Option<Merged>>> =
        (0..=borders.len()).map(|_| Mutex::default()).collect();
    let next = AtomicUsize::new(0);
    let merge = |range: usize, slot: &Mutex<Option<Merged>>| -> Result<()> {
        let from = range.checked_sub(1).map(|b| borders[b]);
        let merged = merge_range(&store, &runs, from, borders.get(range).copied(), &out)?;
        advance(merged.records)?;
        *lock(slot) = Some(merged);
        Ok(())
    };
    parallel(threads, |_| {
        loop {
            let range = next.fetch_add(1, Atomic::Relaxed);
            let Some(slot) = ranges.get(range) else { return Ok(()) };
            // Whoever fails leaves the others no range.
            merge(range, slot).inspect_err(|_| next.store(ranges.len(), Atomic::Relaxed))?;
        }
    })?;
    drop(runs);
    let ranges = ranges.into_iter().filter_map(|slot| slot.into_inner().ok().flatten());
    let sequence = join(ranges, blocks);
    lease.resize(sequence.blocks.len() as u64 * each)?;
    let refs = (out.refs, out.tagged);
    Ok(SealedTiles::new(sequence, out.positions, refs, store.records, lease))
}

/// Positions at which one range ends and the next begins: every so many blocks' first positions.
fn borders(runs: &[Run]) -> Vec<Position> {
    let mut firsts: Vec<Position> =
        runs.iter().flat_map(|run| run.blocks.iter().map(|block| block.first)).collect();
    firsts.sort_unstable_by(morton_cmp);
    let each = RANGE_BLOCKS.max(RANGE_BLOCKS_EACH * runs.len());
    let mut borders: Vec<Position> = firsts.into_iter().skip(each).step_by(each).collect();
    borders.dedup();
    borders
}

fn join(ranges: impl Iterator<Item = Merged>, most_blocks: usize) -> Sequence {
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
    runs: &[Run],
    from: Option<Position>,
    until: Option<Position>,
    out: &Output,
) -> Result<Merged> {
    let mut cursors = Vec::with_capacity(runs.len());
    let mut buffer = Vec::new();
    let mut most = 0;
    for run in runs {
        let mut cursor = Cursor::new(store, run);
        most += cursor.seek(from, until, &mut buffer)?;
        cursors.push(cursor);
    }
    let mut heap: BinaryHeap<Head> = cursors
        .iter()
        .enumerate()
        .filter_map(|(run, c)| Some(Head { position: c.head(until)?, run }))
        .collect();
    let mut emitter = Emitter::new(out, most);
    let (mut equal, mut records) = (Vec::new(), BinaryHeap::new());
    while let Some(head) = heap.pop() {
        let next = heap.peek().map(|next| next.position);
        if next != Some(head.position) {
            // Up to where another run goes on, or the range ends, nothing is to be compared.
            let cursor = &mut cursors[head.run];
            cursor.emit_until(next.or(until), &mut emitter, &mut buffer)?;
            let position = cursor.head(until);
            heap.extend(position.map(|position| Head { position, run: head.run }));
            continue;
        }
        equal.clear();
        equal.push(head.run);
        while heap.peek().is_some_and(|next| next.position == head.position) {
            equal.extend(heap.pop().map(|next| next.run));
        }
        let at = head.position;
        emit_equal(&mut cursors, &equal, at, &mut emitter, &mut records, &mut buffer)?;
        for &run in &equal {
            if let Some(position) = cursors[run].head(until) {
                heap.push(Head { position, run });
            }
        }
    }
    emitter.finish()
}

/// Emits the records of one position from the runs that have it, smallest record first; `records`
/// is an empty heap to work in, with the record at the head of each run.
fn emit_equal(
    cursors: &mut [Cursor<'_>],
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
            cursors[run].read_record(&mut record)?;
            records.push(Reverse((record, run)));
        }
        while records.len() > 1
            && let Some(mut smallest) = records.peek_mut()
        {
            let Reverse((record, run)) = &mut *smallest;
            let cursor = &mut cursors[*run];
            emitter.take(&[position], cursor.number(), &[cursor.tag()])?;
            cursor.advance(1, buffer)?;
            if cursor.head(None) == Some(position) {
                cursor.read_record(record)?;
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
    while cursor.head(None) == Some(position) {
        emitter.take(&[position], cursor.number(), &[cursor.tag()])?;
        cursor.advance(1, buffer)?;
    }
    Ok(())
}

/// The next position of a run; the smallest is the greatest in a [`BinaryHeap`].
struct Head {
    position: Position,
    run: usize,
}

impl Ord for Head {
    fn cmp(&self, other: &Self) -> Ordering {
        morton_cmp(&other.position, &self.position).then(other.run.cmp(&self.run))
    }
}
impl PartialOrd for Head {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Head {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Head {}

/// How many of `positions`, which are in order, are before `end`: the search is quick where few are,
/// and where all are.
fn before(positions: &[Position], end: &Position) -> usize {
    let is_before = |p: &Position| morton_cmp(p, end) == Ordering::Less;
    if positions.last().is_none_or(is_before) {
        return positions.len();
    }
    let mut wide = 1;
    while positions.get(wide).is_some_and(is_before) {
        wide *= 2;
    }
    let from = wide / 2;
    let to = wide.min(positions.len());
    from + positions[from..to].partition_point(is_before)
}

/// A walk along a run.
struct Cursor<'a> {
    store: &'a TileStore,
    run: &'a Run,
    block: usize,
    at: usize,
    positions: Vec<Position>,
    /// Tags of the block's records, if they have any.
    tags: Vec<u32>,
    /// Memory for the record at the head, for when equal positions must be ordered.
    spare: Vec<u8>,
}

impl<'a> Cursor<'a> {
    fn new(store: &'a TileStore, run: &'a Run) -> Self {
        let (positions, tags, spare) = (Vec::new(), Vec::new(), Vec::new());
        Cursor { store, run, block: 0, at: 0, positions, tags, spare }
    }

    /// Goes to the first record at or behind `from`; returns how many records the range until
    /// `until` has at most.
    fn seek(
        &mut self,
        from: Option<Position>,
        until: Option<Position>,
        buffer: &mut Vec<u8>,
    ) -> Result<u64> {
        let blocks = &self.run.blocks;
        let before = |p: &Position| {
            blocks.partition_point(|block| morton_cmp(&block.first, p) == Ordering::Less)
        };
        let end = until.as_ref().map_or(blocks.len(), before);
        // Records equal to `from` may begin in the block before the first that begins at or behind it.
        self.block = from.as_ref().map_or(0, |p| before(p).saturating_sub(1));
        self.load(buffer)?;
        if let Some(from) = from {
            loop {
                self.at =
                    self.positions.partition_point(|p| morton_cmp(p, &from) == Ordering::Less);
                if self.at < self.positions.len() || self.block >= blocks.len() {
                    break;
                }
                self.block += 1;
                self.load(buffer)?;
            }
        }
        Ok((end.saturating_sub(self.block) * BLOCK) as u64)
    }

    /// Reads the block that it is at; `buffer` is memory to work in, which all cursors share.
    fn load(&mut self, buffer: &mut Vec<u8>) -> Result<()> {
        self.at = 0;
        self.positions.clear();
        self.tags.clear();
        let Some(block) = self.run.blocks.get(self.block) else { return Ok(()) };
        // Records of a run are not gathered: where distinct positions have copies, these have tags.
        let tags = self.store.tagged.then_some(&mut self.tags);
        block.read(&self.store.positions, buffer, &mut self.positions, tags)
    }

    /// The position it stands at, if that is before `until`.
    fn head(&self, until: Option<Position>) -> Option<Position> {
        let head = *self.positions.get(self.at)?;
        let inside = until.is_none_or(|end| morton_cmp(&head, &end) == Ordering::Less);
        inside.then_some(head)
    }

    /// Number of the record it stands at, among all of the store.
    fn number(&self) -> u64 {
        self.run.first_record + (self.block * BLOCK + self.at) as u64
    }

    /// The tag of the record it stands at.
    fn tag(&self) -> u32 {
        self.tags.get(self.at).copied().unwrap_or_default()
    }

    /// Emits its records before `until`, all that are left if that is nowhere.
    fn emit_until(
        &mut self,
        until: Option<Position>,
        emitter: &mut Emitter<'_>,
        buffer: &mut Vec<u8>,
    ) -> Result<()> {
        loop {
            let rest = &self.positions[self.at..];
            let count = until.map_or(rest.len(), |end| before(rest, &end));
            if count == 0 {
                return Ok(());
            }
            let range = self.at..self.at + count;
            let tags = self.tags.get(range.clone()).unwrap_or_default();
            emitter.take(&self.positions[range], self.number(), tags)?;
            self.advance(count, buffer)?;
        }
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
    fn read_record(&self, record: &mut Vec<u8>) -> Result<()> {
        record.resize(self.store.stride, 0);
        self.store.records.read(self.number(), record)?;
        // Equal records are told apart by their tags: by the input that they come from.
        record.extend_from_slice(&self.tag().to_be_bytes());
        Ok(())
    }
}
