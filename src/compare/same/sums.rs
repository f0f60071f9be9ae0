//! Sums of the keys of all records: equal for equal records, in any order or in the same one.
//!
//! A key is 128 bits of a hash, and the sum of all of them says whether two scans have the same
//! records as often; no table is needed for that, and no second look. A polynomial of the keys says
//! whether their order is the same, too. Keys fall into buckets by their first bits, each with a
//! sum of its own: where scans differ little, most buckets are equal, and none of their records is
//! looked at again.

use std::sync::{Arc, Mutex};

use super::keys::SideKeys;
use super::looked::RecordLook;
use crate::host::lock;
use crate::point::{Chooser, PointBatch};
use crate::{Error, Result};

/// Buckets of keys: so many that few are unequal where few records are, and so few that a table of
/// them stays near the processor.
pub const BUCKETS: usize = 1 << 14;
/// What the polynomial of an order is evaluated at: odd, so that no power of it is 0.
const BASE: u128 = 0x9e37_79b9_7f4a_7c15_f39c_c060_5ced_c835;

/// The bucket of a key.
#[inline]
pub fn bucket_of(key: u128) -> usize {
    (key >> (u128::BITS - BUCKETS.trailing_zeros())) as usize
}

/// The keys of one bucket.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct BucketSum {
    sum: u64,
    /// How many they are.
    pub records: u64,
}

/// The keys of a scan.
#[derive(Debug, Clone, Default)]
pub struct KeySums {
    pub buckets: Vec<BucketSum>,
    /// The keys in any order, and in the order that they have.
    pub of_all: OrderedSum,
}

impl KeySums {
    /// Bytes of a table of buckets.
    pub const BYTES: u64 = (BUCKETS * size_of::<BucketSum>()) as u64;
}

/// Keys that follow each other.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct OrderedSum {
    pub records: u64,
    /// In whatever order.
    pub sum: u128,
    /// A polynomial of which they are the coefficients.
    pub in_order: u128,
}

impl OrderedSum {
    const BYTES: usize = 40;

    #[inline]
    fn add(&mut self, key: u128) {
        self.records += 1;
        self.sum = self.sum.wrapping_add(key);
        self.in_order = self.in_order.wrapping_mul(BASE).wrapping_add(key);
    }

    /// Adds the keys that follow.
    fn followed_by(&mut self, next: &OrderedSum) {
        let (mut power, mut square, mut left) = (1u128, BASE, next.records);
        while left > 0 {
            if left & 1 == 1 {
                power = power.wrapping_mul(square);
            }
            square = square.wrapping_mul(square);
            left >>= 1;
        }
        self.records += next.records;
        self.sum = self.sum.wrapping_add(next.sum);
        self.in_order = self.in_order.wrapping_mul(power).wrapping_add(next.in_order);
    }

    fn write(&self, found: &mut Vec<u8>) {
        found.extend_from_slice(&self.records.to_le_bytes());
        found.extend_from_slice(&self.sum.to_le_bytes());
        found.extend_from_slice(&self.in_order.to_le_bytes());
    }

    fn read(found: &[u8]) -> Option<OrderedSum> {
        let found: &[u8; Self::BYTES] = found.try_into().ok()?;
        let (records, rest) = found.split_first_chunk::<8>()?;
        let (sum, in_order) = rest.split_first_chunk::<16>()?;
        Some(OrderedSum {
            records: u64::from_le_bytes(*records),
            sum: u128::from_le_bytes(*sum),
            in_order: u128::from_le_bytes(in_order.try_into().ok()?),
        })
    }
}

/// Sums the keys of a scan up.
pub struct SumKeys {
    keys: Arc<SideKeys>,
    chosen: Option<Chooser>,
    /// Tables that no thread uses just now.
    tables: Mutex<Vec<Box<[BucketSum]>>>,
    of_all: Mutex<OrderedSum>,
}

impl SumKeys {
    /// Of the records that are `chosen`; of all if none says.
    pub fn new(keys: Arc<SideKeys>, chosen: Option<Chooser>) -> SumKeys {
        SumKeys { keys, chosen, tables: Mutex::default(), of_all: Mutex::default() }
    }

    /// What all records came to.
    pub fn sums(&self) -> KeySums {
        let mut buckets = vec![BucketSum::default(); BUCKETS];
        for table in lock(&self.tables).drain(..) {
            for (all, one) in buckets.iter_mut().zip(&table) {
                all.sum = all.sum.wrapping_add(one.sum);
                all.records += one.records;
            }
        }
        KeySums { buckets, of_all: *lock(&self.of_all) }
    }
}

impl RecordLook for SumKeys {
    fn look(&self, batch: &PointBatch, found: &mut Vec<u8>) -> Result<()> {
        let spare = lock(&self.tables).pop();
        let new = || vec![BucketSum::default(); BUCKETS].into_boxed_slice();
        let mut table = spare.unwrap_or_else(new);
        let chosen = |record: &&[u8]| self.chosen.as_ref().is_none_or(|all| all.holds(record));
        let records = batch.iter().filter(chosen);
        let keys: Vec<u128> = records.map(|record| self.keys.key(record)).collect();
        let mut all = OrderedSum::default();
        keys.iter().for_each(|key| all.add(*key));
        // In a loop of its own, so that the processor waits for many buckets at once.
        for key in keys {
            let bucket = &mut table[bucket_of(key)];
            bucket.sum = bucket.sum.wrapping_add(key as u64);
            bucket.records = bucket.records.wrapping_add(1);
        }
        lock(&self.tables).push(table);
        all.write(found);
        Ok(())
    }

    fn take(&self, found: &[u8]) -> Result<()> {
        let next = OrderedSum::read(found).ok_or_else(|| Error::internal("no sum of keys"))?;
        lock(&self.of_all).followed_by(&next);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum(keys: &[u128]) -> OrderedSum {
        let mut sum = OrderedSum::default();
        keys.iter().for_each(|key| sum.add(*key));
        sum
    }

    #[test]
    fn sums_of_stretches_are_those_of_the_whole_however_it_is_cut() {
        let keys: Vec<u128> = (1..400u128).map(|n| n.wrapping_mul(BASE) ^ (n << 90)).collect();
        let whole = sum(&keys);
        for cut in [0, 1, 7, 128, 399] {
            let mut joined = sum(&keys[..cut]);
            joined.followed_by(&sum(&keys[cut..]));
            assert_eq!(joined, whole);
            let mut bytes = Vec::new();
            joined.write(&mut bytes);
            assert_eq!(OrderedSum::read(&bytes), Some(whole));
        }
        let mut turned = keys.clone();
        turned.swap(3, 300);
        assert_eq!(sum(&turned).sum, whole.sum);
        assert_ne!(sum(&turned).in_order, whole.in_order);
        turned[0] ^= 1;
        assert_ne!(sum(&turned).sum, whole.sum);
        assert_eq!(OrderedSum::read(&[0; 39]), None);
    }
}
