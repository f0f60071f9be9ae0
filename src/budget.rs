//! The one place that counts bytes: memory is leased from the budget before it is allocated, each
//! lease under a name, so that a refusal and the report can say who holds how much. Knows no
//! points, and does not measure what a process really takes.

mod bytes;
mod holders;

use std::sync::{Arc, Mutex};

pub use bytes::{Bytes, at_least_mebibytes, at_most_mebibytes, whole_mebibytes};
pub use holders::{Holder, Holders};

use crate::host::lock;
use crate::{Error, Result};

/// A number of bytes that is shared by everything in a run that grows with its settings or its
/// scan. Clones are the same budget.
///
/// What is leased: the work of the threads in the decode, the merge, the mill, the survey and a
/// stream, each with its buffers; the indices of the runs and of the merged scan; points and
/// columns that stay in memory; and what the program holds anyway: its code and statics, stacks of
/// threads, the allocator's slack, headers and VLRs, and small values of fixed size.
///
/// A lease never waits: one that does not fit is refused.
#[derive(Debug, Clone)]
pub struct Budget(Arc<Account>);

#[derive(Debug)]
struct Account {
    limit: u64,
    held: Mutex<Held>,
}

/// Leases are few and large, so that one lock does for all, and what is used is the sum of the
/// names: there is no second figure that could differ from it.
#[derive(Debug, Default)]
struct Held {
    now: Holders,
    /// When the most was held in all.
    at_peak: Holders,
}

impl Budget {
    /// A budget of `limit` bytes.
    pub fn new(limit: u64) -> Self {
        Budget(Arc::new(Account { limit, held: Mutex::default() }))
    }

    /// Leases `bytes` for `what` (a noun that completes "the … needs").
    ///
    /// Fails with [`ErrorKind::Memory`](crate::ErrorKind::Memory) if less is free; the message
    /// names what was asked for, what is free, who holds the rest, and the budget that would do.
    pub fn lease(&self, bytes: u64, what: &'static str) -> Result<Lease> {
        let mut lease = self.open(what);
        lease.grow(bytes)?;
        Ok(lease)
    }

    /// Leases `bytes` for `what`, or nothing if less is free.
    pub fn try_lease(&self, bytes: u64, what: &'static str) -> Option<Lease> {
        let mut lease = self.open(what);
        lease.try_grow(bytes).is_ok().then_some(lease)
    }

    /// Leases all of `parts`, each under its name, or none; fails as [`Budget::lease`] does for
    /// `what`, which they are parts of.
    pub fn lease_all(&self, parts: &Holders, what: &'static str) -> Result<Vec<Lease>> {
        let taken = self.take(parts.each()).map_err(|held| {
            let needed = parts.sum();
            self.refusal(needed, what, &held)
        });
        taken?;
        let lease = |part: &Holder| Lease { budget: self.clone(), part: *part };
        Ok(parts.each().iter().map(lease).collect())
    }

    /// A lease of nothing yet, for `what`.
    pub fn open(&self, what: &'static str) -> Lease {
        Lease { budget: self.clone(), part: Holder { name: what, bytes: Bytes(0) } }
    }

    /// Bytes leased now.
    pub fn used(&self) -> u64 {
        lock(&self.0.held).now.sum().0
    }

    /// Bytes not leased now.
    pub fn free(&self) -> u64 {
        self.0.limit - self.used()
    }

    /// The most bytes that were leased at once.
    pub fn peak(&self) -> u64 {
        self.at_peak().sum().0
    }

    /// Who held how much when the most was leased in all.
    pub fn at_peak(&self) -> Holders {
        lock(&self.0.held).at_peak.clone()
    }

    /// The limit in bytes.
    pub fn limit(&self) -> u64 {
        self.0.limit
    }

    /// Takes all of `parts`; or nothing, and gives who holds what.
    fn take(&self, parts: &[Holder]) -> Result<(), Holders> {
        let mut held = lock(&self.0.held);
        let more: Bytes = parts.iter().map(|part| part.bytes).sum();
        if !(held.now.sum() + more).fit(self.0.limit) {
            return Err(held.now.clone());
        }
        parts.iter().for_each(|part| *held.now.under(part.name) += part.bytes);
        if held.now.sum() > held.at_peak.sum() {
            held.at_peak = held.now.clone();
        }
        Ok(())
    }

    fn give_back(&self, Holder { name, bytes }: Holder) {
        lock(&self.0.held).now.under(name).0 -= bytes.0;
    }

    fn refusal(&self, needed: Bytes, what: &str, held: &Holders) -> Error {
        let used = held.sum();
        let taken = if used > Bytes(0) { format!(": {held} are taken") } else { String::new() };
        Error::memory(format!(
            "the {what} needs {} of memory, but {} of the budget of {} is free{taken}",
            at_least_mebibytes(needed.0),
            at_most_mebibytes(self.0.limit - used.0),
            at_most_mebibytes(self.0.limit)
        ))
        .help(format!("give at least `run.memory = \"{}\"`", whole_mebibytes((used + needed).0)))
    }
}

/// Bytes held of a [`Budget`] under a name; they go back when it is dropped.
#[derive(Debug)]
#[must_use = "the bytes go back as soon as the lease is dropped"]
pub struct Lease {
    budget: Budget,
    part: Holder,
}

impl Lease {
    /// What they are held of.
    pub fn budget(&self) -> &Budget {
        &self.budget
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        self.part.bytes.0
    }

    /// Leases `more` bytes; fails as [`Budget::lease`] does, and then holds what it held.
    pub fn grow(&mut self, more: u64) -> Result<()> {
        let name = self.part.name;
        self.try_grow(more).map_err(|held| self.budget.refusal(Bytes(more), name, &held))
    }

    /// Gives back what is held beyond `bytes`.
    pub fn shrink_to(&mut self, bytes: u64) {
        let less = Bytes(self.bytes().saturating_sub(bytes));
        self.part.bytes.0 -= less.0;
        self.budget.give_back(Holder { bytes: less, ..self.part });
    }

    fn try_grow(&mut self, more: u64) -> Result<(), Holders> {
        self.budget.take(&[Holder { bytes: Bytes(more), ..self.part }])?;
        self.part.bytes += Bytes(more);
        Ok(())
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        self.budget.give_back(self.part);
    }
}

#[cfg(test)]
mod tests;
