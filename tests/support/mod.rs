//! What the tests share, compiled once for each of the few programs: made-up and real scans, runs in
//! this process and of the command, files laid out by hand, and what is asserted of all of them.

#![allow(dead_code, reason = "each program uses a part of it")]
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic and tell why")]

pub mod allocator;
pub mod case;
pub mod command;
pub mod folders;
pub mod las;
pub mod las_file;
pub mod laz;
pub mod ply;
pub mod random;
pub mod records;
pub mod runs;
pub mod scan;
pub mod setup;
pub mod tiles;

use std::path::{Path, PathBuf};

/// The folder of real scans that the environment names. A test that asks for it is ignored unless it
/// is run by name or with `--ignored`, and fails where there is no such folder: none passes empty.
pub fn scans() -> PathBuf {
    let folder = std::env::var_os("POINTMILL_SCANS").map(PathBuf::from);
    let folder = folder.expect("POINTMILL_SCANS names the folder of real scans");
    assert!(folder.join("MANIFEST.tsv").is_file(), "{} has no MANIFEST.tsv", folder.display());
    folder
}

/// A file of `tests/cases`.
pub fn case_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases").join(name)
}

/// Names where two files first differ.
pub fn assert_same(a: &[u8], b: &[u8], what: &str) {
    if a != b {
        let at = a.iter().zip(b).position(|(x, y)| x != y).unwrap_or(a.len().min(b.len()));
        panic!("{what}: {} and {} bytes differ at byte {at}", a.len(), b.len());
    }
}

/// Asserts that a folder holds `names` and nothing else.
pub fn assert_holds(folder: &Path, names: &[&str]) {
    let name = |e: std::io::Result<std::fs::DirEntry>| e.unwrap().file_name();
    let mut there: Vec<_> = std::fs::read_dir(folder).unwrap().map(name).collect();
    there.sort();
    let mut names: Vec<std::ffi::OsString> = names.iter().map(Into::into).collect();
    names.sort();
    assert_eq!(there, names, "in {}", folder.display());
}
