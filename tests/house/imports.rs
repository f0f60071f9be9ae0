//! Imports point down: every path to another module of the crate leads to a lower layer. The picture
//! of the layers is in docs/architecture.md.

#![allow(clippy::unwrap_used, reason = "a test that fails says so")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// The modules from the bottom up. Those of one layer do not import each other.
const LAYERS: [&[&str]; 15] = [
    &["error"],
    &["host", "point"],
    &["geom", "quantity", "budget"],
    &["store"],
    &["tile"],
    &["report"],
    &["stage"],
    &["ops", "io"],
    &["synth"],
    &["picture"],
    &["graph"],
    &["engine"],
    &["plan"],
    &["language"],
    &["cli"],
];
/// What `error` is called from outside.
const OF_ERROR: [&str; 3] = ["Error", "ErrorKind", "Result"];
/// Paths to lower layers that every module but the lowest two has, at least.
const FEWEST: usize = 2;

fn layer(module: &str) -> Option<usize> {
    LAYERS.iter().position(|layer| layer.contains(&module))
}

/// The text without comments. A `//` in a string also ends the line, which loses no path.
fn without_comments(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

fn word(text: &str) -> &str {
    let end = text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
    &text[..end]
}

/// The first names in a path or in a group of paths that begins `text`: of `{a::{b, c}, d::e}` these
/// are a and d.
fn first_names(text: &str) -> Vec<&str> {
    let Some(group) = text.strip_prefix('{') else { return vec![word(text)] };
    let (mut depth, mut names, mut begins) = (0, Vec::new(), true);
    for (at, c) in group.char_indices() {
        match c {
            '}' if depth == 0 => break,
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => begins = true,
            c if c.is_whitespace() => {}
            _ if begins => {
                names.push(word(&group[at..]));
                begins = false;
            }
            _ => {}
        }
    }
    names
}

/// The first names behind each `way` in a text, such as `crate::`.
fn behind<'a>(text: &'a str, way: &str) -> Vec<&'a str> {
    let is_whole = |before: &str| !before.ends_with(|c: char| c.is_alphanumeric() || c == '_');
    let whole = text.match_indices(way).filter(|(at, _)| is_whole(&text[..*at]));
    whole.flat_map(|(at, found)| first_names(&text[at + found.len()..])).collect()
}

/// The names at the root of the crate that the text of a file reaches, from a module that is `depth`
/// levels below the root: by `crate::`, or by as many `super::`.
fn reached(text: &str, depth: usize) -> Vec<String> {
    let text = without_comments(text);
    let from_root = behind(&text, &"super::".repeat(depth));
    let known = from_root.into_iter().filter(|name| layer(name).is_some());
    behind(&text, "crate::").into_iter().chain(known).map(str::to_owned).collect()
}

/// What is wrong with a file of `module`, and to how many lower layers' names it leads.
fn check(module: &str, depth: usize, text: &str) -> (Vec<String>, usize) {
    let (mut wrong, mut down) = (Vec::new(), 0);
    for name in reached(text, depth) {
        let to = if OF_ERROR.contains(&name.as_str()) { "error" } else { &name };
        match (layer(module), layer(to)) {
            (Some(from), Some(below)) if below < from => down += 1,
            (Some(_), Some(_)) if to == module => {}
            (Some(_), Some(_)) => wrong.push(format!("{module} imports {to}")),
            _ => wrong.push(format!("{module} imports {to}, which is in no layer")),
        }
    }
    (wrong, down)
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let each = |path: PathBuf| if path.is_dir() { files(&path) } else { vec![path] };
    entries.flat_map(each).filter(|path| path.extension().is_some_and(|e| e == "rs")).collect()
}

#[test]
fn imports_point_down() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut down: BTreeMap<String, usize> = BTreeMap::new();
    let mut wrong = Vec::new();
    for file in files(&src) {
        let within = file.strip_prefix(&src).unwrap().with_extension("");
        let mut path: Vec<&str> = within.iter().map(|part| part.to_str().unwrap()).collect();
        if ["lib", "main"].contains(&path[0]) {
            continue;
        }
        if path.last() == Some(&"mod") {
            path.pop();
        }
        let text = fs::read_to_string(&file).unwrap();
        let (mistakes, uses) = check(path[0], path.len(), &text);
        wrong.extend(mistakes.into_iter().map(|told| format!("{}: {told}", file.display())));
        *down.entry(path[0].to_owned()).or_default() += uses;
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for module in LAYERS.concat() {
        let uses = down.remove(module).unwrap_or_else(|| panic!("no file of {module} was read"));
        let fewest = if layer(module) < Some(2) { 0 } else { FEWEST };
        assert!(uses >= fewest, "{module} has {uses} imports: were they read?");
    }
    assert!(down.is_empty(), "modules in no layer: {:?}", down.keys());
}

/// The names in its room that a file's text reaches, `depth` levels below the room.
fn reached_aside(text: &str, room: &str, depth: usize) -> Vec<String> {
    // Longer ladders lead out of the room, whose files have no such names.
    let text = without_comments(text).replace(&"super::".repeat(depth + 1), "crate::");
    let ladder = behind(&text, &"super::".repeat(depth));
    let absolute = behind(&text, &format!("crate::{room}::"));
    ladder.into_iter().chain(absolute).map(str::to_owned).collect()
}

/// A circle among `imports`, if there is one: files each of which imports the next.
fn circle(imports: &BTreeMap<String, Vec<String>>) -> Option<Vec<String>> {
    let mut left = imports.clone();
    // Files that import none that is left cannot be in a circle.
    loop {
        let is_left = |names: &Vec<String>| names.iter().any(|name| left.contains_key(name));
        let done: Vec<String> =
            left.iter().filter(|(_, to)| !is_left(to)).map(|(name, _)| name.clone()).collect();
        if done.is_empty() {
            break;
        }
        done.iter().for_each(|name| drop(left.remove(name)));
    }
    let mut way: Vec<String> = vec![left.keys().next()?.clone()];
    loop {
        let next = left[way.last()?].iter().find(|name| left.contains_key(*name))?.clone();
        if let Some(begin) = way.iter().position(|name| *name == next) {
            return Some(way.split_off(begin));
        }
        way.push(next);
    }
}

#[test]
fn no_files_of_the_engine_import_each_other_in_a_circle() {
    let room = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/engine");
    let mut imports: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for file in files(&room) {
        let within = file.strip_prefix(&room).unwrap().with_extension("");
        let path: Vec<&str> = within.iter().map(|part| part.to_str().unwrap()).collect();
        if path == ["mod"] || path.last() == Some(&"tests") {
            continue;
        }
        let text = fs::read_to_string(&file).unwrap();
        let code = text.split("#[cfg(test)]\nmod tests").next().unwrap();
        let to = reached_aside(code, "engine", path.len());
        let own = path[0].to_owned();
        imports.entry(own.clone()).or_default().extend(to.into_iter().filter(|name| *name != own));
    }
    let count: usize = imports.values().map(Vec::len).sum();
    assert!(imports.len() > 25 && count > 80, "{} files, {count} imports", imports.len());
    assert_eq!(circle(&imports), None);
}

#[test]
fn circles_of_imports_are_found() {
    let imports = |arrows: &[(&str, &[&str])]| {
        let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        arrows.iter().map(|&(from, to)| (from.to_owned(), names(to))).collect::<BTreeMap<_, _>>()
    };
    let none = imports(&[("a", &["b", "c"]), ("b", &["c"]), ("c", &["elsewhere"])]);
    assert_eq!(circle(&none), None);
    let some = imports(&[("a", &["b"]), ("b", &["c"]), ("c", &["d", "b"]), ("d", &[])]);
    assert_eq!(circle(&some).unwrap(), ["b", "c"]);
    let text = "use super::chunk::{Chunk, Open};\nfn f() { super::super::tile::lock(super::job::NONE) }\n\
                use super::{each, files::Use};\nuse crate::pipeline::Watch; // super::comment";
    let mut names = reached_aside(text, "pipeline", 1);
    names.sort_unstable();
    assert_eq!(names, ["Watch", "chunk", "each", "files", "job"]);
}

#[test]
fn an_import_that_points_up_or_aside_is_found_however_it_is_written() {
    for (module, depth, text) in [
        ("geom", 2, "use crate::tile::Tile;"),
        ("geom", 2, "use crate::budget::Budget;"),
        ("io", 3, "fn f() -> crate::ops::Cells { todo() }"),
        ("tile", 2, "use crate::{Result, point::{Bounds, Position}, stage::Needs};"),
        ("tile", 2, "use crate::{\n    Error,\n    report::Tally,\n};"),
        ("tile", 2, "use super::super::plan::Plan;"),
        ("budget", 1, "use super::cli;"),
        ("stage", 1, "use crate::newcomer::Thing;"),
    ] {
        assert_eq!(check(module, depth, text).0.len(), 1, "{text}");
    }
}

#[test]
fn imports_that_point_down_and_comments_are_no_mistakes() {
    let text = "//! See [`crate::cli`].\nuse crate::{Error, Result, geom::{nearest, plane}};\n\
                use crate::tile::Tile; // as crate::plan does\nuse super::sieve::Run;";
    assert_eq!(check("ops", 2, text), (Vec::new(), 4));
    assert_eq!(
        check("tile", 2, "use super::{stage_of, Reader};\nuse crate::tile::Tile;").0.len(),
        0
    );
}
