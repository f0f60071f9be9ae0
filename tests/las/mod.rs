//! LAS and LAZ files.

#[path = "../common/mod.rs"]
mod common;
#[path = "../las_support/mod.rs"]
mod las_support;
#[path = "../scans_support/mod.rs"]
mod scans_support;

mod formats;
mod holes;
mod merge;
mod metadata;
mod scans;
mod verify;
