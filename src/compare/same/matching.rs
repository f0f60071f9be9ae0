//! Records in bins are matched: which does one scan alone have, and which of these are at a
//! position where the other scan has another record?
//!
//! Equal records have equal keys and come into one bin, so that a bin is looked at alone: first how
//! often either scan has each key, then whose records are too many. These go into bins by their
//! position, where what is left of both scans is paired.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::sync::{Arc, Mutex};

use super::bins::RecordBins;
use super::keys::ComparedSchemas;
use super::told::{ChangedPlace, OnlyRecords, PLACES, RecordPlace};
use crate::budget::whole_mebibytes;
use crate::engine::Watch;
use crate::host::{Threads, lock};
use crate::store::SpillArea;
use crate::{Error, Result};

/// Bytes of an entry of records that one scan alone has, before the record: its number, and how
/// many such records there are.
const BEFORE: usize = 2 * size_of::<u64>();
/// Bytes of a key of a bin in a table that is made as large as it gets.
pub const KEY_BYTES: usize = 2 * (size_of::<(u128, KeyOccurrences)>() + 1) * 8 / 7;
/// Bytes besides its entry of a record that is paired.
pub const PAIR_BYTES: usize = 2 * size_of::<IndexedRecord>();

/// The records of two scans in bins by their keys.
pub struct MatchRecords<'a> {
    pub compared: &'a ComparedSchemas,
    pub sides: [RecordBins; 2],
    pub area: Arc<SpillArea>,
    /// What of the memory is for it.
    pub memory: &'a BinMemory,
    pub threads: usize,
    pub watch: &'a dyn Watch,
}

/// What bins may take.
#[derive(Debug, Clone, Copy)]
pub struct BinMemory {
    /// Bytes of one scan that wait to be stored, at most.
    pub waiting: u64,
    /// Bytes that each thread has for a bin.
    pub bin: u64,
}

impl BinMemory {
    /// Bytes that a bin takes at least, if there are enough of them: what stays near the processor.
    const NEAR: u64 = 3 << 20;
    /// Bytes of a bin that wait to be stored, at least.
    const STRETCH: u64 = 8 << 10;

    /// What a bin is to hold where all hold `bytes`: as little as is near to the processor, unless
    /// there were more bins then than can be filled at once.
    pub fn bytes_of_bin(&self, bytes: u64) -> u64 {
        let near = BinMemory::NEAR.min(self.bin);
        near.max(bytes / (self.waiting / BinMemory::STRETCH).max(1) + 1)
    }
}

/// Makes no hashes of keys, which are such.
#[derive(Debug, Default)]
struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.0 = self.0.rotate_left(8) ^ u64::from(*byte));
    }

    fn write_u128(&mut self, key: u128) {
        self.0 = key as u64;
    }
}

/// How often either scan has each key of a bin.
type KeyTable = HashMap<u128, KeyOccurrences, BuildHasherDefault<KeyHasher>>;

/// What the matching came to.
#[derive(Debug, Default)]
pub struct MatchedRecords {
    pub only: [OnlyRecords; 2],
    pub pairs: u64,
    /// For each dimension that both scans have in how many pairs it differs, and last in how many
    /// none does.
    pub differ: Vec<u64>,
    pub places: Vec<ChangedPlace>,
}

/// How often either scan has a key, and the number of the first record that has it.
#[derive(Debug, Clone, Copy)]
struct KeyOccurrences {
    counts: [u64; 2],
    firsts: [u64; 2],
}

impl Default for KeyOccurrences {
    fn default() -> Self {
        KeyOccurrences { counts: [0; 2], firsts: [u64::MAX; 2] }
    }
}

/// A record that is paired: its place, its number, and its entry.
type IndexedRecord = (u128, u64, u32);

impl MatchRecords<'_> {
    /// Matches all bins. `may_pair` says that both scans may have records of their own.
    pub fn run(&self, may_pair: bool) -> Result<MatchedRecords> {
        let matched = Mutex::new(MatchedRecords::default());
        let left = may_pair.then(|| self.left_bins()).map(Mutex::new);
        self.each_bin(self.sides[0].bins(), |bin| self.match_bin(bin, &matched, left.as_ref()))?;
        let has_both = lock(&matched).only.iter().all(|only| only.count > 0);
        match left {
            None if has_both => return self.run(true),
            Some(left) if has_both => {
                let left = left.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
                self.each_bin(left[0].bins(), |bin| self.pair_bin(bin, &left, &matched))?;
            }
            _ => {}
        }
        Ok(matched.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner))
    }

    fn each_bin(&self, bins: usize, work: impl Fn(usize) -> Result<()> + Sync) -> Result<()> {
        Threads::start(self.threads, |threads| {
            let item = |(): &mut (), bin: usize| match self.watch.cancelled() {
                true => Err(Error::interrupted()),
                false => work(bin),
            };
            threads.items(bins, || ()).run(|| (), item, |()| (), |()| Ok(()))?;
            Ok(())
        })
    }

    /// Bins by position for what either scan alone has.
    fn left_bins(&self) -> [RecordBins; 2] {
        let all = |side: &RecordBins| (0..side.bins()).map(|bin| side.entries(bin)).sum::<u64>();
        let records: u64 = self.sides.iter().map(all).sum();
        let [a, b] = [0, 1].map(|side| BEFORE + self.compared.sides[side].stride);
        let bytes = records.saturating_mul((a.max(b) + PAIR_BYTES) as u64);
        let bins = (bytes / self.memory.bytes_of_bin(bytes) + 1) as usize;
        [a, b].map(|entry| RecordBins::new(&self.area, entry, bins, self.memory.waiting))
    }

    fn match_bin(
        &self,
        bin: usize,
        matched: &Mutex<MatchedRecords>,
        left: Option<&Mutex<[RecordBins; 2]>>,
    ) -> Result<()> {
        let entries: u64 = self.sides.iter().map(|side| side.entries(bin)).sum();
        // More are copies of each other.
        let most = entries.min(self.memory.bin / KEY_BYTES as u64);
        let mut keys = KeyTable::with_capacity_and_hasher(most as usize, Default::default());
        let mut buffer = Vec::new();
        for (side, bins) in self.sides.iter().enumerate() {
            bins.each(bin, &mut buffer, |entry| {
                let (number, record) = number_of(entry)?;
                let found = keys.entry(self.compared.sides[side].key(record)).or_default();
                found.counts[side] += 1;
                found.firsts[side] = found.firsts[side].min(number);
                Ok(())
            })?;
            self.watch.advance(bins.entries(bin));
        }
        keys.retain(|_, found| found.counts[0] != found.counts[1]);
        if keys.is_empty() {
            return Ok(());
        }
        let mut only = [OnlyRecords::default(), OnlyRecords::default()];
        for (side, bins) in self.sides.iter().enumerate() {
            let of_side = &self.compared.sides[side];
            bins.each(bin, &mut buffer, |entry| {
                let (number, record) = number_of(entry)?;
                let Some(found) = keys.get(&of_side.key(record)) else { return Ok(()) };
                let more = found.counts[side].saturating_sub(found.counts[1 - side]);
                if more == 0 || found.firsts[side] != number {
                    return Ok(());
                }
                only[side].count += more;
                only[side].offer(RecordPlace { number, at: of_side.world(record) });
                let Some(left) = left else { return Ok(()) };
                let left = &mut lock(left)[side];
                let into = bin_of(of_side.place_key(record), left.bins());
                left.push(into, &[&number.to_le_bytes(), &more.to_le_bytes(), record])
            })?;
        }
        let all = &mut lock(matched).only;
        all.iter_mut().zip(only).for_each(|(all, one)| all.merge(one));
        Ok(())
    }

    fn pair_bin(
        &self,
        bin: usize,
        left: &[RecordBins; 2],
        matched: &Mutex<MatchedRecords>,
    ) -> Result<()> {
        if left.iter().any(|side| side.entries(bin) == 0) {
            return Ok(());
        }
        self.check_memory(bin, left)?;
        let mut buffer = Vec::new();
        let mut load = |side: usize| self.load(bin, side, &left[side], &mut buffer);
        let (a, b) = (load(0)?, load(1)?);
        let mut found = MatchedRecords::default();
        let (mut i, mut j) = (0, 0);
        let (mut of_a, mut of_b) = (a.more(0), b.more(0));
        while let (Some(x), Some(y)) = (a.index.get(i), b.index.get(j)) {
            if x.0 == y.0 {
                let pairs = of_a.min(of_b);
                self.pair([&a, &b], [x, y], pairs, &mut found);
                (of_a, of_b) = (of_a - pairs, of_b - pairs);
            }
            if x.0 < y.0 || x.0 == y.0 && of_a == 0 {
                i += 1;
                of_a = a.more(i);
            }
            if y.0 < x.0 || x.0 == y.0 && of_b == 0 {
                j += 1;
                of_b = b.more(j);
            }
        }
        lock(matched).merge(found);
        Ok(())
    }

    fn check_memory(&self, bin: usize, left: &[RecordBins; 2]) -> Result<()> {
        let bytes = |side: usize| {
            let entry = BEFORE + self.compared.sides[side].stride;
            left[side].entries(bin).saturating_mul((entry + PAIR_BYTES) as u64)
        };
        let bytes = bytes(0).saturating_add(bytes(1));
        if bytes <= self.memory.bin {
            return Ok(());
        }
        let told = "too many records that differ are at one position to be compared in memory";
        let enough = whole_mebibytes(bytes.saturating_mul(4 * self.threads as u64 + 1));
        Err(Error::memory(told).help(format!("give `run.memory = \"{enough}\"` or more")))
    }

    fn load(
        &self,
        bin: usize,
        side: usize,
        bins: &RecordBins,
        buffer: &mut Vec<u8>,
    ) -> Result<LeftRecords> {
        let keys = &self.compared.sides[side];
        let entry = BEFORE + keys.stride;
        let mut bytes = Vec::with_capacity(bins.entries(bin) as usize * entry);
        let mut index: Vec<IndexedRecord> = Vec::with_capacity(bins.entries(bin) as usize);
        bins.each(bin, buffer, |one| {
            let (number, rest) = number_of(one)?;
            let record = rest.get(BEFORE - 8..).ok_or_else(short)?;
            index.push((keys.place_key(record), number, index.len() as u32));
            bytes.extend_from_slice(one);
            Ok(())
        })?;
        index.sort_unstable();
        Ok(LeftRecords { bytes, index, entry })
    }

    /// Enters a pair, or several of the same.
    fn pair(
        &self,
        [a, b]: [&LeftRecords; 2],
        [x, y]: [&IndexedRecord; 2],
        pairs: u64,
        found: &mut MatchedRecords,
    ) {
        let records = [a.record(x), b.record(y)];
        let shared = self.compared.names().count();
        found.differ.resize(shared + 1, 0);
        let differ = &mut found.differ;
        if !self.compared.difference(records, |n| differ[n] += pairs) {
            found.differ[shared] += pairs;
        }
        found.pairs += pairs;
        let at = self.compared.sides[0].world(records[0]);
        offer(&mut found.places, ChangedPlace { first: x.1, second: y.1, at }, changed_order);
    }
}

/// Records that one scan alone has, by their places and then their numbers.
struct LeftRecords {
    bytes: Vec<u8>,
    index: Vec<IndexedRecord>,
    entry: usize,
}

impl LeftRecords {
    /// How many of the record at a place of the index are left.
    fn more(&self, at: usize) -> u64 {
        let Some((_, _, entry)) = self.index.get(at) else { return 0 };
        let begin = *entry as usize * self.entry + 8;
        let bytes = self.bytes.get(begin..).and_then(|rest| rest.first_chunk::<8>());
        bytes.map_or(0, |bytes| u64::from_le_bytes(*bytes))
    }

    fn record(&self, (_, _, entry): &IndexedRecord) -> &[u8] {
        let begin = *entry as usize * self.entry;
        &self.bytes[begin + BEFORE..begin + self.entry]
    }
}

/// The number of an entry, and what follows it.
fn number_of(entry: &[u8]) -> Result<(u64, &[u8])> {
    let (number, rest) = entry.split_first_chunk::<8>().ok_or_else(short)?;
    Ok((u64::from_le_bytes(*number), rest))
}

fn short() -> Error {
    Error::internal("an entry of a bin is cut short")
}

/// The one of so many bins that a place comes into.
fn bin_of(key: u128, bins: usize) -> usize {
    (((key >> 64) * bins as u128) >> 64) as usize
}

/// Enters one of the first, if it is.
fn offer<T>(all: &mut Vec<T>, one: T, order: impl Fn(&T) -> (u64, u64)) {
    let at = all.partition_point(|other| order(other) <= order(&one));
    if at < PLACES {
        all.insert(at, one);
        all.truncate(PLACES);
    }
}

fn changed_order(place: &ChangedPlace) -> (u64, u64) {
    (place.first, place.second)
}

impl OnlyRecords {
    fn offer(&mut self, place: RecordPlace) {
        offer(&mut self.places, place, |place| (place.number, 0));
    }

    fn merge(&mut self, other: OnlyRecords) {
        self.count += other.count;
        other.places.into_iter().for_each(|place| self.offer(place));
    }
}

impl MatchedRecords {
    fn merge(&mut self, other: MatchedRecords) {
        self.pairs += other.pairs;
        self.differ.resize(self.differ.len().max(other.differ.len()), 0);
        self.differ.iter_mut().zip(other.differ).for_each(|(all, one)| *all += one);
        let mut enter = |place| offer(&mut self.places, place, changed_order);
        other.places.into_iter().for_each(&mut enter);
    }
}
