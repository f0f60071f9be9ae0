//! Stages against brute force and at their limits.

#[path = "../common/mod.rs"]
mod common;
#[path = "../las_support/mod.rs"]
mod las_support;
#[path = "../run_support/mod.rs"]
mod run_support;
#[path = "../stages_support/mod.rs"]
mod stages_support;

mod bad_luck;
mod classes;
mod exact;
mod extremes;
mod grid;
mod orders;
mod outliers;
mod run;
mod tiles;
mod unread;
