//! Do two scans have the same records? Out of core: neither scan is held, and what does not fit in
//! memory goes into scratch files.
//!
//! One look at each scan says whether they are the same ([`sums`]); where they are, that is all. A
//! second look puts the records of unequal buckets into bins, where they are matched ([`sorted`],
//! [`matching`]).

mod bins;
mod keys;
mod looked;
mod matching;
mod sorted;
mod sums;
mod told;

use std::path::Path;
use std::sync::{Arc, Mutex};

use crate::budget::{Budget, Bytes, whole_mebibytes};
use crate::engine::Watch;
use crate::engine::scratch::{Scratch, Trouble, memory_warning};
use crate::graph::{RunSettings, SpillSetting};
use crate::host::process::{default_memory, processors};
use crate::host::{disk, lock};
use crate::io::ends::Read;
use crate::language::Registry;
use crate::point::{Chooser, Schema, Selection};
use crate::stage::OpenSource;
use crate::store::SpillArea;
use crate::{Error, ErrorKind, Result};
use bins::RecordBins;
use keys::ComparedSchemas;
use looked::look_at;
use matching::{BinMemory, KEY_BYTES, MatchRecords, MatchedRecords};
use sorted::{FollowedKeys, Following, NO_BIN, SortRecords};
use sums::{BUCKETS, KeySums, SumKeys};
use told::OTHER_BYTES;

pub use told::{
    ChangedDimension, ChangedPlace, ChangedRecords, ComparedBy, OnlyRecords, PartOf, RecordPlace,
    RecordsComparison,
};

/// Part of the memory that the second look has for itself.
const OWN: u64 = 4;
/// Bytes of records that wait to be stored, at most.
const MOST_WAITING: u64 = 64 << 20;

/// What the comparison of records works with.
struct RecordsJob<'a> {
    paths: [&'a [String]; 2],
    schemas: [Arc<Schema>; 2],
    compared: ComparedSchemas,
    left_out: &'a Selection,
    run: &'a RunSettings,
    memory: u64,
    threads: usize,
    registry: &'a Registry,
    watch: &'a dyn Watch,
}

/// Compares the records of two scans, but for those of a selection that is left out.
pub(super) fn compare_records(
    paths: [&[String]; 2],
    left_out: &Selection,
    run: &RunSettings,
    registry: &Registry,
    watch: &dyn Watch,
) -> Result<RecordsComparison> {
    let sources = [open(paths[0], registry)?.open()?, open(paths[1], registry)?.open()?];
    let schemas = [sources[0].schema().clone(), sources[1].schema().clone()];
    drop(sources);
    let job = RecordsJob {
        paths,
        compared: ComparedSchemas::of([&schemas[0], &schemas[1]])?,
        schemas,
        left_out,
        run,
        memory: run.memory.unwrap_or_else(default_memory),
        threads: run.threads.map_or_else(processors, usize::from),
        registry,
        watch,
    };
    job.compare()
}

/// The scan at these paths.
pub(super) fn open(paths: &[String], registry: &Registry) -> Result<Box<dyn OpenSource>> {
    Read { path: paths.to_vec(), ..Read::default() }.source(registry.formats())
}

/// The finer scale of the two scans, to which their places are told; 0 where neither has one.
pub(super) fn step_of(schemas: [&Schema; 2]) -> f64 {
    let scale = |schema: &Schema| {
        let x = schema.coordinates().map(|axes| axes[0].clone());
        x.filter(|x| !x.scalar.is_float()).map(|x| x.scale.abs())
    };
    schemas.into_iter().filter_map(scale).reduce(f64::min).unwrap_or(0.0)
}

impl RecordsJob<'_> {
    fn compare(&self) -> Result<RecordsComparison> {
        let tables = KeySums::BYTES * (self.threads as u64 + 2);
        let run = self.run_with(tables, "the sums of two scans")?;
        let sums = [self.sums(0, &run)?, self.sums(1, &run)?];
        let [a, b] = [sums[0].of_all, sums[1].of_all];
        let mut told = RecordsComparison {
            first: a.records,
            second: b.records,
            same: a.records == b.records && a.sum == b.sum,
            same_order: a == b,
            order_differs: None,
            only_first: OnlyRecords::default(),
            only_second: OnlyRecords::default(),
            changed: ChangedRecords::default(),
            second_in_first: PartOf::InOrder,
            first_in_second: PartOf::InOrder,
            compared: if self.compared.by_bytes { ComparedBy::Bytes } else { ComparedBy::Values },
            not_compared_first: self.compared.left_out[0].clone(),
            not_compared_second: self.compared.left_out[1].clone(),
            step: self.step(),
        };
        if !told.same_order {
            self.look_again(&sums, &mut told)?;
        }
        Ok(told)
    }

    /// The step that places are told to.
    fn step(&self) -> f64 {
        step_of([&self.schemas[0], &self.schemas[1]])
    }

    /// The settings of a run beside which so many bytes are held.
    fn run_with(&self, held: u64, what: &str) -> Result<RunSettings> {
        let left = self.memory.checked_sub(held).ok_or_else(|| {
            let told = format!("{what} need {}", Bytes(held));
            let enough = whole_mebibytes(held + (64 << 20));
            Error::memory(told).help(format!("give `run.memory = \"{enough}\"` or more"))
        })?;
        Ok(RunSettings { memory: Some(left), ..self.run.clone() })
    }

    fn chosen(&self, side: usize) -> Option<Chooser> {
        (!self.left_out.is_all()).then(|| self.left_out.of(&self.schemas[side]))
    }

    fn sums(&self, side: usize, run: &RunSettings) -> Result<KeySums> {
        let look = SumKeys::new(self.compared.sides[side].clone(), self.chosen(side));
        let look = Arc::new(look);
        look_at(open(self.paths[side], self.registry)?, look.clone(), run, self.watch)?;
        Ok(look.sums())
    }

    /// Looks at both scans again, to tell what they differ by.
    fn look_again(&self, sums: &[KeySums; 2], told: &mut RecordsComparison) -> Result<()> {
        let trouble = Trouble::default();
        let temporary = std::env::temp_dir;
        let folder = self.run.scratch.clone().unwrap_or_else(temporary);
        let outcome = self.look_with(sums, &folder, &trouble, told);
        lock(&trouble).iter().for_each(|told| self.watch.warn(told));
        outcome
    }

    fn look_with(
        &self,
        sums: &[KeySums; 2],
        folder: &Path,
        trouble: &Trouble,
        told: &mut RecordsComparison,
    ) -> Result<()> {
        let own = self.memory / OWN;
        let kept = if self.run.spill == SpillSetting::Always { 0 } else { own / 2 };
        let memory = self.bin_memory();
        let (places, shares) = self.places_of_buckets(sums, &memory)?;
        let small = usize::from(told.second <= told.first);
        let follows = may_be_part(&sums[small], &sums[1 - small]);
        let keys = if follows { sums[small].of_all.records } else { 0 };
        self.check_disk(folder, kept, shares.records, keys)?;
        let scratch = Arc::new(Scratch::below(folder, trouble));
        let area = SpillArea::new(Budget::new(kept), kept, Box::new(scratch));
        let followed = Arc::new(Mutex::new(FollowedKeys::new(&area)));
        let run = self.run_with(own, "the records that differ")?;
        let places = Arc::new(places);
        let sorted = |side: usize| {
            let following = match (follows, side == small) {
                (false, _) => Following::None,
                (true, true) => Following::Stored(followed.clone()),
                (true, false) => Following::Met(followed.clone()),
            };
            let entry = SortRecords::entry(self.compared.sides[side].stride);
            let bins = RecordBins::new(&area, entry, shares.bins, memory.waiting);
            self.sorted(side, places.clone(), bins, following, &run)
        };
        let (first, second) = (sorted(small)?, sorted(1 - small)?);
        let sides = if small == 0 { [first, second] } else { [second, first] };
        let matching = MatchRecords {
            compared: &self.compared,
            sides,
            area: area.clone(),
            memory: &memory,
            threads: self.threads,
            watch: self.watch,
        };
        self.watch.phase("match", Some(shares.records[0] + shares.records[1]));
        let matched = matching.run(!follows)?;
        tell(told, &self.compared, matched, follows.then_some((small, &lock(&followed))));
        memory_warning(folder, area.written()).iter().for_each(|told| self.watch.warn(told));
        Ok(())
    }

    /// Puts the records of a scan into bins.
    fn sorted(
        &self,
        side: usize,
        places: Arc<Vec<u32>>,
        bins: RecordBins,
        following: Following,
        run: &RunSettings,
    ) -> Result<RecordBins> {
        let keys = self.compared.sides[side].clone();
        let look = Arc::new(SortRecords::new(keys, self.chosen(side), places, bins, following));
        look_at(open(self.paths[side], self.registry)?, look.clone(), run, self.watch)?;
        let goes_on = || Error::internal("a look at records goes on behind its end");
        Arc::into_inner(look).map(SortRecords::into_bins).ok_or_else(goes_on)
    }

    /// What bins may take.
    fn bin_memory(&self) -> BinMemory {
        let own = self.memory / OWN;
        let bin = (own / self.threads as u64).max(1 << 20);
        BinMemory { waiting: (own / 8).min(MOST_WAITING), bin }
    }

    /// The bin of each bucket that is not equal in both scans: as many buckets to a bin as have
    /// records that a thread matches in its memory.
    fn places_of_buckets(
        &self,
        sums: &[KeySums; 2],
        memory: &BinMemory,
    ) -> Result<(Vec<u32>, BinShares)> {
        let buckets = || sums[0].buckets.iter().zip(&sums[1].buckets);
        let unequal = buckets().filter(|(a, b)| a != b);
        let keys: u64 = unequal.map(|(a, b)| a.records + b.records).sum();
        let bytes = Bytes::of(keys, KEY_BYTES).0;
        let of_bin = memory.bytes_of_bin(bytes);
        if of_bin > memory.bin {
            let told = "the records that differ are too many to be matched in this memory";
            let times = (of_bin as f64 / memory.bin as f64).sqrt() * 1.05;
            let enough = whole_mebibytes((self.memory as f64 * times) as u64);
            let help = format!("give `run.memory = \"{enough}\"` or more");
            return Err(Error::memory(told).help(help));
        }
        let most = of_bin / KEY_BYTES as u64;
        let mut places = vec![NO_BIN; BUCKETS];
        let (mut shares, mut filled) = (BinShares { bins: 0, records: [0; 2] }, u64::MAX);
        for (place, (a, b)) in places.iter_mut().zip(buckets()) {
            if a == b {
                continue;
            }
            let records = a.records + b.records;
            if filled.saturating_add(records) > most {
                shares.bins += 1;
                filled = 0;
            }
            filled += records;
            *place = shares.bins as u32 - 1;
            shares.records[0] += a.records;
            shares.records[1] += b.records;
        }
        Ok((places, shares))
    }

    /// Refuses a disk that what is set down does not fit on.
    fn check_disk(&self, folder: &Path, kept: u64, records: [u64; 2], keys: u64) -> Result<()> {
        let bytes = |side: usize| {
            Bytes::of(records[side], SortRecords::entry(self.compared.sides[side].stride))
        };
        let all = bytes(0) + bytes(1) + Bytes::of(keys, size_of::<u128>());
        let needed = all.0.saturating_sub(kept);
        match disk::free_space(folder) {
            Some(free) if free < needed => {
                let told = format!(
                    "{} are to be set down of the records that differ, and there are {} free here",
                    Bytes(needed),
                    Bytes(free)
                );
                let help = "free some disk space, or name another folder with `run.scratch`";
                Err(Error::new(ErrorKind::Io, told).at(folder).help(help))
            }
            _ => Ok(()),
        }
    }
}

/// Bins, and the records that come into them of either scan.
struct BinShares {
    bins: usize,
    records: [u64; 2],
}

/// False if some bucket has more records of the smaller scan than of the larger one, so that it is
/// no part of it.
fn may_be_part(small: &KeySums, large: &KeySums) -> bool {
    small.buckets.iter().zip(&large.buckets).all(|(small, large)| small.records <= large.records)
}

/// Enters what both looks came to.
fn tell(
    told: &mut RecordsComparison,
    compared: &ComparedSchemas,
    matched: MatchedRecords,
    followed: Option<(usize, &FollowedKeys)>,
) {
    let MatchedRecords { only: [first, second], pairs, differ, places } = matched;
    let names = compared.names().chain([OTHER_BYTES]);
    let dimensions = names.zip(differ).filter(|(_, pairs)| *pairs > 0);
    let dimension = |(name, pairs): (&str, u64)| ChangedDimension { name: name.to_owned(), pairs };
    let dimensions = dimensions.map(dimension).collect();
    told.changed = ChangedRecords { pairs, dimensions, places };
    (told.only_first, told.only_second) = (first, second);
    let is_met = |part: usize| {
        followed.is_some_and(|(small, followed)| (small == part || told.same) && followed.is_met())
    };
    let part = |only: &OnlyRecords, part: usize| match (only.count, is_met(part)) {
        (0, true) => PartOf::InOrder,
        (0, false) => PartOf::InAnotherOrder,
        _ => PartOf::No,
    };
    let parts = [part(&told.only_first, 0), part(&told.only_second, 1)];
    [told.first_in_second, told.second_in_first] = parts;
    if told.same {
        told.order_differs = followed.and_then(|(_, followed)| followed.first_other.clone());
    }
}

#[cfg(test)]
mod tests;
