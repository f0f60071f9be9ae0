//! Are records of two files the same?

use std::sync::Arc;

use crate::geom::hash::Hash;
use crate::point::{Dimension, Schema};

/// By what records of the original and of the reduced scan are compared.
#[derive(Debug, Clone)]
pub(super) enum Comparison {
    /// Their first bytes: all those of the original's records.
    Bytes(usize),
    /// The values of the dimensions that both have.
    Values {
        original: (Arc<Schema>, Vec<Dimension>),
        reduced: (Arc<Schema>, Vec<Dimension>),
        /// The dimensions that one of them does not have.
        left_out: Vec<String>,
    },
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
            return Comparison::Bytes(original.stride);
        }
        let both = original.dimensions.iter().filter_map(|d| Some((d, reduced.find(&d.name)?)));
        let (of_original, of_reduced) = both.map(|(a, b)| (a.clone(), b.clone())).unzip();
        let only = |one: &Schema, other: &Schema| {
            let names = one.dimensions.iter().map(|d| d.name.clone());
            names.filter(|name| other.find(name).is_none()).collect::<Vec<String>>()
        };
        Comparison::Values {
            original: (original.clone(), of_original),
            reduced: (reduced.clone(), of_reduced),
            left_out: only(original, reduced),
        }
    }

    /// What a record of the reduced scan is known by.
    pub fn of_reduced(&self, record: &[u8]) -> u128 {
        match self {
            Comparison::Bytes(length) => by_bytes(&record[..*length]),
            Comparison::Values { reduced, .. } => by_values(reduced, record),
        }
    }

    /// What a record of the original is known by: equal records by the same.
    pub fn of_original(&self, record: &[u8]) -> u128 {
        match self {
            Comparison::Bytes(length) => by_bytes(&record[..*length]),
            Comparison::Values { original, .. } => by_values(original, record),
        }
    }
}

fn by_bytes(record: &[u8]) -> u128 {
    let (words, rest) = record.as_chunks::<8>();
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    let words = words.iter().chain([&last]).map(|word| u64::from_le_bytes(*word));
    joined(words)
}

fn by_values((schema, dimensions): &(Arc<Schema>, Vec<Dimension>), record: &[u8]) -> u128 {
    // Adding 0 makes a −0 a 0.
    joined(dimensions.iter().map(|d| (d.world(record, schema.endian) + 0.0).to_bits()))
}

/// 128 bits that no two records of any scan are likely to share.
fn joined(words: impl Iterator<Item = u64>) -> u128 {
    let (mut low, mut high) = (Hash::of(1), Hash::of(2));
    for word in words {
        low = low.and(word);
        high = high.and(word ^ low.value());
    }
    u128::from(high.value()) << 64 | u128::from(low.value())
}
