//! The records of several files as one list, gathered file by file: what is held is the union, not
//! the sum. Nothing here depends on the order of the files.

use std::cmp::Ordering;

use super::extra::Descriptor;
use super::input::{EXTRA_BYTES, Input, extra_record};
use super::vlr::{Evlr, Vlr, check_held};
use crate::Result;

/// The records of the files that were added.
pub struct Records {
    /// Descriptors of the first file's extra bytes.
    descriptors: Vec<Descriptor>,
    /// As they are, while all files describe their extra bytes alike.
    as_they_are: Option<Union<Vlr>>,
    /// With descriptors that lack ranges. Where the ranges differ, none holds for all points: they
    /// are left out, so that one record remains.
    without_ranges: Union<Vlr>,
    extended: Union<Evlr>,
    /// The bytes between records and points, if all files have the same.
    gap: Option<Vec<u8>>,
}

impl Records {
    /// Those of one file.
    pub fn of(first: &Input) -> Self {
        let vlrs = first.carried_vlrs();
        Records {
            descriptors: first.descriptors(),
            without_ranges: Union::of(without_ranges(first, vlrs.clone())),
            as_they_are: Some(Union::of(vlrs)),
            extended: Union::of(first.carried_evlrs()),
            gap: Some(first.gap.clone()),
        }
    }

    /// Adds those of another file, which agrees with the first.
    pub fn add(&mut self, other: &Input) -> Result<()> {
        if other.descriptors() != self.descriptors {
            self.as_they_are = None;
        }
        self.gap.take_if(|gap| *gap != other.gap);
        let vlrs = other.carried_vlrs();
        self.without_ranges.add(without_ranges(other, vlrs.clone()))?;
        self.as_they_are.as_mut().map_or(Ok(()), |all| all.add(vlrs))?;
        self.extended.add(other.carried_evlrs())?;
        check_held(&self.without_ranges.all, &self.extended.all).map_err(|e| e.at(&other.path))
    }

    /// The records, the bytes behind them, the extended records.
    pub fn finish(self) -> (Vec<Vlr>, Vec<u8>, Vec<Evlr>) {
        let vlrs = self.as_they_are.unwrap_or(self.without_ranges).finish();
        (vlrs, self.gap.unwrap_or_default(), self.extended.finish())
    }
}

/// The descriptors of a file's extra bytes without what is a statistic of it.
pub fn described(input: &Input) -> Vec<Descriptor> {
    input.descriptors().iter().map(Descriptor::without_range).collect()
}

fn without_ranges(input: &Input, mut vlrs: Vec<Vlr>) -> Vec<Vlr> {
    if let Some(record) = extra_record(&vlrs, input.extra_len()) {
        let payload = described(input).iter().flat_map(|d| *d.bytes()).collect();
        vlrs[record] = Vlr::new(EXTRA_BYTES.0, EXTRA_BYTES.1, "Extra bytes", payload);
    }
    vlrs
}

/// What a union is made of; comparing extended records reads them.
trait Item: Clone {
    fn compare(&self, other: &Self) -> Result<Ordering>;
}

impl Item for Vlr {
    fn compare(&self, other: &Self) -> Result<Ordering> {
        Ok(self.order(other))
    }
}

impl Item for Evlr {
    fn compare(&self, other: &Self) -> Result<Ordering> {
        self.order(other)
    }
}

/// Equal lists as they are, else all that is in any of them, in the order of user, number and bytes.
struct Union<T> {
    first: Vec<T>,
    /// Sorted, no two equal; empty while all lists are equal.
    all: Vec<T>,
}

impl<T: Item> Union<T> {
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

    fn finish(self) -> Vec<T> {
        if self.all.is_empty() { self.first } else { self.all }
    }
}
