//! Imports point down: every path to another module of the crate leads to a lower layer, and no
//! files import each other, not even in a circle. The picture of the layers is in
//! docs/architecture.md.

#![allow(clippy::unwrap_used, reason = "a test that fails says so")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use super::modules::Modules;

/// The modules from the bottom up. Those of one layer do not import each other.
const LAYERS: [&[&str]; 20] = [
    &["error"],
    &["host", "point"],
    &["geom", "quantity", "budget"],
    &["expression"],
    &["store"],
    &["tile"],
    &["report"],
    &["stage"],
    &["ops", "io", "memory"],
    &["synth"],
    &["picture"],
    &["page"],
    &["graph"],
    &["engine"],
    &["plan"],
    &["language"],
    &["compare"],
    &["testing"],
    &["cli"],
    &["internals"],
];
/// Imports from lower layers that every room but those of the lowest two has, at least.
const FEWEST: usize = 1;

type Imports = BTreeMap<String, BTreeSet<String>>;

fn room(module: &str) -> &str {
    module.split("::").next().unwrap_or(module)
}

fn layer(room: &str) -> Option<usize> {
    LAYERS.iter().position(|layer| layer.contains(&room))
}

/// The imports that do not point down, and for each room how many do.
fn check(imports: &Imports) -> (Vec<String>, BTreeMap<String, usize>) {
    let (mut wrong, mut down) = (Vec::new(), BTreeMap::new());
    for (from, all) in imports.iter().filter(|(from, _)| !from.is_empty()) {
        let count = down.entry(room(from).to_owned()).or_default();
        for to in all.iter().filter(|to| room(to) != room(from)) {
            match (layer(room(from)), layer(room(to))) {
                (Some(above), Some(below)) if below < above => *count += 1,
                _ => wrong.push(format!("{from} imports {to}")),
            }
        }
    }
    (wrong, down)
}

/// The Rust files in a folder and those below it.
pub fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let each = |path: PathBuf| if path.is_dir() { files(&path) } else { vec![path] };
    entries.flat_map(each).filter(|path| path.extension().is_some_and(|e| e == "rs")).collect()
}

/// The modules of this crate with their texts.
pub fn sources() -> Vec<(String, String)> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let all = files(&src).into_iter().filter(|file| *file != src.join("main.rs"));
    let each = all.map(|file| {
        let within = file.strip_prefix(&src).unwrap().with_extension("");
        let mut names: Vec<&str> = within.iter().map(|name| name.to_str().unwrap()).collect();
        if matches!(names[..], ["lib"] | [.., "mod"]) {
            names.pop();
        }
        (names.join("::"), fs::read_to_string(&file).unwrap())
    });
    each.collect()
}

#[test]
fn imports_point_down() {
    let (wrong, mut down) = check(&Modules::of(sources()).imports());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for room in LAYERS.concat() {
        let count = down.remove(room).unwrap_or_else(|| panic!("no file of {room} was read"));
        let fewest = if layer(room) < Some(2) { 0 } else { FEWEST };
        assert!(count >= fewest, "{room} has {count} imports: were they read?");
    }
    assert!(down.is_empty(), "modules in no layer: {:?}", down.keys());
}

/// A circle among `imports`, if there is one: files each of which imports the next.
fn circle(imports: &Imports) -> Option<Vec<String>> {
    let mut left = imports.clone();
    // Files that import none that is left cannot be in a circle.
    loop {
        let is_left = |names: &BTreeSet<String>| names.iter().any(|name| left.contains_key(name));
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
fn no_files_import_each_other_in_a_circle() {
    let all = sources().into_iter();
    let own = all.map(|(module, text)| {
        let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        (module, code.to_owned())
    });
    let imports = Modules::of(own).imports();
    let count: usize = imports.values().map(BTreeSet::len).sum();
    assert!(imports.len() > 200 && count > 800, "{} files, {count} imports", imports.len());
    assert_eq!(circle(&imports), None);
}

/// The imports among files with these modules and texts.
fn imports(files: &[(&str, &str)]) -> Imports {
    Modules::of(files.iter().map(|&(module, text)| (module.to_owned(), text.to_owned()))).imports()
}

#[test]
fn a_circle_is_found_however_its_imports_are_written() {
    let facade = ("a", "mod x;\npub use x::X;");
    for (files, found) in [
        // Directly, in a group, by a ladder, in an expression.
        (vec![("b", "use crate::c::C;"), ("c", "use crate::{b::{B, D}, Error};")], "b c"),
        (
            vec![("b", ""), ("b::m", "use super::{n::N};"), ("b::n", "use super::super::b::m;")],
            "b::m b::n",
        ),
        (vec![("b", "fn f() { crate::c::run() }"), ("c", "fn g() -> super::b::B {}")], "b c"),
        // Through a facade, also by another name.
        (vec![facade, ("a::x", "use crate::b::B;"), ("b", "use crate::a::X;")], "a::x b"),
        (
            vec![
                ("a", "pub(crate) use x::X as Y;"),
                ("a::x", "use crate::b;"),
                ("b", "use crate::a::Y;"),
            ],
            "a::x b",
        ),
        // A parent that uses what its child has, which takes something of the parent.
        (vec![("b", "mod x;\nfn f() { x::run() }"), ("b::x", "use super::B;")], "b b::x"),
        (vec![("b", "pub use x::X;\nfn f() { X }"), ("b::x", "use super::B;")], "b b::x"),
    ] {
        let circle = circle(&imports(&files)).unwrap_or_default();
        assert_eq!(circle.join(" "), found, "{files:?}");
    }
}

#[test]
fn what_only_looks_like_a_circle_is_none() {
    for files in [
        vec![("b", "use crate::c::C;"), ("c", "// use crate::b::B;"), ("d", "use crate::{b, c};")],
        // A facade only names its children, which may take each other's things from it.
        vec![
            ("a", "mod x;\nmod y;\npub use x::X;\npub use y::Y;"),
            ("a::x", ""),
            ("a::y", "use super::X;"),
        ],
    ] {
        assert_eq!(circle(&imports(&files)), None, "{files:?}");
    }
}

#[test]
fn an_import_that_points_up_or_aside_is_found_however_it_is_written() {
    for (module, text) in [
        ("geom::star", "use crate::tile::Tile;"),
        ("geom::star", "use crate::budget::Budget;"),
        ("io::las::laz", "fn f() -> crate::ops::Cells { todo() }"),
        ("tile::load", "use crate::{Result, point::{Bounds, Position}, stage::Needs};"),
        ("tile::load", "use crate::{\n    Error,\n    report::Tally,\n};"),
        ("tile::load", "use super::super::plan::Plan;"),
        ("budget", "use super::cli;"),
    ] {
        assert_eq!(checked(module, text).0.len(), 1, "{text}");
    }
}

#[test]
fn imports_that_point_down_and_comments_are_no_mistakes() {
    let text = "//! See [`crate::cli`].\nuse crate::{Error, Result, geom::{nearest, plane}};\n\
                use crate::tile::Tile; // as crate::plan does\nuse super::sieve::Run;";
    assert_eq!(checked("ops::grid", text), (Vec::new(), 3));
    assert_eq!(checked("tile::load", "use super::{stage_of, Reader};").0.len(), 0);
}

/// What is wrong with a file among rooms that are empty else, and how many of its imports point
/// down.
fn checked(module: &str, text: &str) -> (Vec<String>, usize) {
    let rooms = LAYERS.concat().into_iter().map(|room| (room, ""));
    let root = ("", "pub use error::{Error, ErrorKind, Result};");
    let files: Vec<(&str, &str)> = rooms.chain([root, (module, text)]).collect();
    let (wrong, down) = check(&imports(&files));
    (wrong, down[room(module)])
}
