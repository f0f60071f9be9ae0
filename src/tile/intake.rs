//! The decode's end: records become sorted runs. A run is what one thread holds before it spills:
//! its positions, packed, and its records, both in canonical order.

use std::sync::Arc;
use std::sync::Mutex;

use super::TileKey;
use super::block::{BLOCK, Block};
use super::key::{morton_cmp, morton_prefix};
use super::sieve::Tag;
use super::spill::{PIECE, Pieces, Spill, SpillArea, lock};
use crate::Result;
use crate::budget::{Budget, Lease};
use crate::point::{Bounds, Position};

/// Bytes of index that a run keeps in memory for each of its blocks.
const INDEX_BYTES: u64 = size_of::<Block>() as u64;
/// Packed positions and records are handed to the spill in stretches of about this size.
const STRETCH: usize = 1 << 20;

/// A sorted run: its blocks, and the number of its first record among all records.
#[derive(Debug)]
pub(super) struct Run {
    pub blocks: Vec<Block>,
    pub first_record: u64,
}

/// Sorted runs of a scan while it is decoded.
#[derive(Debug)]
pub struct TileStore {
    pub(super) area: Arc<SpillArea>,
    pub(super) budget: Budget,
    pub(super) stride: usize,
    pub(super) tagged: bool,
    pub(super) positions: Spill,
    pub(super) records: Pieces,
    pub(super) runs: Mutex<Vec<Run>>,
    index: Mutex<Vec<Lease>>,
}

impl TileStore {
    /// An empty store for records of `stride` bytes, each with a tag or none.
    pub fn new(area: &Arc<SpillArea>, budget: &Budget, stride: usize, tagged: bool) -> Self {
        TileStore {
            area: area.clone(),
            budget: budget.clone(),
            stride,
            tagged,
            positions: Spill::new(area, "runs"),
            records: Pieces::new(area, "records", stride),
            runs: Mutex::default(),
            index: Mutex::default(),
        }
    }

    /// Runs stored so far.
    pub fn runs(&self) -> usize {
        lock(&self.runs).len()
    }

    fn add(&self, run: Run) -> Result<()> {
        let bytes = run.blocks.len() as u64 * INDEX_BYTES;
        lock(&self.index).push(self.budget.lease(bytes, "index of the sorted runs")?);
        lock(&self.runs).push(run);
        Ok(())
    }
}

/// One thread's share of the decode: takes records until it is full, then stores them as a run.
#[derive(Debug)]
pub struct Intake<'a> {
    store: &'a TileStore,
    capacity: usize,
    records: Vec<u8>,
    positions: Vec<Position>,
    tags: Vec<u32>,
    order: Vec<(u64, u32)>,
    packed: Vec<u8>,
}

impl<'a> Intake<'a> {
    /// Bytes that an intake holds for each record of `stride` bytes.
    pub fn bytes_per_record(stride: usize, tagged: bool) -> usize {
        let tag = if tagged { size_of::<Tag>() } else { 0 };
        stride + size_of::<Position>() + size_of::<(u64, u32)>() + tag
    }

    /// Bytes that an intake holds whatever its capacity.
    pub fn fixed_bytes(stride: usize) -> usize {
        2 * STRETCH + 2 * PIECE * stride
    }

    /// An intake for runs of up to `capacity` records.
    pub fn new(store: &'a TileStore, capacity: usize) -> Self {
        Intake {
            store,
            capacity,
            records: Vec::with_capacity(capacity * store.stride),
            positions: Vec::with_capacity(capacity),
            tags: Vec::with_capacity(if store.tagged { capacity } else { 0 }),
            order: Vec::with_capacity(capacity),
            packed: Vec::with_capacity(STRETCH + 2 * BLOCK * 28),
        }
    }

    /// Takes one record at its position; its tag counts if the store has tags.
    pub fn push(&mut self, position: Position, record: &[u8], tag: Tag) -> Result<()> {
        if self.positions.len() == self.capacity {
            self.flush()?;
        }
        self.positions.push(position);
        self.records.extend_from_slice(record);
        if self.store.tagged {
            self.tags.push(tag.0);
        }
        Ok(())
    }

    /// Stores what it holds as a run.
    pub fn flush(&mut self) -> Result<()> {
        if self.positions.is_empty() {
            return Ok(());
        }
        self.sort();
        let first_record = self.store.records.reserve(self.positions.len() as u64);
        self.store_records(first_record)?;
        let blocks = self.store_positions()?;
        self.records.clear();
        self.positions.clear();
        self.tags.clear();
        self.store.add(Run { blocks, first_record })
    }

    fn record(&self, i: u32) -> &[u8] {
        let stride = self.store.stride;
        &self.records[i as usize * stride..(i as usize + 1) * stride]
    }

    /// What a run's block holds beside a position, where blocks of distinct positions have copies.
    fn tag(&self, i: u32) -> u32 {
        self.tags.get(i as usize).copied().unwrap_or(1)
    }

    /// Sorts into canonical order: by the upper 21 levels of the run's octree first, which nearly
    /// always decide, then what shares them exactly.
    fn sort(&mut self) {
        let root = TileKey::holding(&Bounds::of(self.positions.iter().copied()));
        let mut order = std::mem::take(&mut self.order);
        order.clear();
        order.extend(
            self.positions
                .iter()
                .enumerate()
                .map(|(i, p)| (morton_prefix(*p, root.level), i as u32)),
        );
        order.sort_unstable();
        for equal in order.chunk_by_mut(|a, b| a.0 == b.0).filter(|equal| equal.len() > 1) {
            equal.sort_unstable_by(|a, b| {
                let (p, q) = (&self.positions[a.1 as usize], &self.positions[b.1 as usize]);
                morton_cmp(p, q)
                    .then_with(|| self.record(a.1).cmp(self.record(b.1)))
                    .then_with(|| self.tag(a.1).cmp(&self.tag(b.1)))
            });
        }
        self.order = order;
    }

    fn store_records(&self, first: u64) -> Result<()> {
        let mut piece = Vec::with_capacity(PIECE * self.store.stride);
        for (n, slots) in self.order.chunks(PIECE).enumerate() {
            piece.clear();
            slots.iter().for_each(|&(_, i)| piece.extend_from_slice(self.record(i)));
            self.store.records.put(first + (n * PIECE) as u64, &piece)?;
        }
        Ok(())
    }

    fn store_positions(&mut self) -> Result<Vec<Block>> {
        let mut blocks = Vec::with_capacity(self.order.len().div_ceil(BLOCK));
        let mut sorted = Vec::with_capacity(BLOCK);
        let mut tags = Vec::with_capacity(BLOCK);
        for stretch in self.order.chunks(STRETCH / 24 / BLOCK * BLOCK) {
            self.packed.clear();
            let begin = blocks.len();
            let mut starts = Vec::new();
            for slots in stretch.chunks(BLOCK) {
                sorted.clear();
                sorted.extend(slots.iter().map(|&(_, i)| self.positions[i as usize]));
                tags.clear();
                tags.extend(slots.iter().map(|&(_, i)| self.tag(i)));
                let (block, start) = Block::pack(&sorted, &tags, &mut self.packed);
                blocks.push(block);
                starts.push(start);
            }
            let address = self.store.positions.append(&self.packed)?;
            for (block, start) in blocks[begin..].iter_mut().zip(starts) {
                block.placed(address, start);
            }
        }
        Ok(blocks)
    }
}
