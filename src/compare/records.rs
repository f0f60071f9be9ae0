//! Are records of two files the same?
//!
//! The original has most of its records for itself, and each of them would be hashed and looked for
//! in a table that no cache holds. A few bits of its first words say of nearly all of them that the
//! reduced scan has none such, in a table so small that it stays near the processor.

use std::sync::Arc;

use crate::geom::hash::Hash;
use crate::point::{Dimension, Schema};

/// By what records of the original and of the reduced scan are compared: equal records have equal
/// keys.
#[derive(Debug, Clone)]
pub(super) struct Comparison {
    pub original: RecordKeys,
    pub reduced: RecordKeys,
    /// The dimensions that one of them does not have.
    pub left_out: Vec<String>,
}

/// What a record is known by.
#[derive(Debug, Clone)]
pub(super) enum RecordKeys {
    /// Its first bytes: all those of the original's records.
    Bytes(usize),
    /// The values of the dimensions that both have.
    Values(Arc<Schema>, Vec<Dimension>),
}

impl Comparison {
    /// The strictest that the two allow.
    pub fn of(original: &Arc<Schema>, reduced: &Arc<Schema>) -> Comparison {
        let same = |one: &Dimension| reduced.find(&one.name) == Some(one);
        let alike = original.endian == reduced.endian
            && original.layout.steps == reduced.layout.steps
            && original.stride <= reduced.stride
            && original.dimensions.iter().all(same);
        if alike {
            let bytes = RecordKeys::Bytes(original.stride);
            return Comparison { original: bytes.clone(), reduced: bytes, left_out: Vec::new() };
        }
        let both = original.dimensions.iter().filter_map(|d| Some((d, reduced.find(&d.name)?)));
        let (of_original, of_reduced) = both.map(|(a, b)| (a.clone(), b.clone())).unzip();
        let only = |one: &Schema, other: &Schema| {
            let names = one.dimensions.iter().map(|d| d.name.clone());
            names.filter(|name| other.find(name).is_none()).collect::<Vec<String>>()
        };
        Comparison {
            original: RecordKeys::Values(original.clone(), of_original),
            reduced: RecordKeys::Values(reduced.clone(), of_reduced),
            left_out: only(original, reduced),
        }
    }
}

impl RecordKeys {
    /// 128 bits that no two different records of any scan are likely to share.
    pub fn key(&self, record: &[u8]) -> u128 {
        match self {
            RecordKeys::Bytes(length) => {
                let (words, rest) = record[..*length].as_chunks::<8>();
                joined(words.iter().map(|word| u64::from_le_bytes(*word)).chain([word(rest)]))
            }
            RecordKeys::Values(schema, dimensions) => {
                joined(dimensions.iter().map(|d| value(d, schema, record)))
            }
        }
    }

    /// Bits of its beginning, quickly: others may share them.
    #[inline]
    fn first_bits(&self, record: &[u8]) -> u64 {
        let (a, b) = match self {
            RecordKeys::Bytes(length) => match record[..*length].as_chunks::<8>() {
                ([a, b, ..], _) => (u64::from_le_bytes(*a), u64::from_le_bytes(*b)),
                ([a], rest) => (u64::from_le_bytes(*a), word(rest)),
                ([], rest) => (word(rest), 0),
            },
            RecordKeys::Values(schema, dimensions) => {
                let value = |n: usize| dimensions.get(n).map_or(0, |d| value(d, schema, record));
                (value(0), value(1))
            }
        };
        (a.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ b).wrapping_mul(0xbf58_476d_1ce4_e5b9)
    }
}

/// Up to 8 bytes, filled up with 0.
#[inline]
fn word(bytes: &[u8]) -> u64 {
    let mut word = [0; 8];
    word[..bytes.len()].copy_from_slice(bytes);
    u64::from_le_bytes(word)
}

/// Adding 0 makes a −0 a 0.
fn value(dimension: &Dimension, schema: &Schema, record: &[u8]) -> u64 {
    (dimension.world(record, schema.endian) + 0.0).to_bits()
}

fn joined(words: impl Iterator<Item = u64>) -> u128 {
    let (mut low, mut high) = (Hash::of(1), Hash::of(2));
    for word in words {
        low = low.and(word);
        high = high.and(word ^ low.value());
    }
    u128::from(high.value()) << 64 | u128::from(low.value())
}

/// What records begin with.
#[derive(Debug)]
pub(super) struct Beginnings {
    words: Vec<u64>,
    /// By how many bits the first bits are longer than a number of the table.
    shift: u32,
}

impl Beginnings {
    /// Bits a record, of which one is set: of others one in nine seems to be there.
    const BITS: usize = 8;

    /// Of `records` records at most.
    pub fn of(records: u64) -> Beginnings {
        let bits = (records as usize * Beginnings::BITS).next_power_of_two().max(64);
        Beginnings { words: vec![0; bits / 64], shift: u64::BITS - bits.trailing_zeros() }
    }

    /// Enters a record.
    pub fn enter(&mut self, keys: &RecordKeys, record: &[u8]) {
        let number = keys.first_bits(record) >> self.shift;
        self.words[(number / 64) as usize] |= 1 << (number % 64);
    }

    /// Fills `found` with the numbers of those `records` that begin as one that was entered, or
    /// seem to.
    pub fn find<'a>(
        &self,
        keys: &RecordKeys,
        records: impl ExactSizeIterator<Item = &'a [u8]>,
        found: &mut Vec<u32>,
    ) {
        // Without a branch, many are waited for at once.
        found.resize(records.len() + 1, 0);
        let mut count = 0;
        for (i, record) in records.enumerate() {
            let number = keys.first_bits(record) >> self.shift;
            found[count] = i as u32;
            count += (self.words[(number / 64) as usize] >> (number % 64) & 1) as usize;
        }
        found.truncate(count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_that_begin_alike_are_told_apart_and_a_table_has_all_that_it_was_given() {
        let keys = RecordKeys::Bytes(19);
        let record = |n: u32, tail: u8| {
            let mut record = [0; 22];
            record[..4].copy_from_slice(&n.to_le_bytes());
            record[8..12].copy_from_slice(&(n / 7).to_le_bytes());
            record[18..].fill(tail);
            record
        };
        assert_eq!(
            keys.key(&record(4, 0)),
            keys.key(&{
                let mut beyond = record(4, 0);
                beyond[19] = 9;
                beyond
            })
        );
        assert_ne!(keys.key(&record(4, 0)), keys.key(&record(4, 1)));
        assert_ne!(keys.key(&record(4, 0)), keys.key(&record(5, 0)));
        let mut begin = Beginnings::of(10_000);
        (0..10_000).for_each(|n| begin.enter(&keys, &record(3 * n, 3)));
        let found = |offset: u32| {
            let records: Vec<[u8; 22]> = (0..10_000).map(|n| record(3 * n + offset, 3)).collect();
            let mut found = Vec::new();
            begin.find(&keys, records.iter().map(|record| &record[..]), &mut found);
            found
        };
        assert_eq!(found(0), (0..10_000).collect::<Vec<u32>>());
        let others = found(1).len();
        assert!((200..2_500).contains(&others), "{others} of 10,000");
        for length in [0, 5, 8, 13, 16] {
            let (short, mut found) = (RecordKeys::Bytes(length), Vec::new());
            let mut begin = Beginnings::of(1);
            begin.enter(&short, &[1; 16]);
            begin.find(&short, [&[1; 16][..]].into_iter(), &mut found);
            assert_eq!(found, [0]);
        }
    }
}
