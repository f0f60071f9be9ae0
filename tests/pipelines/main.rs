//! Pipeline files: their text, values, and the files that they name.

#[path = "../run_support/mod.rs"]
mod run_support;
#[path = "../scans_support/mod.rs"]
mod scans_support;

mod formats;
mod inputs;
mod text;
mod user_files;
mod values;
mod words;
