//! Numbers of bytes: added up and multiplied without ever wrapping around, and shown.

use std::fmt;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Mul};

use serde::Serialize;

const MIB: u64 = 1 << 20;

/// A number of bytes, shown in the largest binary unit: `1.5 GiB`.
///
/// A sum or a product that 64 bits do not hold is [`Bytes::BEYOND`], and so is all that is made of
/// it. A formula therefore needs no checks on its way: its result fits in no memory, and is
/// refused.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Bytes(pub u64);

impl Bytes {
    /// More than any memory.
    pub const BEYOND: Bytes = Bytes(u64::MAX);

    /// Those of `count` items of `each` bytes.
    pub fn of(count: u64, each: usize) -> Bytes {
        Bytes(each as u64) * count
    }

    /// True if a memory of `limit` bytes holds them.
    pub fn fit(self, limit: u64) -> bool {
        self != Bytes::BEYOND && self.0 <= limit
    }

    fn then(self, next: impl Fn(u64) -> Option<u64>) -> Bytes {
        let known = (self != Bytes::BEYOND).then_some(self.0);
        known.and_then(next).map_or(Bytes::BEYOND, Bytes)
    }
}

impl From<usize> for Bytes {
    fn from(bytes: usize) -> Bytes {
        Bytes(bytes as u64)
    }
}

impl Add for Bytes {
    type Output = Bytes;

    fn add(self, more: Bytes) -> Bytes {
        self.then(|bytes| bytes.checked_add(more.0))
    }
}

impl AddAssign for Bytes {
    fn add_assign(&mut self, more: Bytes) {
        *self = *self + more;
    }
}

impl Mul<u64> for Bytes {
    type Output = Bytes;

    fn mul(self, times: u64) -> Bytes {
        self.then(|bytes| bytes.checked_mul(times))
    }
}

impl Sum for Bytes {
    fn sum<I: Iterator<Item = Bytes>>(all: I) -> Bytes {
        all.fold(Bytes(0), Bytes::add)
    }
}

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

/// What there is of something that is too small, rounded down: `137 MiB`, `269.9 MiB`. It differs
/// from what [`whole_mebibytes`] says of more.
pub fn at_most_mebibytes(bytes: u64) -> String {
    match (bytes / MIB, bytes % MIB * 10 / MIB) {
        (0, 0) => format!("{bytes} B"),
        (whole, 0) => format!("{whole} MiB"),
        (whole, tenth) => format!("{whole}.{tenth} MiB"),
    }
}
