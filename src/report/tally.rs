//! What stages count while they work.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::ClassCounts;
use super::stats::StatsTally;

/// The count of records that were written with the key-point flag that a stage set.
pub const KEY_POINTS: &str = "key_points";

/// The name of a count: of the program's own, or read again from where it was written.
type Name = Cow<'static, str>;

/// Counts that an item of work reports, such as a tile or a part of the input; merged by addition,
/// so that order does not matter. Written down in any form of `serde` and read again, it is the
/// same.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    /// Counts that are the same for every configuration, by name; they go into `result`.
    pub counts: BTreeMap<Name, u64>,
    /// Counts that depend on how the work was cut up, by name; they go into `run`.
    pub work: BTreeMap<Name, u64>,
    /// Records removed, by stage kind and reason.
    #[serde(serialize_with = "as_list", deserialize_with = "from_list")]
    pub removed: BTreeMap<(String, Name), u64>,
    /// Selections that a record is in, a bit each.
    pub(crate) selections: u8,
    /// What stages count of the points that come by, by the name of the stage.
    pub(crate) stats: BTreeMap<String, StatsTally>,
    /// The name of the stage that counts now.
    #[serde(skip)]
    pub(crate) stage: Arc<str>,
    /// Records by class; None where they have none.
    pub(crate) classes: Option<ClassCounts>,
    /// How far apart unequal coordinates are that share a position; None where there are none.
    pub(crate) apart: Option<Apart>,
}

/// How far apart points of unequal coordinates are that share a position of the lattice, in world
/// units. Written down as the bits of both figures, since decimals may lose the last.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(into = "[u64; 2]", from = "[u64; 2]")]
pub struct Apart {
    /// The least difference in one coordinate that was met.
    pub nearest: f64,
    /// The largest distance that there may be.
    pub farthest: f64,
}

/// Writes the entries of a map as a list: in JSON only texts can be keys.
fn as_list<S: Serializer>(
    removed: &BTreeMap<(String, Name), u64>,
    into: S,
) -> Result<S::Ok, S::Error> {
    into.collect_seq(removed)
}

fn from_list<'a, D: Deserializer<'a>>(from: D) -> Result<BTreeMap<(String, Name), u64>, D::Error> {
    Ok(Vec::deserialize(from)?.into_iter().collect())
}

impl From<Apart> for [u64; 2] {
    fn from(apart: Apart) -> Self {
        [apart.nearest.to_bits(), apart.farthest.to_bits()]
    }
}

impl From<[u64; 2]> for Apart {
    fn from([nearest, farthest]: [u64; 2]) -> Self {
        Apart { nearest: f64::from_bits(nearest), farthest: f64::from_bits(farthest) }
    }
}

impl Apart {
    /// That of the points of both.
    pub fn with(self, other: Apart) -> Apart {
        Apart {
            nearest: self.nearest.min(other.nearest),
            farthest: self.farthest.max(other.farthest),
        }
    }
}

impl Tally {
    /// Adds `n` to the count `name` of `result`. Count each position once: in the core of its tile.
    pub fn count(&mut self, name: &'static str, n: u64) {
        *self.counts.entry(name.into()).or_default() += n;
    }

    /// Adds `n` to the count `name` of `run`.
    pub fn work(&mut self, name: &'static str, n: u64) {
        *self.work.entry(name.into()).or_default() += n;
    }

    /// Enters `n` records as removed by `stage` for `reason`.
    pub fn remove(&mut self, stage: &str, reason: &'static str, n: u64) {
        if n > 0 {
            *self.removed.entry((stage.to_owned(), reason.into())).or_default() += n;
        }
    }

    /// What the stage that counts now has counted of the points that came by.
    pub(crate) fn own_stats(&mut self) -> &mut StatsTally {
        self.stats.entry(self.stage.to_string()).or_default()
    }

    /// Adds another tally.
    pub fn merge(&mut self, other: &Tally) {
        for (name, n) in &other.counts {
            *self.counts.entry(name.clone()).or_default() += n;
        }
        for (name, n) in &other.work {
            *self.work.entry(name.clone()).or_default() += n;
        }
        for (key, n) in &other.removed {
            *self.removed.entry(key.clone()).or_default() += n;
        }
        for (name, stats) in &other.stats {
            self.stats.entry(name.clone()).or_default().merge(stats);
        }
        self.selections |= other.selections;
        let apart = [self.apart, other.apart].into_iter().flatten();
        self.apart = apart.reduce(Apart::with);
        if let Some(classes) = &other.classes {
            self.classes.get_or_insert_default().merge(classes);
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_tally_can_be_written_down_and_read_again() {
        let mut tally = Tally::default();
        tally.count("cells", 3);
        tally.remove("median", "not median", 4);
        tally.apart = Some(Apart { nearest: 0.1 + 0.2, farthest: 1e22 / 3.0 });
        tally.classes = Some(ClassCounts::default());
        let written = serde_json::to_value(&tally).unwrap();
        assert_eq!(written["counts"], json!({ "cells": 3 }));
        assert_eq!(written["removed"], json!([[["median", "not median"], 4]]));
        assert_eq!(written["classes"].as_array().map(Vec::len), Some(256));
        assert_eq!(serde_json::from_str::<Tally>(&written.to_string()).unwrap(), tally);
    }
}
