//! The decoded scan: distinct positions in Morton order, an index of tight boxes over them, and the
//! records behind each.
//!
//! It answers three questions: which blocks meet a box, what is nearest to a point, and which bytes
//! the records of these numbers have. Once sealed it does not change, so all threads and all passes
//! read it without locks, and positions, records and columns have one numbering to the end of the
//! run. The index is one tight box a block and boxes of 16 boxes above them, in memory, where half
//! a byte a position buys that no block is read in vain.

use super::Levels;
use super::block::{BLOCK, Block};
use super::emit::MergeOutput;
use super::fetch::{Fetch, groups};
use super::pieces::Pieces;
use super::record::ref_bytes;
use super::spill::Spill;
use crate::budget::{Budget, Bytes, Lease};
use crate::point::{Bounds, PointBatch, Position};
use crate::{Error, Result};

/// Children of an index node.
const FANOUT: usize = 16;

/// All positions of a scan, as the merge leaves them.
#[derive(Debug, Default)]
pub(crate) struct Sequence {
    pub blocks: Vec<Block>,
    pub positions: u64,
    pub records: u64,
    pub bounds: Bounds,
    pub levels: Levels,
    /// For each stretch of record numbers without a gap: its first block, its first number, and how
    /// many records are before it in canonical order.
    pub stretches: Vec<(usize, u64, u64)>,
}

/// The decoded scan, ready for tiles.
#[derive(Debug)]
pub struct SealedTiles {
    sequence: Sequence,
    /// Boxes of 16 blocks, of 16 of those, and so on up to one.
    boxes: Vec<Vec<Bounds>>,
    pub(super) spill: Spill,
    pub(super) refs: Pieces,
    tagged: bool,
    pub(super) records: Pieces,
    pub(super) places: Option<Pieces>,
    index: Lease,
}

/// What reading blocks needs and keeps from call to call.
#[derive(Debug, Default)]
pub struct Reader {
    buffer: Vec<u8>,
    positions: Vec<Position>,
    copies: Vec<u32>,
}

impl Reader {
    /// The positions last read.
    pub fn positions(&self) -> &[Position] {
        &self.positions
    }
}

impl SealedTiles {
    /// Bytes of the index for each block: its entry, and its part of the boxes above it.
    pub(crate) const BYTES_PER_BLOCK: usize = size_of::<Block>() + 8;

    /// Memory that the index of `positions` positions takes, for a plan.
    pub fn index_bytes(positions: u64) -> Bytes {
        Bytes::of(positions.div_ceil(BLOCK as u64), Self::BYTES_PER_BLOCK)
    }

    pub(crate) fn new(
        sequence: Sequence,
        MergeOutput { positions: spill, refs, tagged }: MergeOutput,
        records: Pieces,
        places: Option<Pieces>,
        index: Lease,
    ) -> Self {
        let mut boxes: Vec<Vec<Bounds>> = Vec::new();
        let mut level: Vec<Bounds> = sequence.blocks.iter().map(|b| b.bounds).collect();
        while level.len() > 1 {
            level = level
                .chunks(FANOUT)
                .map(|group| group.iter().fold(Bounds::EMPTY, |all, b| all.union(b)))
                .collect();
            boxes.push(level.clone());
        }
        SealedTiles { sequence, boxes, spill, refs, tagged, records, places, index }
    }

    /// Distinct positions.
    pub fn positions(&self) -> u64 {
        self.sequence.positions
    }

    /// Records.
    pub fn points(&self) -> u64 {
        self.sequence.records
    }

    /// Tight box of all positions.
    pub fn bounds(&self) -> Bounds {
        self.sequence.bounds
    }

    /// Occupied cubes of every side.
    pub fn levels(&self) -> &Levels {
        &self.sequence.levels
    }

    /// How many blocks there are; they are numbered in Morton order.
    pub fn blocks(&self) -> usize {
        self.sequence.blocks.len()
    }

    /// Block `index`.
    pub fn block(&self, index: usize) -> &Block {
        &self.sequence.blocks[index]
    }

    /// True if records have tags.
    pub fn is_tagged(&self) -> bool {
        self.tagged
    }

    /// The budget that the scan's index is leased from.
    pub(crate) fn budget(&self) -> &Budget {
        self.index.budget()
    }

    /// How many records are before block `index` in canonical order. Within a block, numbers of
    /// records follow one another; from block to block they may not.
    pub fn rank_of_block(&self, index: usize) -> u64 {
        let stretches = &self.sequence.stretches;
        let stretch = stretches.partition_point(|stretch| stretch.0 <= index);
        let number = self.block(index).first_record;
        let of = stretch.checked_sub(1).map(|at| stretches[at]);
        of.map_or(0, |(_, first, before)| before + (number - first))
    }

    /// Replaces `tags` by those of `count` records from number `first` on, 4 bytes each; by nothing
    /// if records have none.
    pub(crate) fn tags(
        &self,
        first: u64,
        count: usize,
        buffer: &mut Vec<u8>,
        tags: &mut Vec<u8>,
    ) -> Result<()> {
        tags.clear();
        if !self.tagged {
            return Ok(());
        }
        self.refs.each(first, count as u64, buffer, |_, refs| {
            refs.chunks_exact(ref_bytes(true))
                .for_each(|entry| tags.extend_from_slice(&entry[8..]));
            Ok(())
        })
    }

    /// Reads block `index`: its positions and how many records share each.
    pub fn read<'r>(
        &self,
        index: usize,
        reader: &'r mut Reader,
    ) -> Result<(&'r [Position], &'r [u32])> {
        reader.positions.clear();
        reader.copies.clear();
        self.sequence.blocks[index].read(
            &self.spill,
            &mut reader.buffer,
            &mut reader.positions,
            Some(&mut reader.copies),
        )?;
        Ok((&reader.positions, &reader.copies))
    }

    /// Calls `visit` with the number of every block whose box meets `region`, in Morton order.
    pub fn blocks_meeting(
        &self,
        region: &Bounds,
        mut visit: impl FnMut(usize) -> Result<()>,
    ) -> Result<()> {
        self.descend(self.boxes.len(), 0, region, &mut visit)
    }

    /// Node `node` of height `height`; nodes of height 0 are blocks.
    fn descend(
        &self,
        height: usize,
        node: usize,
        region: &Bounds,
        visit: &mut impl FnMut(usize) -> Result<()>,
    ) -> Result<()> {
        if !self.node_box(height, node).is_some_and(|bounds| bounds.meets(region)) {
            return Ok(());
        }
        if height == 0 {
            return visit(node);
        }
        (node * FANOUT..(node + 1) * FANOUT)
            .try_for_each(|child| self.descend(height - 1, child, region, visit))
    }

    fn node_box(&self, height: usize, node: usize) -> Option<&Bounds> {
        match height.checked_sub(1) {
            None => self.sequence.blocks.get(node).map(|block| &block.bounds),
            Some(above) => self.boxes[above].get(node),
        }
    }

    /// The index node above all blocks: its height and number.
    pub(crate) fn root(&self) -> (usize, usize) {
        (self.boxes.len(), 0)
    }

    /// The nodes right below one, as height and number; some may not exist.
    pub(crate) fn children(
        &self,
        (height, node): (usize, usize),
    ) -> impl Iterator<Item = (usize, usize)> + use<> {
        (node * FANOUT..(node + 1) * FANOUT).map(move |child| (height - 1, child))
    }

    /// Squared distance of `p` to a node's tight box; None if there is no such node.
    pub(crate) fn node_distance2(
        &self,
        (height, node): (usize, usize),
        p: Position,
    ) -> Option<u128> {
        self.node_box(height, node).map(|bounds| bounds.distance2(p))
    }

    /// True if `region` holds more than `limit` positions; reads blocks only where their boxes
    /// leave it open.
    pub fn holds_more(&self, region: &Bounds, limit: u64, reader: &mut Reader) -> Result<bool> {
        let (mut inside, mut open) = (0, Vec::new());
        let mut open_count = 0;
        self.blocks_meeting(region, |b| {
            let block = self.block(b);
            if region.holds(&block.bounds) {
                inside += block.len() as u64;
            } else {
                open_count += block.len() as u64;
                open.push(b);
            }
            Ok(())
        })?;
        if inside > limit || inside + open_count <= limit {
            return Ok(inside > limit);
        }
        for b in open {
            let (positions, _) = self.read(b, reader)?;
            inside += positions.iter().filter(|p| region.contains(**p)).count() as u64;
            if inside > limit {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Positions in `region`, exactly.
    pub fn count(&self, region: &Bounds, reader: &mut Reader) -> Result<u64> {
        let mut count = 0;
        self.blocks_meeting(region, |b| {
            let block = self.block(b);
            if region.holds(&block.bounds) {
                count += block.len() as u64;
            } else {
                let (positions, _) = self.read(b, reader)?;
                count += positions.iter().filter(|p| region.contains(**p)).count() as u64;
            }
            Ok(())
        })?;
        Ok(count)
    }

    /// Number of the block that has the position with this number.
    pub fn block_with(&self, position: u64) -> usize {
        let blocks = &self.sequence.blocks;
        blocks.partition_point(|block| block.first_position <= position).saturating_sub(1)
    }

    /// Appends to `batch` the records with the given numbers (see [`Block::first_record`]), in the
    /// order given, which must be ascending.
    pub fn fetch(&self, numbers: &[u64], fetch: &mut Fetch, batch: &mut PointBatch) -> Result<()> {
        fetch.sources.clear();
        for (slot, &number) in numbers.iter().enumerate() {
            let source = fetch.ref_of(&self.refs, self.tagged, number)?;
            fetch.sources.push((source, slot as u32));
        }
        self.gather(fetch, batch)
    }

    /// Appends to `batch` the records that are stored at `sources`, in the order given.
    pub fn fetch_stored(
        &self,
        sources: &[u64],
        fetch: &mut Fetch,
        batch: &mut PointBatch,
    ) -> Result<()> {
        fetch.sources.clear();
        fetch.sources.extend(sources.iter().copied().zip(0..));
        self.gather(fetch, batch)
    }

    /// Appends for each of the records with the given numbers, which must be ascending, where it is
    /// stored and its place in the input.
    pub fn places(
        &self,
        numbers: &[u64],
        fetch: &mut Fetch,
        places: &mut Vec<(u64, u64)>,
    ) -> Result<()> {
        let Some(stored) = &self.places else {
            return Err(Error::internal("places in the input are asked for and were not kept"));
        };
        fetch.sources.clear();
        for (slot, &number) in numbers.iter().enumerate() {
            let source = fetch.ref_of(&self.refs, self.tagged, number)?;
            fetch.sources.push((source, slot as u32));
        }
        fetch.sources.sort_unstable();
        let begin = places.len();
        places.resize(begin + numbers.len(), (0, 0));
        for (group, (first, last)) in groups(&fetch.sources) {
            let count = (last - first + 1) as usize;
            let (words, _) = stored.get(first, count, &mut fetch.records)?.as_chunks::<8>();
            for &(source, slot) in group {
                let place = u64::from_le_bytes(words[(source - first) as usize]);
                places[begin + slot as usize] = (source, place);
            }
        }
        Ok(())
    }

    /// Appends to `batch` the records that `fetch` names, each at its slot.
    fn gather(&self, fetch: &mut Fetch, batch: &mut PointBatch) -> Result<()> {
        fetch.sources.sort_unstable();
        let count = fetch.sources.len();
        let stride = batch.schema().stride;
        let start = batch.len();
        if start + count > batch.capacity() {
            return Err(Error::internal("more records fetched than the batch takes"));
        }
        let mut records =
            batch.refill_after(start, count).chunks_exact_mut(stride).collect::<Vec<_>>();
        for (group, (first, last)) in groups(&fetch.sources) {
            let stored =
                self.records.get(first, (last - first + 1) as usize, &mut fetch.records)?;
            for &(source, slot) in group {
                let at = (source - first) as usize * stride;
                records[slot as usize].copy_from_slice(&stored[at..at + stride]);
            }
        }
        Ok(())
    }
}
