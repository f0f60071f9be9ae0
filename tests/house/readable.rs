//! What makes the code readable and can be counted: a name for each type, and functions, files and
//! lines of a length that fits a screen.

#![allow(clippy::unwrap_used, reason = "a test that fails says so")]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use super::imports::files;

/// The code of the crate, file by file, by its path within `src`; what is only for tests is left out.
fn own_code() -> Vec<(String, String)> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let all = files(&src).into_iter().filter(|file| !file.ends_with("tests.rs"));
    let each = all.map(|file| {
        let within = file.strip_prefix(&src).unwrap().to_str().unwrap().to_owned();
        let text = fs::read_to_string(&file).unwrap();
        (within, text)
    });
    each.collect()
}

/// Names that types of LAS share, with each other or with a type that more of the crate knows. The
/// decoder of each item of a record has its own `First` or `Second` version, `Fields`, `Layer` and
/// `Kind`, in files that do not meet; the others are private to the format.
const SHARED_IN_LAS: [&str; 16] = [
    "Block",
    "Bytes",
    "Bytewise",
    "Fields",
    "First",
    "Gathered",
    "Input",
    "Item",
    "Kind",
    "Layer",
    "Median",
    "Normals",
    "Record",
    "Second",
    "Symbols256",
    "Table",
];

/// The types that a text declares. Those of traits and instruction sets (`F32`, `F64`, `Mask`) stand
/// within an `impl`, as types of the same name must.
fn declared(text: &str) -> impl Iterator<Item = &str> {
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    code.lines().filter_map(|line| {
        let mut words = line.trim_start().split(' ');
        let mut keyword = words.next()?;
        if keyword == "pub" || keyword.starts_with("pub(") {
            keyword = words.next()?;
        }
        let is_type = matches!(keyword, "struct" | "enum" | "trait" | "union")
            || (keyword == "type" && !line.starts_with(' '));
        let name = words.next().filter(|_| is_type)?;
        name.split(|c: char| !c.is_alphanumeric()).next()
    })
}

/// The types that more than one of the files declare, each with these files.
fn shared(files: &[(String, String)]) -> BTreeMap<&str, Vec<&str>> {
    let mut all: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (file, text) in files {
        declared(text).for_each(|name| all.entry(name).or_default().push(file));
    }
    all.retain(|_, files| files.len() > 1);
    all
}

#[test]
fn no_two_types_have_one_name() {
    let files = own_code();
    let count = files.iter().flat_map(|(_, text)| declared(text)).count();
    assert!(count > 300, "{count} types");
    let mut shared = shared(&files);
    let outside = |file: &&&str| !file.starts_with("io/las/");
    shared.retain(|name, files| {
        !SHARED_IN_LAS.contains(name) || files.iter().filter(outside).count() > 1
    });
    assert!(shared.is_empty(), "{shared:#?}");
}

#[test]
fn a_type_that_is_declared_twice_is_found_however_public_it_is() {
    let file = |name: &str, text: &str| (name.to_owned(), text.to_owned());
    let found = |one: &str, other: &str| {
        let files = [file("one", one), file("other", other)];
        shared(&files).into_keys().map(str::to_owned).collect::<Vec<_>>().join(" ")
    };
    assert_eq!(found("pub struct Run<'a> {", "fn f() {\n    struct Run;\n}"), "Run");
    assert_eq!(found("pub(super) enum Run {", "type Run = u64;"), "Run");
    assert_eq!(found("pub struct Place(u64);\ntrait Run {", "pub(crate) union Place {"), "Place");
    assert_eq!(found("struct Run;", "struct Runs;\n// struct Run;\n    type Run = u64;"), "");
    assert_eq!(found("struct Run;", "#[cfg(test)]\nmod tests {\n    struct Run;\n}"), "");
}
