//! The command: its arguments, words and events.

#[path = "../scans_support/mod.rs"]
mod scans_support;

mod check;
mod errors;
mod events;
mod names;
mod picture;
mod values;
mod words;
