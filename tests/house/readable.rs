//! What makes the code readable and can be counted: a name for each type, and functions, files and
//! lines of a length that fits a screen.

#![allow(clippy::unwrap_used, reason = "a test that fails says so")]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use super::imports::files;

/// The code of the crate, file by file, by its path within `src`; what is only for tests is left
/// out.
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

/// The types that a text declares. Those of traits and instruction sets (`F32`, `F64`, `Mask`)
/// stand within an `impl`, as types of the same name must.
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
    let shared = shared(&files);
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

const MOST_LINES_OF_A_FUNCTION: usize = 60;
const MOST_LINES_OF_A_FILE: usize = 400;
const MOST_CHARACTERS: usize = 100;

/// The functions of a text as it is formatted, each with its lines from `fn` to its closing brace.
fn functions(text: &str) -> impl Iterator<Item = (&str, usize)> {
    let lines: Vec<&str> = text.lines().collect();
    let each = (0..lines.len()).filter_map(move |at| {
        let line = lines[at].trim_start();
        let indent = &lines[at][..lines[at].len() - line.len()];
        let (before, signature) = line.split_once("fn ")?;
        let qualifies = |word: &str| {
            word.starts_with("pub") || matches!(word, "const" | "unsafe" | "async") || word == "in"
        };
        let is_function = before.split_whitespace().all(qualifies);
        let name = signature.split(|c: char| !(c.is_alphanumeric() || c == '_')).next()?;
        let ends = |line: &str| {
            let rest = line.strip_prefix(indent);
            rest.is_some_and(|rest| rest == "}" || (!rest.starts_with(' ') && rest.ends_with(';')))
        };
        let is_short = line.ends_with(';') || line.ends_with('}');
        let rest = lines[at + 1..].iter().position(|line| ends(line)).filter(|_| !is_short);
        is_function.then(|| (name, 1 + rest.map_or(0, |rest| rest + 1)))
    });
    each.collect::<Vec<_>>().into_iter()
}

#[test]
fn functions_and_files_fit_a_screen_and_a_sitting() {
    let files = own_code();
    let (mut long, mut count) = (Vec::new(), 0);
    for (file, text) in &files {
        let lines = text.lines().count();
        if lines > MOST_LINES_OF_A_FILE {
            long.push(format!("{file} has {lines} lines"));
        }
        count += functions(text).count();
        let of_file = functions(text).filter(|(_, lines)| *lines > MOST_LINES_OF_A_FUNCTION);
        long.extend(of_file.map(|(name, n)| format!("{file}: {name} has {n}")));
    }
    assert!(count > 2500, "{count} functions");
    assert!(long.is_empty(), "{}", long.join("\n"));
}

#[test]
fn the_lines_of_a_function_are_counted_up_to_its_brace() {
    let text = "    pub(crate) fn one(\n        a: u64,\n    ) -> u64 {\n        a\n    }\n\
                fn two();\npub const fn three() {}\nfn four(\n    a: u64,\n) -> bool;\nlet fn_of = 5;\n";
    let found: Vec<_> = functions(text).collect();
    assert_eq!(found, [("one", 5), ("two", 1), ("three", 1), ("four", 3)]);
}

#[test]
fn lines_have_a_hundred_characters_at_most() {
    let mut long = Vec::new();
    for (file, text) in own_code() {
        let lines = text.lines().enumerate();
        let over = lines.filter(|(_, line)| line.chars().count() > MOST_CHARACTERS);
        long.extend(over.map(|(n, line)| format!("{file}:{}: {line}", n + 1)));
    }
    assert!(long.is_empty(), "{}", long.join("\n"));
}
