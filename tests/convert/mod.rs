//! The command `convert`, and what becomes of fields, colours and units.

#[path = "../common/mod.rs"]
mod common;
#[path = "../run_support/mod.rs"]
mod run_support;
#[path = "../scans_support/mod.rs"]
mod scans_support;

mod colors;
mod fields;
mod runs;
mod units;
