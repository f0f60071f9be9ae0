//! What a trial reads: where stages work on tiles, all records in a few squares of a scan, wherever
//! in the input they are; where records stream, stretches spread over the input as they are, since
//! encoders live on the order of records.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Mutex;

use super::spots::{Footprint, Overview, PartLook, Spots};
use crate::engine::Watch;
use crate::host::{Threads, lock};
use crate::point::PointBatch;
use crate::stage::Source;
use crate::{Error, Result};

/// Records that are read to choose from, at most.
const READ: u64 = 5_000_000;
/// A scan is tried as a whole if it has no more than so many fourths of what is tried of others.
const WHOLE_FOURTHS: u64 = 5;
/// Parts that are looked at, spread evenly over the input.
const LOOKS: usize = 1024;
/// Records of each, from its beginning.
const LOOKED_AT: usize = 1024;
/// Records that are read at once.
const BATCH: usize = 4096;
/// Squares hold no more than so many times the records that are taken of them.
const HELD_TIMES: usize = 3;
/// Bytes that are held with each of them.
const BESIDE: usize = 64;

/// How much a trial works on.
#[derive(Debug, Clone, Copy)]
pub(super) struct TrialSize {
    /// Records, about.
    pub about: usize,
    /// The squares or stretches that these are in, at most.
    pub spots: usize,
    /// Records that are read to choose from, at most.
    pub read: u64,
}

impl TrialSize {
    /// About so many records, in so many squares or stretches.
    pub const fn of(about: usize, spots: usize) -> TrialSize {
        TrialSize { about, spots, read: READ }
    }
}

/// The records that a trial works on.
pub(super) struct TrialRecords {
    /// How many were read to choose from.
    pub read: u64,
    pub chosen: Vec<u8>,
    /// See [`Trial::density`](super::trial::Trial::density).
    pub density: f64,
}

/// The reading of some of a source's records.
pub(super) struct TrialReading<'a> {
    pub source: &'a dyn Source,
    pub unread: &'a [String],
    pub threads: Threads<'a>,
    pub watch: &'a dyn Watch,
    /// Bytes of records that are held, at most.
    pub limit: u64,
    pub size: TrialSize,
}

/// A record in a square: how far from its middle, and its number by part and place in it.
struct SpotRecord {
    far: f64,
    number: (usize, u64),
    bytes: Box<[u8]>,
}

/// The squares with the parts that are read for them.
struct ChosenParts {
    spots: Spots,
    parts: Vec<usize>,
    /// Of the records in the squares, about the part that these have.
    density: f64,
}

impl TrialReading<'_> {
    /// Reads what is tried.
    pub fn records(&self, in_spots: bool) -> Result<TrialRecords> {
        let most = self.limit / self.stride() as u64;
        let whole = (self.size.about as u64 / 4 * WHOLE_FOURTHS).min(most);
        let all = self.source.points();
        if all > whole && in_spots {
            let found = self.in_spots()?;
            if let Some(found) = found {
                return Ok(found);
            }
        }
        let parts = self.source.parts();
        let (numbers, each) = match all <= whole {
            true => ((0..parts).collect(), most),
            false => {
                let TrialSize { about, spots, .. } = self.size;
                let mut some: Vec<usize> =
                    (0..spots).map(|n| parts * (2 * n + 1) / (2 * spots)).collect();
                some.dedup();
                let each = most.min(about as u64) / some.len().max(1) as u64;
                (some, each)
            }
        };
        let chosen = self.firsts(&numbers, each)?.concat();
        Ok(TrialRecords { read: (chosen.len() / self.stride()) as u64, chosen, density: 1.0 })
    }

    fn stride(&self) -> usize {
        self.source.schema().stride.max(1)
    }

    /// The records in squares; None where records have no places.
    fn in_spots(&self) -> Result<Option<TrialRecords>> {
        let parts = self.source.parts();
        let step = parts.div_ceil(LOOKS).max(1);
        let mut read = 0;
        let looks = self.looks(&(0..parts).step_by(step).collect::<Vec<_>>(), &mut read)?;
        let Some(mut overview) = Overview::of(looks) else { return Ok(None) };
        if step > 1 {
            // Which parts of a stretch have records in the squares is known by a look at each.
            let footprints = self.footprints(&overview);
            let chosen = self.chosen_parts(&overview, &footprints);
            overview.add(self.looks(&chosen.parts, &mut read)?);
        }
        let chosen = self.chosen_parts(&overview, &self.footprints(&overview));
        let held = self.limit as usize / HELD_TIMES / (self.stride() + BESIDE);
        let each = self.size.about.min(held) / chosen.spots.count().max(1);
        let (records, in_squares) = self.held(&chosen, each.max(1))?;
        let density = chosen.density;
        Ok(Some(TrialRecords { read: read + records, chosen: in_squares, density }))
    }

    fn footprints(&self, overview: &Overview) -> Vec<Footprint> {
        let (parts, all) = (self.source.parts(), self.source.points());
        let first = |part: usize| match part >= parts {
            true => all as f64,
            false => {
                let known = self.source.first_record(part).map(|first| first as f64);
                known.unwrap_or(all as f64 * part as f64 / parts as f64)
            }
        };
        overview.footprints(parts, |parts: Range<usize>| first(parts.end) - first(parts.start))
    }

    /// As many squares as can be read whole; if not one can, all of them, with some of their parts.
    fn chosen_parts(&self, overview: &Overview, footprints: &[Footprint]) -> ChosenParts {
        let TrialSize { about, spots, read } = self.size;
        let read = read as f64;
        let records = |met: &[&Footprint]| met.iter().map(|f| f.records).sum::<f64>();
        let parts = |met: &[&Footprint]| -> Vec<usize> {
            met.iter().flat_map(|f| f.parts.clone()).collect()
        };
        let squares =
            |count: usize, about: f64| overview.spots(footprints, count, about / count as f64);
        for count in (1..=spots).rev() {
            let spots = squares(count, about as f64);
            let met = spots.met(footprints);
            if records(&met) <= read {
                return ChosenParts { parts: parts(&met), spots, density: 1.0 };
            }
        }
        let all = records(&squares(spots, about as f64).met(footprints));
        let spots = squares(spots, about as f64 * all / read);
        let met = spots.met(footprints);
        let (density, of) = (read / records(&met), parts(&met));
        let count = (of.len() as f64 * density).ceil().max(1.0) as usize;
        let parts = (0..count).map(|n| of[of.len() * n / count]).collect();
        ChosenParts { parts, spots, density: density.min(1.0) }
    }

    /// The place of a record.
    fn place(&self, record: &[u8]) -> [f64; 3] {
        let schema = self.source.schema();
        match schema.coordinates() {
            Some(axes) => axes.map(|axis| axis.world(record, schema.endian)),
            None => [f64::NAN; 3],
        }
    }

    /// Looks at the first records of these parts, and counts them.
    fn looks(&self, parts: &[usize], read: &mut u64) -> Result<Vec<PartLook>> {
        let looks = self.read(parts, LOOKED_AT, |look, item, batch| {
            let places: Vec<[f64; 3]> = batch.iter().map(|record| self.place(record)).collect();
            *look = (batch.len() as u64, PartLook::of(parts[item], batch.source, &places));
            false
        })?;
        *read += looks.iter().map(|(count, _)| count).sum::<u64>();
        Ok(looks.into_iter().filter_map(|(_, look)| look).collect())
    }

    /// Of the records of the parts `each` of every square, those nearest to its middle, in input
    /// order, and how many records were read.
    fn held(
        &self,
        ChosenParts { spots, parts, .. }: &ChosenParts,
        each: usize,
    ) -> Result<(u64, Vec<u8>)> {
        let squares: Vec<Mutex<Vec<SpotRecord>>> =
            (0..spots.count()).map(|_| Mutex::default()).collect();
        let counts = self.read(parts, BATCH, |count: &mut u64, item, batch| {
            for (n, bytes) in batch.iter().enumerate() {
                let Some((square, far)) = spots.holding(self.place(bytes)) else { continue };
                let number = (item, *count + n as u64);
                let mut records = lock(&squares[square]);
                records.push(SpotRecord { far, number, bytes: bytes.into() });
                if records.len() > HELD_TIMES * each {
                    nearest(&mut records, each);
                }
            }
            *count += batch.len() as u64;
            true
        })?;
        let mut all = Vec::new();
        for square in squares {
            let mut records = std::mem::take(&mut *lock(&square));
            nearest(&mut records, each);
            all.append(&mut records);
        }
        all.sort_unstable_by_key(|record| record.number);
        Ok((
            counts.iter().sum(),
            all.iter().flat_map(|record| record.bytes.iter().copied()).collect(),
        ))
    }

    /// So many records of each of these parts, in whole batches.
    fn firsts(&self, parts: &[usize], most: u64) -> Result<Vec<Vec<u8>>> {
        let most = most.saturating_mul(self.stride() as u64);
        self.read(parts, BATCH, |bytes: &mut Vec<u8>, _, batch| {
            bytes.extend_from_slice(batch.records());
            (bytes.len() as u64) < most
        })
    }

    /// Lets `take` have each of these parts in batches of `records`, by its number among them,
    /// until it has enough.
    fn read<T: Default + Send>(
        &self,
        parts: &[usize],
        records: usize,
        take: impl Fn(&mut T, usize, &PointBatch) -> bool + Sync,
    ) -> Result<Vec<T>> {
        let taken = Mutex::new(BTreeMap::new());
        self.threads.items(parts.len(), || {}).run(
            || PointBatch::new(self.source.schema().clone(), records),
            |batch, item| {
                let mut part = self.source.part_without(parts[item], self.unread)?;
                let mut all = T::default();
                loop {
                    if self.watch.cancelled() {
                        return Err(Error::interrupted());
                    }
                    part.read(batch)?;
                    if batch.is_empty() || !take(&mut all, item, batch) {
                        break;
                    }
                }
                lock(&taken).insert(item, all);
                Ok(())
            },
            |()| {},
            |_| Ok(()),
        )?;
        Ok(std::mem::take(&mut *lock(&taken)).into_values().collect())
    }
}

/// Leaves the `count` records that are nearest to the middle of their square: of equally near ones
/// the first.
fn nearest(records: &mut Vec<SpotRecord>, count: usize) {
    if records.len() > count {
        let order =
            |a: &SpotRecord, b: &SpotRecord| a.far.total_cmp(&b.far).then(a.number.cmp(&b.number));
        records.select_nth_unstable_by(count, order);
        records.truncate(count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Quiet;
    use crate::memory::Records;
    use crate::stage::OpenSource;

    /// A grid of 500 times 1600 places, in an order of all over it or of rows.
    fn scan(is_shuffled: bool) -> Box<dyn Source> {
        let place = |n: usize| [(n % 500) as f64, (n / 500) as f64, 0.5];
        // A step that has no factor in common with the number takes each once.
        let step = if is_shuffled { 123_457 } else { 1 };
        let places: Vec<[f64; 3]> = (0..800_000).map(|n| place(n * step % 800_000)).collect();
        Records::of_positions(&places).open().unwrap()
    }

    fn read(source: &dyn Source, size: TrialSize) -> TrialRecords {
        let limit = 64 << 20;
        Threads::start(2, |threads| {
            let watch = &Quiet;
            TrialReading { source, unread: &[], threads, watch, limit, size }.records(true)
        })
        .unwrap()
    }

    /// The columns of places that records are in.
    fn places(source: &dyn Source, records: &[u8]) -> Vec<[i64; 2]> {
        let schema = source.schema();
        let [x, y, _] = schema.coordinates().unwrap();
        let at = |record: &[u8]| [x, y].map(|axis| axis.world(record, schema.endian) as i64);
        records.chunks_exact(schema.stride).map(at).collect()
    }

    #[test]
    fn squares_are_whole_wherever_their_records_are() {
        for is_shuffled in [false, true] {
            let source = scan(is_shuffled);
            let found = read(&*source, TrialSize::of(20_000, 4));
            assert_eq!((found.density, found.chosen.len()), (1.0, 20_000 * 24));
            let mut places = places(&*source, &found.chosen);
            places.sort_unstable();
            places.dedup();
            assert_eq!(places.len(), 20_000, "each record once");
            let is = |x, y| places.binary_search(&[x, y]).is_ok();
            let inner =
                places.iter().filter(|[x, y]| is(x - 1, *y) && is(x + 1, *y) && is(*x, y + 1));
            assert!(inner.count() > 19_000, "records have their neighbours");
        }
    }

    #[test]
    fn where_not_all_can_be_read_some_of_the_records_of_a_place_are_and_it_is_said() {
        let size = TrialSize { read: 300_000, ..TrialSize::of(10_000, 4) };
        let source = scan(true);
        let found = read(&*source, size);
        assert!((0.3..0.5).contains(&found.density), "{}", found.density);
        assert!(found.read < 400_000 && found.chosen.len() > 5_000 * 24, "{}", found.read);
        // In the order of rows a square is in few parts of the input.
        let found = read(&*scan(false), size);
        assert!(found.density == 1.0 && found.read < 400_000, "{} {}", found.density, found.read);
    }
}
