//! Inputs that are wrong.

#[path = "../run_support/mod.rs"]
mod run_support;
#[path = "../scans_support/mod.rs"]
mod scans_support;

mod headers;
mod places;
mod points;
