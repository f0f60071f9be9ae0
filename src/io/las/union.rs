//! The records of several files as one list, gathered file by file: what is held is the union, not
//! the sum. Nothing here depends on the order of the files.

use std::cmp::Ordering;

use super::crs;
use super::described::{EXTRA_BYTES, record};
use super::extra::Descriptor;
use super::input::LasInput;
use super::system::CrsRecords;
use super::vlr::{Evlr, Vlr, check_held};
use crate::Result;

/// The records of the files that were added.
pub struct UnionRecords {
    /// Descriptors of the first file's extra bytes.
    descriptors: Vec<Descriptor>,
    /// As they are, while all files describe their extra bytes alike.
    as_they_are: Option<Union<Vlr>>,
    /// With descriptors that lack ranges. Where the ranges differ, none holds for all points: they
    /// are left out, so that one record remains.
    without_ranges: Union<Vlr>,
    extended: Union<Evlr>,
    /// Of records that name one system in different words, those that are carried.
    crs: CrsRecords,
    crs_differ: bool,
    /// The bytes between records and points, if all files have the same.
    gap: Option<Vec<u8>>,
}

impl UnionRecords {
    /// Those of one file.
    pub fn of(first: &LasInput) -> Result<Self> {
        let (vlrs, evlrs) = first.carried();
        Ok(UnionRecords {
            crs: first.crs_records()?,
            crs_differ: false,
            descriptors: first.descriptors().to_vec(),
            without_ranges: Union::of(without_ranges(vlrs.clone())),
            as_they_are: Some(Union::of(vlrs)),
            extended: Union::of(evlrs),
            gap: Some(first.gap.clone()),
        })
    }

    /// Adds those of another file, which agrees with the first.
    pub fn add(&mut self, other: &LasInput) -> Result<()> {
        let crs = other.crs_records()?;
        self.crs_differ |= !crs.equal(&self.crs);
        if crs.order(&self.crs) == Ordering::Less {
            self.crs = crs;
        }
        if other.descriptors() != self.descriptors {
            self.as_they_are = None;
        }
        self.gap.take_if(|gap| *gap != other.gap);
        let (vlrs, evlrs) = other.carried();
        self.without_ranges.add(without_ranges(vlrs.clone()))?;
        self.as_they_are.as_mut().map_or(Ok(()), |all| all.add(vlrs))?;
        self.extended.add(evlrs)?;
        check_held(&self.without_ranges.all, &self.extended.all).map_err(|e| e.at(&other.path))
    }

    /// The records, the bytes behind them, the extended records.
    pub fn finish(self) -> Result<(Vec<Vlr>, Vec<u8>, Vec<Evlr>)> {
        let mut vlrs = self.as_they_are.unwrap_or(self.without_ranges);
        let mut evlrs = self.extended;
        if self.crs_differ {
            let is_crs = |user: String, record| crs::is_record(&user, record);
            vlrs = vlrs.replaced(|v| is_crs(v.user(), v.record()), self.crs.vlrs)?;
            evlrs = evlrs.replaced(|v| is_crs(v.user(), v.record()), self.crs.evlrs)?;
        }
        Ok((vlrs.finish(), self.gap.unwrap_or_default(), evlrs.finish()))
    }
}

/// The descriptors of a file's extra bytes without what is a statistic of it.
pub fn described(input: &LasInput) -> Vec<Descriptor> {
    input.descriptors().iter().map(Descriptor::without_range).collect()
}

fn without_ranges(mut vlrs: Vec<Vlr>) -> Vec<Vlr> {
    for vlr in vlrs.iter_mut().filter(|v| v.is(EXTRA_BYTES.0, EXTRA_BYTES.1)) {
        let all = Descriptor::all(vlr.payload());
        *vlr = record(&all.iter().map(Descriptor::without_range).collect::<Vec<_>>());
    }
    vlrs
}

/// What a union is made of; comparing extended records reads them.
trait UnionRecord: Clone {
    fn compare(&self, other: &Self) -> Result<Ordering>;
}

impl UnionRecord for Vlr {
    fn compare(&self, other: &Self) -> Result<Ordering> {
        self.order(other)
    }
}

impl UnionRecord for Evlr {
    fn compare(&self, other: &Self) -> Result<Ordering> {
        self.order(other)
    }
}

/// Equal lists as they are, else all that is in any of them, in the order of user, number and
/// bytes.
struct Union<T> {
    first: Vec<T>,
    /// Sorted, no two equal; empty while all lists are equal.
    all: Vec<T>,
}

impl<T: UnionRecord> Union<T> {
    fn of(first: Vec<T>) -> Self {
        Union { first, all: Vec::new() }
    }

    fn add(&mut self, list: Vec<T>) -> Result<()> {
        if self.is_first(&list)? {
            return Ok(());
        }
        if self.all.is_empty() {
            self.first.clone().into_iter().try_for_each(|item| self.insert(item))?;
        }
        list.into_iter().try_for_each(|item| self.insert(item))
    }

    fn is_first(&self, list: &[T]) -> Result<bool> {
        if list.len() != self.first.len() {
            return Ok(false);
        }
        for (a, b) in self.first.iter().zip(list) {
            if a.compare(b)? != Ordering::Equal {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn insert(&mut self, item: T) -> Result<()> {
        let (mut low, mut high) = (0, self.all.len());
        while low < high {
            let middle = usize::midpoint(low, high);
            match self.all[middle].compare(&item)? {
                Ordering::Less => low = middle + 1,
                Ordering::Equal => return Ok(()),
                Ordering::Greater => high = middle,
            }
        }
        self.all.insert(low, item);
        Ok(())
    }

    /// The list with `those` for all items of a kind.
    fn replaced(self, is_kind: impl Fn(&T) -> bool, those: Vec<T>) -> Result<Self> {
        let mut replaced = Union::of(Vec::new());
        let others = self.finish().into_iter().filter(|item| !is_kind(item));
        others.chain(those).try_for_each(|item| replaced.insert(item))?;
        Ok(replaced)
    }

    fn finish(self) -> Vec<T> {
        if self.all.is_empty() { self.first } else { self.all }
    }
}
