//! What is seen of a stage while it works, and kept for the check.

use std::sync::{Mutex, PoisonError};

use super::promise::Promise;

/// Bytes that a call may hold besides what its stage declares for each position: lists of fixed
/// size, entries of a tally.
const FREE: u64 = 64 << 10;
/// The same where no position is at hand that memory could be declared for: a batch of a stage that
/// streams, what a stage settles. A run sets so much aside for each thread.
pub(super) const FREE_OF_STREAM: u64 = 1 << 20;

/// A promise that did not hold, and what was seen.
#[derive(Debug, Clone)]
pub(super) struct Violation {
    pub promise: Promise,
    pub told: String,
}

/// The call of a stage that took the most memory.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct MemoryTaken {
    /// Positions of its tile, or records of its batch.
    pub points: u64,
    /// Bytes that the stage declares for so many.
    pub declared_bytes: u64,
    /// Bytes that the call held at most, beyond those before it.
    pub taken_bytes: u64,
}

/// What is seen of a stage in one run.
#[derive(Debug, Default)]
pub(super) struct Witness {
    first: Mutex<Option<Violation>>,
    memory: Mutex<MemoryTaken>,
    /// False where calls may hold what is not the stage's: a search beyond a tile.
    measures: bool,
}

impl Witness {
    pub fn new(measures: bool) -> Witness {
        Witness { measures, ..Witness::default() }
    }

    /// Keeps a violation, if it is the first.
    pub fn tell(&self, promise: Promise, told: impl Into<String>) {
        let mut first = self.first.lock().unwrap_or_else(PoisonError::into_inner);
        first.get_or_insert_with(|| Violation { promise, told: told.into() });
    }

    /// Enters what a call that works on a tile took.
    pub fn took(&self, points: usize, bytes_per_point: usize, taken_bytes: u64) {
        let points = points as u64;
        let declared_bytes = points.saturating_mul(bytes_per_point as u64);
        self.enter(MemoryTaken { points, declared_bytes, taken_bytes }, FREE);
    }

    /// Enters what a call took that works on a batch, or on none.
    pub fn took_besides(&self, points: usize, taken_bytes: u64) {
        let taken = MemoryTaken { points: points as u64, declared_bytes: 0, taken_bytes };
        self.enter(taken, FREE_OF_STREAM);
    }

    /// Enters what a call took that concludes about `points`, and whose stage declares so many
    /// bytes for each of them and besides.
    pub fn took_of_scan(&self, points: u64, (each, besides): (usize, u64), taken_bytes: u64) {
        let declared_bytes = points.saturating_mul(each as u64).saturating_add(besides);
        self.enter(MemoryTaken { points, declared_bytes, taken_bytes }, FREE_OF_STREAM);
    }

    fn enter(&self, taken: MemoryTaken, free: u64) {
        if !self.measures {
            return;
        }
        let MemoryTaken { points, declared_bytes, taken_bytes } = taken;
        if taken_bytes > declared_bytes.saturating_add(free) {
            let told = format!(
                "it worked with {taken_bytes} bytes on {points} points, declares {declared_bytes} \
                 for them, and may have {free} besides"
            );
            self.tell(Promise::Memory, told);
        }
        let mut most = self.memory.lock().unwrap_or_else(PoisonError::into_inner);
        if taken_bytes > most.taken_bytes {
            *most = taken;
        }
    }

    /// The first violation.
    pub fn violation(&self) -> Option<Violation> {
        self.first.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The call that took the most memory.
    pub fn memory(&self) -> MemoryTaken {
        *self.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
