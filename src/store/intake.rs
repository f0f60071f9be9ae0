//! The decode's end: records become sorted runs. A run is what one thread holds before it spills:
//! its positions, packed, and its records, both in canonical order.
//!
//! Every thread fills and sorts a run of its own, so the decode needs no order among threads and no
//! lock but for a list. Where a run begins and ends depends on threads and memory, and decides
//! nothing: the merge orders records of one position by their bytes.

use std::sync::Arc;
use std::sync::Mutex;

use super::block::{BLOCK, Block};
use super::gather::gather;
use super::order::{RunOrder, SortedIndices};
use super::pieces::{PIECE, Pieces};
use super::record::Tag;
use super::spill::{Spill, SpillArea};
use crate::Result;
use crate::budget::{Budget, Bytes, Lease};
use crate::host::threads::lock;
use crate::point::Position;

/// Packed positions and records are handed to the spill in stretches of about this size.
const STRETCH: usize = 1 << 20;

/// A sorted run: its blocks, and the number of its first record among all records.
#[derive(Debug)]
pub(crate) struct SortedRun {
    pub blocks: Vec<Block>,
    pub first_record: u64,
}

/// Sorted runs of a scan while it is decoded.
#[derive(Debug)]
pub struct TileStore {
    pub(crate) area: Arc<SpillArea>,
    pub(crate) budget: Budget,
    pub(crate) stride: usize,
    pub(crate) tagged: bool,
    pub(crate) positions: Spill,
    pub(crate) records: Pieces,
    /// The place in the input of each record, by the same numbers, if an output asks for it.
    pub(crate) places: Option<Pieces>,
    pub(crate) runs: Mutex<Vec<SortedRun>>,
    index: Mutex<Lease>,
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
            places: None,
            runs: Mutex::default(),
            index: Mutex::new(budget.open("index of the sorted runs")),
        }
    }

    /// The same store, which keeps the place in the input of each record.
    #[must_use]
    pub fn with_places(self) -> Self {
        let places = Some(Pieces::new(&self.area, "places", size_of::<u64>()));
        TileStore { places, ..self }
    }

    /// Runs stored so far.
    pub fn runs(&self) -> usize {
        lock(&self.runs).len()
    }

    fn add(&self, run: SortedRun) -> Result<()> {
        lock(&self.index).grow(Bytes::of(run.blocks.len() as u64, size_of::<Block>()).0)?;
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
    places: Vec<u64>,
    next_place: u64,
    order: RunOrder,
    packed: Vec<u8>,
}

impl<'a> Intake<'a> {
    /// Bytes that an intake holds for each record of `stride` bytes.
    pub fn bytes_per_record(stride: usize, tagged: bool, placed: bool) -> Bytes {
        let tag = if tagged { size_of::<Tag>() } else { 0 };
        let place = if placed { size_of::<u64>() } else { 0 };
        Bytes::from(stride) + Bytes::from(size_of::<Position>() + RunOrder::BYTES + tag + place)
    }

    /// Bytes that an intake holds whatever its capacity.
    pub fn fixed_bytes(stride: usize) -> Bytes {
        Bytes::of(2 * PIECE as u64, stride) + Bytes::of(2, STRETCH)
    }

    /// An intake for runs of up to `capacity` records.
    pub fn new(store: &'a TileStore, capacity: usize) -> Self {
        Intake {
            store,
            capacity,
            records: Vec::with_capacity(capacity * store.stride),
            positions: Vec::with_capacity(capacity),
            tags: Vec::with_capacity(if store.tagged { capacity } else { 0 }),
            places: Vec::with_capacity(if store.places.is_some() { capacity } else { 0 }),
            next_place: 0,
            order: RunOrder::with_capacity(capacity),
            packed: Vec::with_capacity(STRETCH + 2 * BLOCK * Block::BYTES_PER_POSITION),
        }
    }

    /// Says the place in the input of the record that is taken next; those behind it have the next.
    pub fn place(&mut self, place: u64) {
        self.next_place = place;
    }

    /// Takes one record at its position; its tag counts if the store has tags.
    pub fn push(&mut self, position: Position, record: &[u8], tag: Tag) -> Result<()> {
        self.take(&[position], record, &[tag])
    }

    /// Takes records, one after the other, at their positions; their tags count if the store has
    /// tags.
    pub fn take(
        &mut self,
        mut positions: &[Position],
        mut records: &[u8],
        mut tags: &[Tag],
    ) -> Result<()> {
        while !positions.is_empty() {
            if self.positions.len() == self.capacity {
                self.flush()?;
            }
            let now = positions.len().min(self.capacity - self.positions.len());
            let (head, rest) = positions.split_at(now);
            self.positions.extend_from_slice(head);
            positions = rest;
            if self.store.places.is_some() {
                let end = self.next_place + now as u64;
                self.places.extend(self.next_place..end);
                self.next_place = end;
            }
            let (head, rest) = records.split_at(now * self.store.stride);
            self.records.extend_from_slice(head);
            records = rest;
            if self.store.tagged {
                let (head, rest) = tags.split_at(now);
                self.tags.extend(head.iter().map(|tag| tag.0));
                tags = rest;
            }
        }
        Ok(())
    }

    /// Stores what it holds as a run.
    pub fn flush(&mut self) -> Result<()> {
        if self.positions.is_empty() {
            return Ok(());
        }
        let (store, records, tags, places) = (self.store, &self.records, &self.tags, &self.places);
        let equal = |a: usize, b: usize| {
            let record = |i: usize| &records[i * store.stride..(i + 1) * store.stride];
            let tagged = || tags.get(a).cmp(&tags.get(b));
            let placed = || places.get(a).cmp(&places.get(b));
            record(a).cmp(record(b)).then_with(tagged).then_with(placed)
        };
        let order = self.order.sort(&self.positions, &equal);
        let first_record = store.records.reserve(order.len() as u64)?;
        store_records(store, order, records, first_record)?;
        if let Some(stored) = &store.places {
            store_places(stored, order, &self.places, first_record)?;
            self.places.clear();
        }
        let blocks = store_positions(store, order, &self.positions, tags, &mut self.packed)?;
        self.records.clear();
        self.positions.clear();
        self.tags.clear();
        store.add(SortedRun { blocks, first_record })
    }
}

/// Stores `records` in `order`, numbered from `first` on.
fn store_records(
    store: &TileStore,
    order: SortedIndices<'_>,
    records: &[u8],
    first: u64,
) -> Result<()> {
    let mut piece = Vec::with_capacity(PIECE * store.stride);
    let numbers = (first..).step_by(PIECE);
    for (number, slots) in numbers.zip(order.chunks(PIECE)) {
        piece.clear();
        gather(records, store.stride, slots.indices(), &mut piece);
        store.records.put(number, &piece)?;
    }
    Ok(())
}

/// Stores `places` in `order`, numbered from `first` on.
fn store_places(
    stored: &Pieces,
    order: SortedIndices<'_>,
    places: &[u64],
    first: u64,
) -> Result<()> {
    stored.reserve_below(first + order.len() as u64)?;
    let mut piece = Vec::with_capacity(PIECE * size_of::<u64>());
    for (number, slots) in (first..).step_by(PIECE).zip(order.chunks(PIECE)) {
        piece.clear();
        slots.indices().for_each(|i| piece.extend_from_slice(&places[i].to_le_bytes()));
        stored.put(number, &piece)?;
    }
    Ok(())
}

/// Stores `positions` in `order` as blocks; `packed` is memory to work in. Where blocks of distinct
/// positions have copies, those of a run have tags.
fn store_positions(
    store: &TileStore,
    order: SortedIndices<'_>,
    positions: &[Position],
    tags: &[u32],
    packed: &mut Vec<u8>,
) -> Result<Vec<Block>> {
    let mut blocks = Vec::with_capacity(order.len().div_ceil(BLOCK));
    let (mut of_block, mut tags_of_block) = (Vec::with_capacity(BLOCK), Vec::with_capacity(BLOCK));
    for stretch in order.chunks(STRETCH / 24 / BLOCK * BLOCK) {
        packed.clear();
        let begin = blocks.len();
        let mut starts = Vec::new();
        for slots in stretch.chunks(BLOCK) {
            of_block.clear();
            of_block.extend(slots.indices().map(|i| positions[i]));
            tags_of_block.clear();
            if store.tagged {
                tags_of_block.extend(slots.indices().map(|i| tags[i]));
            }
            let (block, start) = Block::pack(&of_block, &tags_of_block, packed);
            blocks.push(block);
            starts.push(start);
        }
        let address = store.positions.append(packed)?;
        for (block, start) in blocks[begin..].iter_mut().zip(starts) {
            block.placed(address, start, packed);
        }
    }
    Ok(blocks)
}
