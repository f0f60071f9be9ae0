//! What is public, as a kept list: nothing is added to it, and nothing taken from it, unnoticed.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use super::imports::sources;
use crate::docs::{SAYS_SO, keep};

/// The modules of a crate by their names, "" being the root, and their texts, as rustfmt has them.
type Sources = BTreeMap<String, String>;

/// The first name in a text.
fn name(text: &str) -> &str {
    let end = text.find(|c: char| !c.is_alphanumeric() && c != '_');
    &text[..end.unwrap_or(text.len())]
}

/// What a `pub use` of a module hands on, by the names that it has there; nothing if it only gives
/// what is public below it a second name.
fn handed_on(path: &str, is_public_child: impl Fn(&str) -> bool) -> Vec<&str> {
    let (from, what) = path.rsplit_once("::").unwrap_or(("", path));
    let (from, what) = path.split_once("::{").unwrap_or((from, what));
    if is_public_child(from) {
        return Vec::new();
    }
    let each = what.trim_end_matches('}').split(',').map(str::trim).filter(|name| !name.is_empty());
    each.map(|name| name.rsplit(' ').next().unwrap_or(name)).collect()
}

/// Adds the public items of a public module, and of those below it, to `found`: modules with `::`
/// behind their name.
fn collect(sources: &Sources, module: &str, found: &mut Vec<String>) {
    let within = |name: &str| match module {
        "" => name.to_owned(),
        _ => format!("{module}::{name}"),
    };
    let mut is_hidden = false;
    let mut rest = &sources[module][..];
    let child = |line: &str| {
        let line = line.strip_prefix("pub mod ")?;
        line.strip_suffix(';').map(str::to_owned)
    };
    let children: Vec<String> = rest.lines().filter_map(child).collect();
    while !rest.is_empty() {
        let line = rest.lines().next().unwrap_or_default();
        let statement = rest.split([';', '=']).next().unwrap_or_default();
        rest = rest.get(line.len() + 1..).unwrap_or_default();
        if line.starts_with("///") || line.starts_with("#[") {
            is_hidden |= line == "#[doc(hidden)]";
            continue;
        }
        let Some(item) = statement.strip_prefix("pub ").filter(|_| !is_hidden) else {
            is_hidden = false;
            continue;
        };
        let (kind, what) = item.split_once(' ').unwrap_or((item, ""));
        match kind {
            "mod" => {
                found.push(within(what) + "::");
                collect(sources, &within(what), found);
            }
            "use" => {
                let names = handed_on(what, |from| children.iter().any(|child| child == from));
                found.extend(names.into_iter().map(within));
            }
            "const" if what.starts_with("fn ") => found.push(within(name(&what[3..]))),
            _ => found.push(within(name(what))),
        }
    }
}

fn public(sources: &Sources) -> Vec<String> {
    let mut found = Vec::new();
    collect(sources, "", &mut found);
    found.sort();
    found
}

#[test]
fn what_is_public_is_a_list_that_is_kept() {
    let found = public(&sources().into_iter().collect());
    let items = found.iter().filter(|name| !name.ends_with("::")).count();
    assert!(items > 100 && found.len() - items > 8, "{items} items were read");
    let list: String = found.iter().map(|name| format!("{name}\n")).collect();
    let says = "Everything public in the library but what is only for its own tests";
    keep("docs/surface.txt", &format!("{says}: {items} items.\nThis list is {SAYS_SO}.\n\n{list}"));
}

#[test]
fn what_is_public_is_found_however_it_is_written() {
    let root = "mod a;\npub mod b;\n/// For tests.\n#[doc(hidden)]\npub mod c;\npub(crate) mod d;\n\n\
                pub use a::A;\npub use b::B;\npub(crate) use d::{\n    D,\n};\n";
    let b = "mod x;\n\npub use super::a::{\n    Other, self as renamed,\n};\n/// A thing.\n\
             #[derive(Debug)]\npub struct B<T> {\n    pub field: T,\n}\n\nimpl B {\n    pub fn f() {}\n}\n\
             pub const fn g() -> u8 {\n    0\n}\npub const H: u8 = 0;\npub type I = u8;\n";
    let files =
        [("", root), ("a", ""), ("b", b), ("b::x", "pub fn x() {}\n"), ("c", ""), ("d", "")];
    let files = files.map(|(module, text)| (module.to_owned(), text.to_owned()));
    let expected = ["A", "b::", "b::B", "b::H", "b::I", "b::Other", "b::g", "b::renamed"];
    assert_eq!(public(&files.into_iter().collect()), expected);
}

/// What a release had that is gone, and of which the changelog does not say so.
fn gone_unsaid(released: &str, now: &str, changelog: &str) -> Vec<String> {
    let items = |list: &str| -> Vec<String> {
        list.lines()
            .filter(|line| !line.contains(' ') && !line.is_empty())
            .map(Into::into)
            .collect()
    };
    let now = items(now);
    let coming = changelog.split("\n## [").nth(1).unwrap_or_default();
    let breaking = coming.split("### Breaking").nth(1).unwrap_or_default();
    let breaking = breaking.split("\n### ").next().unwrap_or_default();
    let is_said = |item: &String| breaking.contains(&format!("`{item}`"));
    items(released).into_iter().filter(|item| !now.contains(item) && !is_said(item)).collect()
}

#[test]
fn what_is_gone_since_the_last_release_is_in_the_changelog() {
    let log = "# Changelog\n\n## [Unreleased]\n\n### Breaking\n\n- `b::B` is gone.\n\n### Added\n\n\
               - `b::C`\n\n## [0.1.0]\n\n### Breaking\n\n- `a`\n";
    assert_eq!(gone_unsaid("Says: 3.\n\na\nb::B\nb::C\nd\n", "d\n", log), ["a", "b::C"]);

    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let read = |path: &Path| fs::read_to_string(path).unwrap();
    let (now, changelog) = (read(&docs.join("surface.txt")), read(&docs.join("../CHANGELOG.md")));
    for file in fs::read_dir(&docs).unwrap().map(|entry| entry.unwrap().path()) {
        if file.file_name().unwrap().to_str().unwrap().starts_with("surface-") {
            let gone = gone_unsaid(&read(&file), &now, &changelog);
            assert!(gone.is_empty(), "{} has {gone:?}, which are gone", file.display());
        }
    }
}
