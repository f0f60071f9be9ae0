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
use super::intake::{Run, TileStore};
use super::key::morton_cmp;
use super::sealed::{SealedTiles, Sequence, ref_bytes};
use super::spill::{PIECE, Pieces, Spill, lock};
use super::{Levels, parallel};
use crate::point::Position;
use crate::{Error, Result};

/// Blocks of all runs that one range has, about, at least.
const RANGE_BLOCKS: usize = 256;
/// Blocks of one run that a range has, about, at least: where it begins and ends, blocks of every
/// run are read for a part of them.
const RANGE_BLOCKS_EACH: usize = 4;
/// Blocks packed before they are handed to the spill.
const BLOCKS_AT_ONCE: usize = 64;

/// Bytes that a thread holds while it merges `runs` runs of records of `stride` bytes.
pub fn merge_bytes(runs: usize, stride: usize) -> u64 {
    let cursor = BLOCK * (size_of::<Position>() + 4) + stride + 256;
    let emitter = BLOCKS_AT_ONCE * BLOCK * 28 + PIECE * 12 + 2 * BLOCK * 28;
    (runs * cursor + emitter) as u64
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

struct Output {
    positions: Spill,
    refs: Pieces,
    tagged: bool,
}

/// What a range came to.
struct Merged {
    blocks: Vec<Block>,
    records: u64,
    levels: Levels,
    ends: Option<(Position, Position)>,
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
            emitter.emit(position, cursor.number(), cursor.tag())?;
            cursor.advance(buffer)?;
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
        emitter.emit(position, cursor.number(), cursor.tag())?;
        cursor.advance(buffer)?;
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

    fn advance(&mut self, buffer: &mut Vec<u8>) -> Result<()> {
        self.at += 1;
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

/// Packs what comes out of the merge into blocks and pieces.
struct Emitter<'a> {
    out: &'a Output,
    merged: Merged,
    positions: Vec<Position>,
    copies: Vec<u32>,
    packed: Vec<u8>,
    unplaced: Vec<usize>,
    refs: Vec<u8>,
    first_ref: u64,
    refs_stored: u64,
    block_first: u64,
}

impl<'a> Emitter<'a> {
    fn new(out: &'a Output, most_records: u64) -> Self {
        Emitter {
            out,
            merged: Merged {
                blocks: Vec::new(),
                records: 0,
                levels: Levels::default(),
                ends: None,
            },
            positions: Vec::with_capacity(BLOCK),
            copies: Vec::with_capacity(BLOCK),
            packed: Vec::with_capacity(BLOCKS_AT_ONCE * BLOCK * 28),
            unplaced: Vec::with_capacity(BLOCKS_AT_ONCE),
            refs: Vec::with_capacity(PIECE * ref_bytes(out.tagged)),
            first_ref: out.refs.reserve(most_records),
            refs_stored: 0,
            block_first: 0,
        }
    }

    fn emit(&mut self, position: Position, record: u64, tag: u32) -> Result<()> {
        match (&mut self.merged.ends, self.copies.last_mut()) {
            (Some((_, last)), Some(copies)) if *last == position => {
                *copies = copies.checked_add(1).ok_or_else(|| {
                    Error::new(crate::ErrorKind::Data, "more than 2^32 records share one position")
                })?;
            }
            (ends, _) => {
                match ends {
                    None => *ends = Some((position, position)),
                    Some((_, last)) => {
                        self.merged.levels.add(Some(*last), position);
                        *last = position;
                    }
                }
                if self.positions.len() == BLOCK {
                    self.close_block()?;
                }
                self.positions.push(position);
                self.copies.push(1);
            }
        }
        self.merged.records += 1;
        self.refs.extend_from_slice(&record.to_le_bytes());
        if self.out.tagged {
            self.refs.extend_from_slice(&tag.to_le_bytes());
        }
        if self.refs.len() == PIECE * ref_bytes(self.out.tagged) {
            self.store_refs()?;
        }
        Ok(())
    }

    fn store_refs(&mut self) -> Result<()> {
        if !self.refs.is_empty() {
            self.out.refs.put(self.first_ref + self.refs_stored, &self.refs)?;
            self.refs_stored += (self.refs.len() / ref_bytes(self.out.tagged)) as u64;
            self.refs.clear();
        }
        Ok(())
    }

    fn close_block(&mut self) -> Result<()> {
        if self.positions.is_empty() {
            return Ok(());
        }
        let (mut block, start) = Block::pack(&self.positions, &self.copies, &mut self.packed);
        block.first_record = self.first_ref + self.block_first;
        self.block_first += self.copies.iter().map(|&n| u64::from(n)).sum::<u64>();
        self.merged.blocks.push(block);
        self.unplaced.push(start);
        self.positions.clear();
        self.copies.clear();
        if self.unplaced.len() == BLOCKS_AT_ONCE { self.place() } else { Ok(()) }
    }

    fn place(&mut self) -> Result<()> {
        if self.packed.is_empty() {
            return Ok(());
        }
        let address = self.out.positions.append(&self.packed)?;
        let begin = self.merged.blocks.len() - self.unplaced.len();
        for (block, start) in self.merged.blocks[begin..].iter_mut().zip(self.unplaced.drain(..)) {
            block.placed(address, start);
        }
        self.packed.clear();
        Ok(())
    }

    fn finish(mut self) -> Result<Merged> {
        self.close_block()?;
        self.place()?;
        self.store_refs()?;
        Ok(self.merged)
    }
}
