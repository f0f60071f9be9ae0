//! The second look at two scans that differ: records of buckets that are not equal go into bins,
//! and where one scan may be a part of the other, its keys are followed through it in order.

use std::sync::{Arc, Mutex};

use super::bins::RecordBins;
use super::keys::SideKeys;
use super::looked::RecordLook;
use super::sums::bucket_of;
use super::told::RecordPlace;
use crate::host::lock;
use crate::point::{Chooser, PointBatch};
use crate::store::{Spill, SpillArea, StoredStretch};
use crate::{Error, Result};

/// Bytes of a key.
const KEY: usize = size_of::<u128>();
/// Bytes of a place.
const PLACE: usize = size_of::<[f64; 3]>();
/// Bytes before the record of an entry: its bin, and its number in its stretch.
const BEFORE: usize = size_of::<u32>() + size_of::<u32>();

/// The bin of a bucket whose records are not looked at again.
pub const NO_BIN: u32 = u32::MAX;

/// The keys of the smaller of two scans, in order, and how far they were met in the larger one.
#[derive(Debug)]
pub struct FollowedKeys {
    spill: Spill,
    stored: Vec<StoredStretch>,
    records: u64,
    /// The stretch that comes next, the keys of the one before, and how many of them were met.
    next: usize,
    open: Vec<u8>,
    met_of_open: usize,
    met: u64,
    /// Where the larger scan first has another record than the smaller one at the same place of
    /// their order.
    pub first_other: Option<RecordPlace>,
}

impl FollowedKeys {
    /// No keys yet.
    pub fn new(area: &Arc<SpillArea>) -> FollowedKeys {
        FollowedKeys {
            spill: Spill::new(area, "order"),
            stored: Vec::new(),
            records: 0,
            next: 0,
            open: Vec::new(),
            met_of_open: 0,
            met: 0,
            first_other: None,
        }
    }

    /// True if all keys were met, in their order.
    pub fn is_met(&self) -> bool {
        self.met == self.records
    }

    fn store(&mut self, keys: &[u8]) -> Result<()> {
        if !keys.is_empty() {
            self.stored.push(self.spill.store(keys)?);
            self.records += (keys.len() / KEY) as u64;
        }
        Ok(())
    }

    /// The key that is to be met next.
    fn wanted(&mut self) -> Result<Option<&[u8]>> {
        if self.met_of_open * KEY == self.open.len() {
            let Some(stretch) = self.stored.get(self.next) else { return Ok(None) };
            self.spill.load(stretch, &mut self.open)?;
            self.next += 1;
            self.met_of_open = 0;
        }
        Ok(self.open.get(self.met_of_open * KEY..(self.met_of_open + 1) * KEY))
    }

    /// Meets record `number` of the larger scan.
    fn meet(&mut self, number: u64, key: &[u8], place: &[u8]) -> Result<()> {
        let is_wanted = self.wanted()?.is_some_and(|wanted| wanted == key);
        if is_wanted {
            self.met_of_open += 1;
            self.met += 1;
        } else if self.first_other.is_none() {
            let mut axes = place.as_chunks::<8>().0.iter().map(|axis| f64::from_le_bytes(*axis));
            let at = [0; 3].map(|_| axes.next().unwrap_or(f64::NAN));
            self.first_other = Some(RecordPlace { number, at });
        }
        Ok(())
    }
}

/// What is done with the keys of a scan in order.
#[derive(Debug, Clone)]
pub enum Following {
    /// Nothing.
    None,
    /// They are stored: the scan is the smaller one.
    Stored(Arc<Mutex<FollowedKeys>>),
    /// They are met: the scan is the larger one, or as large.
    Met(Arc<Mutex<FollowedKeys>>),
}

/// Puts records into bins.
pub struct SortRecords {
    keys: Arc<SideKeys>,
    chosen: Option<Chooser>,
    /// The bin of each bucket.
    bins: Arc<Vec<u32>>,
    following: Following,
    sorted: Mutex<SortedSide>,
}

/// What is sorted of a scan.
struct SortedSide {
    bins: RecordBins,
    records: u64,
}

impl SortRecords {
    /// Bytes of the entry of a record of `stride` bytes.
    pub fn entry(stride: usize) -> usize {
        size_of::<u64>() + stride
    }

    /// Puts the records that are `chosen` into `into`, each into that of its bucket.
    pub fn new(
        keys: Arc<SideKeys>,
        chosen: Option<Chooser>,
        bins: Arc<Vec<u32>>,
        into: RecordBins,
        following: Following,
    ) -> SortRecords {
        let sorted = Mutex::new(SortedSide { bins: into, records: 0 });
        SortRecords { keys, chosen, bins, following, sorted }
    }

    /// The bins with all records.
    pub fn into_bins(self) -> RecordBins {
        self.sorted.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner).bins
    }

    fn place_bytes(&self) -> usize {
        if matches!(self.following, Following::Met(_)) { PLACE } else { 0 }
    }

    fn follow(&self, first: u64, keys: &[u8], places: &[u8]) -> Result<()> {
        match &self.following {
            Following::None => Ok(()),
            Following::Stored(followed) => lock(followed).store(keys),
            Following::Met(followed) => {
                let followed = &mut *lock(followed);
                let all = keys.chunks_exact(KEY).zip(places.chunks_exact(PLACE));
                let mut numbered = (first..).zip(all);
                numbered.try_for_each(|(number, (key, place))| followed.meet(number, key, place))
            }
        }
    }
}

impl RecordLook for SortRecords {
    fn look(&self, batch: &PointBatch, found: &mut Vec<u8>) -> Result<()> {
        let follows = !matches!(self.following, Following::None);
        let (mut keys, mut places, mut count) = (Vec::new(), Vec::new(), 0u32);
        found.extend_from_slice(&[0; 4]);
        let mut entries = Vec::new();
        for record in batch.iter() {
            if self.chosen.as_ref().is_some_and(|chosen| !chosen.holds(record)) {
                continue;
            }
            let key = self.keys.key(record);
            if follows {
                keys.extend_from_slice(&key.to_le_bytes());
            }
            if self.place_bytes() > 0 {
                let world = self.keys.world(record);
                places.extend(world.into_iter().flat_map(f64::to_le_bytes));
            }
            let bin = self.bins[bucket_of(key)];
            if bin != NO_BIN {
                entries.extend_from_slice(&bin.to_le_bytes());
                entries.extend_from_slice(&count.to_le_bytes());
                entries.extend_from_slice(record);
            }
            count += 1;
        }
        found[..4].copy_from_slice(&count.to_le_bytes());
        [keys, places, entries].iter().for_each(|part| found.extend_from_slice(part));
        Ok(())
    }

    fn take(&self, found: &[u8]) -> Result<()> {
        let short = || Error::internal("a stretch of records is cut short");
        let (count, rest) = found.split_first_chunk::<4>().ok_or_else(short)?;
        let count = u32::from_le_bytes(*count) as usize;
        let key_bytes = if matches!(self.following, Following::None) { 0 } else { KEY };
        let (keys, rest) = rest.split_at_checked(count * key_bytes).ok_or_else(short)?;
        let places = rest.split_at_checked(count * self.place_bytes());
        let (places, entries) = places.ok_or_else(short)?;
        let SortedSide { bins, records } = &mut *lock(&self.sorted);
        let first = *records;
        *records += count as u64;
        self.follow(first, keys, places)?;
        for entry in entries.chunks_exact(BEFORE + self.keys.stride) {
            let (bin, rest) = entry.split_first_chunk::<4>().ok_or_else(short)?;
            let (index, record) = rest.split_first_chunk::<4>().ok_or_else(short)?;
            let number = first + u64::from(u32::from_le_bytes(*index));
            bins.push(u32::from_le_bytes(*bin) as usize, &[&number.to_le_bytes(), record])?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::engine::scratch::{Scratch, Trouble};

    /// True if all of `small` is met in `large` in order, and where they first differ.
    fn followed(small: &[u128], large: &[u128]) -> (bool, Option<u64>) {
        let at = tempfile::tempdir().unwrap();
        let scratch = Arc::new(Scratch::below(at.path(), &Trouble::default()));
        let area = SpillArea::new(Budget::new(1 << 20), 0, Box::new(scratch));
        let mut followed = FollowedKeys::new(&area);
        for stretch in small.chunks(3) {
            let bytes: Vec<u8> = stretch.iter().flat_map(|key| key.to_le_bytes()).collect();
            followed.store(&bytes).unwrap();
        }
        for (number, key) in (0..).zip(large) {
            followed.meet(number, &key.to_le_bytes(), &[0; PLACE]).unwrap();
        }
        (followed.is_met(), followed.first_other.map(|other| other.number))
    }

    #[test]
    fn a_part_in_order_is_met_and_its_first_gap_is_told() {
        let all: Vec<u128> = (0..20).map(|n| ((n % 7) << 64) | (n % 3)).collect();
        assert_eq!(followed(&all, &all), (true, None));
        let part: Vec<u128> = all.iter().copied().filter(|n| *n % 2 == 0).collect();
        let first = all.iter().position(|n| *n % 2 == 1).map(|n| n as u64);
        assert_eq!(followed(&part, &all), (true, first));
        let mut turned = all.clone();
        turned.swap(5, 6);
        assert_eq!(followed(&turned, &all), (false, Some(5)));
        assert_eq!(followed(&[], &all), (true, Some(0)));
        assert_eq!(followed(&all[..4], &[]), (false, None));
    }
}
