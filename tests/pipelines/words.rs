//! The words of messages: the library names settings as a pipeline file has them, and only settings
//! that there are; flags are for the command line to tell.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use pointmill::{Registry, TableDescription};

fn sources(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => sources(&path, into),
            false if path.extension().is_some_and(|e| e == "rs") => into.push(path),
            false => {}
        }
    }
}

/// The lines of the library's code that hold a text, each with its place; comments aside.
fn texts() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    sources(&root.join("src"), &mut files);
    files.retain(|file| !file.starts_with(root.join("src/cli")));
    let mut lines = Vec::new();
    for file in &files {
        let code = fs::read_to_string(file).unwrap();
        for (i, line) in code.lines().enumerate() {
            let line = line.trim_start();
            if !line.starts_with("//") {
                let name = file.strip_prefix(root).unwrap().display();
                lines.push((format!("{name}:{}", i + 1), line.to_owned()));
            }
        }
    }
    assert!(files.len() > 100 && lines.len() > 10_000, "{} files", files.len());
    lines
}

/// The settings that there are, as `--set` takes them.
fn settings() -> BTreeSet<String> {
    let registry = Registry::builtin();
    let kinds = registry.kinds().filter_map(|(kind, _)| registry.describe(kind));
    let tables: Vec<_> = kinds.chain([registry.describe_run()]).collect();
    let of = |table: &TableDescription| -> Vec<String> {
        table.all_keys().map(|key| format!("{}.{}", table.name, key.name)).collect()
    };
    tables.iter().flat_map(of).collect()
}

#[test]
fn the_library_names_no_flag() {
    let is_flag = |text: &str| {
        text.match_indices("--").any(|(at, _)| {
            let end = |c: char| !(c.is_ascii_lowercase() || c == '-' || c == '.');
            let name = text[at + 2..].split(end).next().unwrap_or_default();
            // Those of PDAL have a dot.
            !name.is_empty() && !name.contains('.')
        })
    };
    assert!(is_flag("give --memory") && !is_flag("--writers.las.extra_dims=A"));
    for (place, line) in texts() {
        // `Set` reads the text of `--set`, and is named by it.
        if !place.starts_with("src/language/set.rs") {
            assert!(!is_flag(&line), "{place} names a flag: {line}");
        }
    }
}

#[test]
fn every_setting_that_a_message_names_exists() {
    let settings = settings();
    let kinds: BTreeSet<&str> =
        settings.iter().filter_map(|s| Some(s.split_once('.')?.0)).collect();
    let mut named = 0;
    for (place, line) in texts() {
        for part in line.split('`').skip(1) {
            let address = part.split(" = ").next().unwrap();
            let Some((kind, key)) = address.split_once('.') else { continue };
            let word = |c: char| c.is_ascii_lowercase() || c == '_';
            if kinds.contains(kind) && !key.is_empty() && key.chars().all(word) {
                assert!(settings.contains(address), "{place}: `{address}` is no setting");
                named += 1;
            }
        }
    }
    assert!(named >= 30, "{named} settings are named");
}
