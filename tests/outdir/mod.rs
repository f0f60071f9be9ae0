//! Outputs in folders, one for each input.

mod io;
mod run;
mod split;
mod squares;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::support::case::execute;
use pointmill::report::Report;
use pointmill::{Overrides, Quiet, Result};

/// Reads `input`, does `stages` and writes with the keys `write`; what the run says.
fn run(run: &str, input: &Path, stages: &str, write: &str) -> Result<Report> {
    let text = format!(
        "[run]\n{run}\n[[stage]]\nkind = 'read'\npath = '{}'\n{stages}\n[[stage]]\nkind = \
         'write'\n{write}\n",
        input.display()
    );
    Ok(execute(&text, &Overrides::default(), &Quiet)?.report)
}

/// The files of a folder, by name.
fn files(folder: &Path) -> BTreeMap<String, PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    entries.map(|entry| (entry.file_name().into_string().unwrap(), entry.path())).collect()
}
