//! What differs from system to system, and what every room needs of it: the process's memory and
//! its limits, disks, the identity of files, threads. Knows neither points nor runs.

pub(crate) mod disk;
pub(crate) mod files;
pub(crate) mod hashed;
pub mod process;
pub(crate) mod standard;
mod tallies;
pub(crate) mod threads;

pub(crate) use files::{Clash, Files, Use};
#[cfg(test)]
pub(crate) use tallies::written;
pub use threads::{PhaseItems, Threads, lock};
