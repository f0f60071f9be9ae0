//! The largest angle that leaves a given number of records.

use serde_json::Value;

use super::entry::{self, Entry};
use super::limit::{Limit, Ties};
use super::target::Keep;
use crate::geom::angle::MaxAngle;
use crate::stage::Gathered;
use crate::{Error, Result};

/// Bits of the ranges that a walk over all divisions tells apart.
const BITS: u32 = 16;

/// Which divisions leave the number of records asked for.
#[derive(Debug, Clone)]
pub(super) struct Threshold {
    limit: Limit,
    /// Records asked for.
    target: u64,
    /// Records that are left.
    kept: u64,
    /// True if all divisions are made and leave fewer than asked for.
    is_all: bool,
}

impl Threshold {
    /// Of all divisions in order of their ranges, the widest first, and of equal ones in canonical
    /// order, makes as many as leave no more records than `keep` says, or than `auto` where that is
    /// left to the scan. Walks what was found five times.
    pub(super) fn find(found: &dyn Gathered, keep: Keep, auto: Option<u64>) -> Result<Self> {
        let mut target = auto.unwrap_or_else(|| keep.of(found.records()));
        let (mut least, mut more) = (0, 0);
        entry::each(found, |entry| match entry {
            Entry::Kept(records) => least += records,
            Entry::Cell(_) => {}
            Entry::Division { parts, .. } => more += parts,
        })?;
        if target < least && auto.is_none() {
            return Err(too_few(keep, target, least));
        }
        target = target.max(least);
        let mut left = target - least;
        if more <= left {
            let limit = Limit { max_angle: MaxAngle::NONE, ties: None };
            return Ok(Threshold { limit, target, kept: least + more, is_all: more < left });
        }
        let key = first_beyond(found, &mut left)?;
        let ties = ties(found, key, &mut left)?;
        let limit = Limit { max_angle: MaxAngle::of_cosine(entry::cosine(key)), ties };
        Ok(Threshold { limit, target, kept: target - left, is_all: false })
    }

    /// The divisions.
    pub(super) fn limit(&self) -> Limit {
        self.limit
    }

    /// Says that fewer records stay than asked for.
    pub(super) fn warning(&self, keep: Keep) -> Option<String> {
        let Threshold { target, kept, .. } = *self;
        self.is_all.then(|| {
            format!(
                "{}, and {kept} stay however small the angle: cells whose normals are equal, or \
                 that are no larger than `cells.min_spacing` and `cells.min_points` say, are not \
                 divided",
                asked(keep, target)
            )
        })
    }

    /// The largest angle in radians, and how many records are left.
    pub(super) fn decisions(&self) -> Vec<(String, Value)> {
        let mut said: Vec<(String, Value)> = vec![
            ("max_angle".into(), self.limit.max_angle.radians().into()),
            ("kept_target".into(), self.target.into()),
            ("kept".into(), self.kept.into()),
        ];
        if self.is_all {
            said.push(("kept_at_most".into(), self.kept.into()));
        }
        said
    }
}

/// What was asked for.
fn asked(keep: Keep, target: u64) -> String {
    match keep {
        Keep::Records(_) => format!("`cells.keep` asks for {target} records"),
        Keep::Share(_) | Keep::Auto => {
            format!("`cells.keep` asks for {keep}, which is {target} records")
        }
    }
}

fn too_few(keep: Keep, target: u64, least: u64) -> Error {
    let told = asked(keep, target);
    Error::pipeline(format!(
        "{told}, and {least} stay however large the angle: one of every cell that must not be \
         larger, and one of every position without a normal"
    ))
    .help(format!("keep {least} or more, or give a larger `cells.side` (and `cells.max_side`)"))
}

/// The widest range whose divisions cannot all be made if `left` records more are to be left; takes
/// off those that the wider ones add. There is one.
fn first_beyond(found: &dyn Gathered, left: &mut u64) -> Result<u64> {
    let mut prefix = 0;
    let mut bins = vec![0u64; 1 << BITS];
    for shift in (0..u64::BITS / BITS).rev().map(|digit| digit * BITS) {
        bins.fill(0);
        entry::each(found, |entry| {
            if let Entry::Division { key, parts } = entry
                && (key >> shift) >> BITS == prefix
            {
                bins[(key >> shift) as usize & ((1 << BITS) - 1)] += parts;
            }
        })?;
        let mut digit = 0;
        while bins.get(digit).is_some_and(|more| more <= left) {
            *left -= bins[digit];
            digit += 1;
        }
        prefix = prefix << BITS | digit as u64;
    }
    Ok(prefix)
}

/// Where the divisions of the range `key` end if `left` records more are to be left, in the order
/// they were found in; takes off those that they add. None if not even the first is made.
fn ties(found: &dyn Gathered, key: u64, left: &mut u64) -> Result<Option<Ties>> {
    let mut ties: Option<Ties> = None;
    let mut cell = None;
    let mut is_over = false;
    entry::each(found, |entry| match entry {
        Entry::Kept(_) => {}
        Entry::Cell(first) => cell = Some(first),
        Entry::Division { key: k, parts } if k == key && !is_over => {
            is_over = parts > *left;
            if let (false, Some(last)) = (is_over, cell) {
                *left -= parts;
                let made = ties.filter(|ties| ties.last == last).map_or(0, |ties| ties.made);
                ties = Some(Ties { last, made: made + 1 });
            }
        }
        Entry::Division { .. } => {}
    })?;
    Ok(ties)
}
