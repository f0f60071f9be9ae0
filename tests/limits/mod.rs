//! The bounds of memory and disk, each run in a process of its own.

mod bounded;
#[cfg(target_os = "linux")]
mod full_disk;
mod honest_budgets;
