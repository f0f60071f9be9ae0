//! Who holds how much memory, or needs it: the parts of a plan, of a refusal and of a peak.

use std::cmp::Reverse;
use std::fmt;

use serde::Serialize;

use super::bytes::Bytes;

/// Memory that is held, or needed, under one name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Holder {
    /// What it is for.
    pub name: &'static str,
    /// How much.
    pub bytes: Bytes,
}

/// Memory by name, each name once. Displayed as its largest parts, for a sentence: `60 MiB for the
/// index, 2.5 MiB for the rest`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Holders(Vec<Holder>);

/// Parts that are displayed one by one; more would be no sentence.
const SHOWN: usize = 5;

impl Holders {
    /// All of these together.
    pub fn of(all: impl IntoIterator<Item = (&'static str, Bytes)>) -> Holders {
        let mut holders = Holders::default();
        all.into_iter().for_each(|(name, bytes)| *holders.under(name) += bytes);
        holders
    }

    /// These and `others` together.
    #[must_use]
    pub fn with(mut self, others: &Holders) -> Holders {
        others.0.iter().for_each(|other| *self.under(other.name) += other.bytes);
        self
    }

    /// So many times as much of each.
    #[must_use]
    pub fn times(mut self, times: u64) -> Holders {
        self.0.iter_mut().for_each(|holder| holder.bytes = holder.bytes * times);
        self
    }

    /// These, or `other` if it is more in all.
    #[must_use]
    pub fn larger(self, other: Holders) -> Holders {
        if other.sum() > self.sum() { other } else { self }
    }

    /// What all hold together.
    pub fn sum(&self) -> Bytes {
        self.0.iter().map(|holder| holder.bytes).sum()
    }

    /// The largest, at most so many, of those that hold anything; the largest first.
    pub fn largest(&self, most: usize) -> Vec<Holder> {
        let mut sorted: Vec<Holder> =
            self.0.iter().copied().filter(|holder| holder.bytes > Bytes(0)).collect();
        sorted.sort_by_key(|holder| (Reverse(holder.bytes), holder.name));
        sorted.truncate(most);
        sorted
    }

    /// Each, as it came.
    pub(super) fn each(&self) -> &[Holder] {
        &self.0
    }

    /// What is held under a name.
    pub(super) fn under(&mut self, name: &'static str) -> &mut Bytes {
        let at = self.0.iter().position(|holder| holder.name == name);
        let at = at.unwrap_or_else(|| {
            self.0.push(Holder { name, bytes: Bytes(0) });
            self.0.len() - 1
        });
        &mut self.0[at].bytes
    }
}

impl fmt::Display for Holders {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sorted = self.largest(usize::MAX);
        let (shown, rest) = sorted.split_at(SHOWN.min(sorted.len()));
        let rest = Holder { name: "rest", bytes: rest.iter().map(|holder| holder.bytes).sum() };
        let rest = Some(rest).filter(|rest| rest.bytes > Bytes(0));
        for (n, Holder { name, bytes }) in shown.iter().chain(&rest).enumerate() {
            write!(f, "{}{bytes} for the {name}", if n == 0 { "" } else { ", " })?;
        }
        Ok(())
    }
}
