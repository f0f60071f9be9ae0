//! Formats besides LAS and PLY: what is read of files that others write, what comes back of files
//! that we write, and what is said of those that are wrong.

mod e57;
mod lossless;
mod pcd;
mod scans;
mod text;
mod vertices;

use std::path::Path;

use crate::support::command::pointmill;

/// The points of a file as lines of CSV, below their names; what is told of it otherwise. Standard
/// error but for what is always said.
fn converted(at: &Path, input: &str, more: &[&str]) -> (Vec<String>, String) {
    let arguments = [&["convert", input, "-o", "converted.csv", "--quiet"], more].concat();
    let (code, _, told) = pointmill(at, &arguments);
    assert_eq!(code, 0, "{arguments:?}: {told}");
    let text = std::fs::read_to_string(at.join("converted.csv")).unwrap();
    (text.lines().map(str::to_owned).collect(), told)
}

/// The same without what is told.
fn points(at: &Path, input: &str) -> Vec<String> {
    converted(at, input, &[]).0
}

/// What a conversion warns of.
fn warned(at: &Path, input: &str, more: &[&str]) -> String {
    let arguments = [&["convert", input, "-o", "converted.csv"], more].concat();
    let (code, _, told) = pointmill(at, &arguments);
    assert_eq!(code, 0, "{arguments:?}: {told}");
    told
}
