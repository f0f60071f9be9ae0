//! The one place that counts bytes: memory is leased from the budget before it is allocated.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::{Error, Result};

const MIB: u64 = 1 << 20;

/// A number of bytes that is shared by everything in a run that grows with its settings or its scan.
/// Clones are the same budget.
///
/// What is leased: the work of the threads in the decode, the merge, the mill, the survey and a
/// stream, each with its buffers; the indices of the runs and of the merged scan; points and columns
/// that stay in memory; and, as one sum, what the program holds anyway: its code and statics, stacks
/// of threads, the allocator's slack, headers and VLRs, and small values of fixed size.
///
/// A lease never waits: one that does not fit is refused.
#[derive(Debug, Clone)]
pub struct Budget(Arc<Account>);

#[derive(Debug)]
struct Account {
    limit: u64,
    used: AtomicU64,
    peak: AtomicU64,
}

impl Budget {
    /// A budget of `limit` bytes.
    pub fn new(limit: u64) -> Self {
        Budget(Arc::new(Account { limit, used: AtomicU64::new(0), peak: AtomicU64::new(0) }))
    }

    /// Leases `bytes` for `what` (a noun that completes "the … needs").
    ///
    /// Fails with [`ErrorKind::Memory`](crate::ErrorKind::Memory) if less is free; the message names
    /// what was asked for, what is free, and the budget that would do.
    pub fn lease(&self, bytes: u64, what: &'static str) -> Result<Lease> {
        self.try_lease(bytes, what).ok_or_else(|| self.refusal(bytes, what))
    }

    /// Leases `bytes` for `what`, or nothing if less is free.
    pub fn try_lease(&self, bytes: u64, what: &'static str) -> Option<Lease> {
        self.take(bytes).then(|| Lease { budget: self.clone(), bytes, what })
    }

    /// Bytes leased now.
    pub fn used(&self) -> u64 {
        self.0.used.load(Ordering::Relaxed)
    }

    /// Bytes not leased now.
    pub fn free(&self) -> u64 {
        self.0.limit.saturating_sub(self.used())
    }

    /// The most bytes that were leased at once.
    pub fn peak(&self) -> u64 {
        self.0.peak.load(Ordering::Relaxed)
    }

    /// The limit in bytes.
    pub fn limit(&self) -> u64 {
        self.0.limit
    }

    fn take(&self, bytes: u64) -> bool {
        let within = |used: u64| used.checked_add(bytes).filter(|&sum| sum <= self.0.limit);
        // Only counters: no other memory is ordered by them.
        match self.0.used.fetch_update(Ordering::Relaxed, Ordering::Relaxed, within) {
            Ok(before) => {
                self.0.peak.fetch_max(before + bytes, Ordering::Relaxed);
                true
            }
            Err(_) => false,
        }
    }

    fn give_back(&self, bytes: u64) {
        self.0.used.fetch_sub(bytes, Ordering::Relaxed);
    }

    fn refusal(&self, bytes: u64, what: &str) -> Error {
        let used = self.used();
        let enough = used.saturating_add(bytes);
        Error::memory(format!(
            "the {what} needs {} of memory, but {} of the budget of {} is free",
            at_least_mebibytes(bytes),
            at_most_mebibytes(self.0.limit.saturating_sub(used)),
            at_most_mebibytes(self.0.limit)
        ))
        .help(format!("give at least `run.memory = \"{}\"`", whole_mebibytes(enough)))
    }
}

/// Bytes held of a [`Budget`]; they go back when it is dropped.
#[derive(Debug)]
#[must_use = "the bytes go back as soon as the lease is dropped"]
pub struct Lease {
    budget: Budget,
    bytes: u64,
    what: &'static str,
}

impl Lease {
    /// What they are held of.
    pub fn budget(&self) -> &Budget {
        &self.budget
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Leases `more` bytes; fails as [`Budget::lease`] does, and then holds what it held.
    pub fn grow(&mut self, more: u64) -> Result<()> {
        if !self.budget.take(more) {
            return Err(self.budget.refusal(more, self.what));
        }
        self.bytes += more;
        Ok(())
    }

    /// Gives `less` bytes back, at most what is held.
    pub fn shrink(&mut self, less: u64) {
        let less = less.min(self.bytes);
        self.bytes -= less;
        self.budget.give_back(less);
    }

    /// Grows or shrinks to `bytes`; fails as [`Lease::grow`] does.
    pub fn resize(&mut self, bytes: u64) -> Result<()> {
        match bytes.checked_sub(self.bytes) {
            Some(more) => self.grow(more),
            None => {
                self.shrink(self.bytes - bytes);
                Ok(())
            }
        }
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        self.budget.give_back(self.bytes);
    }
}

/// A number of bytes in the largest binary unit, to read: `1.5 GiB`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bytes(pub u64);

impl fmt::Display for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let units = [(40, "TiB"), (30, "GiB"), (20, "MiB"), (10, "KiB")];
        match units.into_iter().find(|&(bits, _)| self.0 >> bits > 0) {
            None => write!(f, "{} B", self.0),
            Some((bits, unit)) => {
                let value = self.0 as f64 / (1u64 << bits) as f64;
                let decimals = usize::from(value < 100.0 && value != value.trunc());
                write!(f, "{value:.decimals$} {unit}")
            }
        }
    }
}

/// A budget as it is typed, rounded up: `137MiB`.
pub fn whole_mebibytes(bytes: u64) -> String {
    format!("{}MiB", bytes.div_ceil(MIB).max(1))
}

/// The same in a sentence: `137 MiB`.
pub fn at_least_mebibytes(bytes: u64) -> String {
    format!("{} MiB", bytes.div_ceil(MIB).max(1))
}

/// What there is of something that is too small, rounded down: `137 MiB`, `269.9 MiB`. It differs from
/// what [`whole_mebibytes`] says of more.
pub fn at_most_mebibytes(bytes: u64) -> String {
    match (bytes / MIB, bytes % MIB * 10 / MIB) {
        (0, 0) => format!("{bytes} B"),
        (whole, 0) => format!("{whole} MiB"),
        (whole, tenth) => format!("{whole}.{tenth} MiB"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorKind;

    #[test]
    fn a_lease_is_returned_on_drop() {
        let budget = Budget::new(100);
        let a = budget.lease(60, "tile").unwrap();
        let b = budget.clone().lease(40, "index").unwrap();
        assert_eq!((budget.used(), budget.free(), budget.limit()), (100, 0, 100));
        drop(a);
        assert_eq!((budget.used(), b.bytes()), (40, 40));
        drop(b);
        assert_eq!((budget.used(), budget.peak()), (0, 100));
    }

    #[test]
    fn a_refusal_names_what_was_asked_what_is_free_and_what_would_do() {
        let budget = Budget::new(128 * MIB);
        let _held = budget.lease(100 * MIB, "index").unwrap();
        let error = budget.lease(40 * MIB + 1, "tile").unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Memory);
        assert_eq!(
            error.to_string(),
            "the tile needs 41 MiB of memory, but 28 MiB of the budget of 128 MiB is free"
        );
        assert_eq!(error.remedy(), Some("give at least `run.memory = \"141MiB\"`"));
        assert_eq!(budget.used(), 100 * MIB);
    }

    #[test]
    fn the_budget_that_a_refusal_names_would_do() {
        let budget = Budget::new(10);
        let error = budget.lease(3 * MIB, "tile").unwrap_err();
        assert_eq!(error.remedy(), Some("give at least `run.memory = \"3MiB\"`"));
        assert!(Budget::new(3 * MIB).lease(3 * MIB, "tile").is_ok());
    }

    #[test]
    fn sums_beyond_u64_are_refused_and_do_not_wrap() {
        let budget = Budget::new(u64::MAX);
        let mut lease = budget.lease(u64::MAX - 1, "tile").unwrap();
        assert!(budget.try_lease(2, "tile").is_none());
        assert!(lease.grow(u64::MAX).is_err());
        assert_eq!(lease.bytes(), u64::MAX - 1);
    }

    #[test]
    fn a_lease_grows_and_shrinks_within_the_budget() {
        let budget = Budget::new(100);
        let mut lease = budget.lease(10, "cache").unwrap();
        lease.grow(90).unwrap();
        assert!(lease.grow(1).is_err());
        lease.shrink(30);
        assert_eq!((lease.bytes(), budget.used()), (70, 70));
        lease.resize(20).unwrap();
        lease.resize(25).unwrap();
        assert_eq!((lease.bytes(), budget.used()), (25, 25));
        lease.shrink(1000);
        assert_eq!((lease.bytes(), budget.used()), (0, 0));
    }

    #[test]
    fn threads_never_hold_more_than_the_limit() {
        let budget = Budget::new(1000);
        let refused = AtomicU64::new(0);
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for i in 0..10_000 {
                        match budget.try_lease(300 + i % 7, "tile") {
                            Some(lease) => drop(lease),
                            None => _ = refused.fetch_add(1, Ordering::Relaxed),
                        }
                        assert!(budget.used() <= 1000);
                    }
                });
            }
        });
        assert_eq!(budget.used(), 0);
        assert!((300..=1000).contains(&budget.peak()));
    }

    #[test]
    fn bytes_are_shown_in_the_largest_unit() {
        let text =
            [0, 1023, 1024, 1536, 200 * MIB + 300_000, 3 << 39].map(|n| Bytes(n).to_string());
        assert_eq!(text, ["0 B", "1023 B", "1 KiB", "1.5 KiB", "200 MiB", "1.5 TiB"]);
    }

    #[test]
    fn what_is_refused_never_reads_like_what_is_needed() {
        for limit in [1, MIB - 1, MIB, 269 * MIB + 999_999, 270 * MIB - 1, u64::MAX - 1] {
            let number = |text: &str| text.split([' ', 'M']).next().unwrap().to_owned();
            let (less, enough) = (at_most_mebibytes(limit), whole_mebibytes(limit + 1));
            assert!(less.ends_with(" B") || number(&less) != number(&enough), "{less} {enough}");
        }
        assert_eq!(at_most_mebibytes(270 * MIB - 1), "269.9 MiB");
        assert_eq!(at_most_mebibytes(256 * MIB), "256 MiB");
    }
}
