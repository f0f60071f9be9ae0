//! Outputs in the order of the inputs, of stages that work on tiles.
//!
//! The mill leaves records in canonical order. To sort them all back would be a second sort of the
//! scan; but what their places are is known from the decode. So the input is cut into stretches:
//! while tiles leave their products, each record that is written goes to the list of its stretch, a
//! few kibibytes in memory and the rest in the spill. Behind the last tile a stretch is an item: it
//! is ordered in memory, and the outlet writes one stretch after the other.

use std::sync::{Arc, Mutex};

use super::chunk::{Open, OutputChunk};
use super::encoding::ChunkEncoders;
use super::job::Job;
use super::outlet::{Outlet, finished};
use super::product::RecordEntry;
use super::row::RowLayout;
use crate::budget::Bytes;
use crate::host::lock;
use crate::report::Tally;
use crate::stage::{Sink, SinkSummary};
use crate::store::{RecordState, SealedTiles, Spill, SpillArea, StoredStretch, Tag};
use crate::{Error, Result};

/// Bits of a place in the input that number the records of a part; above them is the part's number.
const RECORD_BITS: u32 = 40;
/// Parts that places can tell apart.
pub const MOST_PARTS: usize = 1 << (u64::BITS - RECORD_BITS);

/// Bytes that all lists hold in memory before they go to the spill, about.
const LISTS_BYTES: usize = 8 << 20;
/// What the list of one stretch holds at least and at most.
const LIST: (usize, usize) = (512, 64 << 10);
/// Stretches that the input is cut into at most, and records that one has at least.
const STRETCHES: u64 = 16_384;
const STRETCH: u64 = 1 << 16;
/// Bytes of an entry of a list, its row aside: its rank, where it is stored, state.
const ENTRY: usize = 8 + 8 + 1;

/// Bytes that a record has in the lists where entries have rows of so many.
pub(crate) fn listed_bytes(row: usize) -> u64 {
    (ENTRY + row) as u64
}

/// The place of record `index` of part `part` in the input.
pub(crate) fn place(part: usize, index: u64) -> u64 {
    (part as u64) << RECORD_BITS | index
}

/// Records of a stretch of an input of so many.
fn stretch_records(records: u64) -> u64 {
    records.div_ceil(STRETCHES).max(STRETCH)
}

fn list_bytes(stretches: usize) -> usize {
    (LISTS_BYTES / stretches.max(1)).clamp(LIST.0, LIST.1)
}

/// Bytes that the lists of an input of so many records hold in memory.
pub(crate) fn lists_bytes(records: u64) -> Bytes {
    let stretches = records.div_ceil(stretch_records(records));
    Bytes::of(stretches, list_bytes(stretches as usize) + size_of::<StretchList>())
}

/// Bytes that a thread holds while it orders stretches whose entries have rows of so many bytes:
/// one at work, and what waits for its turn.
pub(crate) fn ordering_bytes(records: u64, row: usize) -> Bytes {
    let most = records.min(stretch_records(records));
    Bytes::of(most, 3 * (size_of::<Ranked>() + row) + ENTRY + row)
}

/// How many records of the input come before each part's: what a place is counted from.
#[derive(Debug, Default)]
pub(crate) struct Starts {
    before: Vec<u64>,
    records: u64,
}

impl Starts {
    /// Of parts that have so many records each.
    pub fn of(parts: &[u64]) -> Starts {
        let mut records = 0u64;
        let before = parts.iter().map(|&n| {
            records += n;
            records - n
        });
        Starts { before: before.collect(), records }
    }

    fn rank(&self, place: u64) -> Result<u64> {
        let before = self.before.get((place >> RECORD_BITS) as usize);
        let unknown = || Error::internal("a record came from a part that there is not");
        Ok(before.ok_or_else(unknown)? + (place & ((1 << RECORD_BITS) - 1)))
    }
}

/// A record in its stretch of the input.
#[derive(Debug, Clone, Copy)]
struct Ranked {
    rank: u64,
    stored: u64,
    state: RecordState,
    /// Which of the rows of its stretch is its own.
    row: u32,
}

/// The records of a stretch in the order of the input, and their rows.
struct OrderedStretch {
    ranked: Vec<Ranked>,
    rows: Vec<u8>,
}

/// The records of one stretch that were not yet stored, and where the others are.
#[derive(Debug, Default)]
struct StretchList {
    open: Vec<u8>,
    stretches: Vec<StoredStretch>,
}

/// The records that an output gets, by stretches of the input.
pub(crate) struct ByRank {
    /// Which output.
    pub sink: usize,
    layout: RowLayout,
    /// True if it takes what was there before the pass.
    before: bool,
    starts: Arc<Starts>,
    stretch: u64,
    spill: Spill,
    lists: Vec<StretchList>,
    list_bytes: usize,
    /// Records of all stretches.
    pub records: u64,
}

impl ByRank {
    /// Output `sink` without a record.
    pub fn new(
        area: &Arc<SpillArea>,
        sink: usize,
        starts: &Arc<Starts>,
        layout: &RowLayout,
        before: bool,
    ) -> Self {
        let stretch = stretch_records(starts.records);
        let mut lists = Vec::new();
        lists.resize_with(starts.records.div_ceil(stretch) as usize, StretchList::default);
        ByRank {
            sink,
            layout: layout.clone(),
            before,
            starts: starts.clone(),
            stretch,
            spill: Spill::new(area, "ranks"),
            list_bytes: list_bytes(lists.len()),
            lists,
            records: 0,
        }
    }

    /// Takes what becomes of an entry with its row, if it has one; its records are stored and were
    /// read at `places`.
    pub fn take(&mut self, entry: &RecordEntry, places: &[(u64, u64)], row: &[u8]) -> Result<()> {
        let state = if self.before { entry.was } else { entry.now };
        if !state.is_written() {
            return Ok(());
        }
        for &(stored, place) in places {
            let rank = self.starts.rank(place)?;
            let list = self.lists.get_mut((rank / self.stretch) as usize);
            let list =
                list.ok_or_else(|| Error::internal("a record is behind the input's last"))?;
            list.open.extend_from_slice(&rank.to_le_bytes());
            list.open.extend_from_slice(&stored.to_le_bytes());
            list.open.push(state.0);
            self.layout.enter(row, &mut list.open);
            if list.open.len() + ENTRY + self.layout.bytes() > self.list_bytes {
                list.stretches.push(self.spill.store(&list.open)?);
                list.open.clear();
            }
        }
        self.records += places.len() as u64;
        Ok(())
    }

    /// The records of list `number` in the order of the input.
    fn ordered(&self, number: usize) -> Result<OrderedStretch> {
        let mut ordered = OrderedStretch { ranked: Vec::new(), rows: Vec::new() };
        let Some(list) = self.lists.get(number) else { return Ok(ordered) };
        let size = ENTRY + self.layout.bytes();
        let mut bytes = Vec::new();
        for stretch in &list.stretches {
            self.spill.load(stretch, &mut bytes)?;
            bytes.chunks_exact(size).for_each(|item| ordered.push(item));
        }
        list.open.chunks_exact(size).for_each(|item| ordered.push(item));
        ordered.ranked.sort_unstable_by_key(|record| record.rank);
        Ok(ordered)
    }

    /// Writes all records into `sink` on all threads; what it said.
    pub fn write(
        &self,
        job: &Job<'_>,
        tiles: &SealedTiles,
        sink: Box<dyn Sink>,
    ) -> Result<(SinkSummary, Tally)> {
        let encoders = ChunkEncoders::of_one(job, tiles, self.sink, &*sink, false).of_stored();
        let open = Mutex::new(Open::new(0, sink.chunk_points(), &self.layout, false));
        let commit = |stretch: OrderedStretch| -> Result<Vec<OutputChunk>> {
            let (mut open, mut full) = (lock(&open), Vec::new());
            let bytes = self.layout.bytes();
            for Ranked { stored, state, row, .. } in stretch.ranked {
                let (was, now) = (state, state);
                let entry = RecordEntry { number: stored, count: 1, tag: Tag::default(), was, now };
                open.take(&entry, &stretch.rows[row as usize * bytes..][..bytes], &mut full);
            }
            Ok(full)
        };
        let outlet = Outlet::new(vec![sink], job.threads.count(), &commit);
        let stretches = self.lists.len();
        let tallies = job.threads.items(stretches, || outlet.stop()).run(
            || encoders.one(),
            |encoder, number| {
                let records = self.ordered(number)?;
                let count = records.ranked.len() as u64;
                let mut encode = |chunk| encoder.encode(&encoders, &chunk);
                outlet.deliver((number as u64, 0), records, true, &mut encode)?;
                job.advance(count)
            },
            |()| {},
            |mut encoder| {
                outlet.drain(stretches, &mut |chunk| encoder.encode(&encoders, &chunk))?;
                Ok(encoder.tally)
            },
        )?;
        let rest = lock(&open).rest().into_iter().collect();
        let mut encoder = encoders.one();
        let said = finished(outlet.close(rest, &mut |chunk| encoder.encode(&encoders, &chunk))?)?;
        let mut total = encoder.tally;
        tallies.iter().for_each(|tally| total.merge(tally));
        let summary = said.into_iter().next();
        Ok((summary.ok_or_else(|| Error::internal("an output said nothing"))?, total))
    }
}

impl OrderedStretch {
    /// Appends an entry as stored, with its row.
    fn push(&mut self, item: &[u8]) {
        let word = |at: usize| {
            let mut bytes = [0; 8];
            bytes.copy_from_slice(&item[at..at + 8]);
            u64::from_le_bytes(bytes)
        };
        let row = self.ranked.len() as u32;
        let state = RecordState(item[16]);
        self.ranked.push(Ranked { rank: word(0), stored: word(8), state, row });
        self.rows.extend_from_slice(&item[ENTRY..]);
    }
}
