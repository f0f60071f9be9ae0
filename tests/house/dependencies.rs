//! docs/dependencies.md says what is known against each package: it is about those of Cargo.lock,
//! and their licences let everyone use ours.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// Name and version.
type Package = (String, String);

/// Licences that ask for no more than to be named.
const LICENCES: [&str; 10] = [
    "0BSD",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "ISC",
    "MIT",
    "MIT-0",
    "Unicode-3.0",
    "Zlib",
];

const SAYS_HOW: &str = "look the packages up again, as docs/dependencies.md says";

fn source(file: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{file}: {e}"))
}

/// The packages of Cargo.lock but for this one.
fn locked() -> BTreeSet<Package> {
    let lock: toml::Table = source("Cargo.lock").parse().unwrap();
    let text = |package: &toml::Value, key: &str| package[key].as_str().unwrap().to_owned();
    let all = lock["package"].as_array().unwrap().iter();
    let packages = all.map(|package| (text(package, "name"), text(package, "version")));
    packages.filter(|(name, _)| name != "pointmill").collect()
}

/// The packages of the page with their licences.
fn told() -> BTreeMap<Package, String> {
    let page = source("docs/dependencies.md");
    let rows = page.lines().filter(|line| line.starts_with("| `"));
    rows.map(|row| {
        let cells: Vec<&str> =
            row.split(" | ").map(|cell| cell.trim_matches(['|', '`', ' '])).collect();
        ((cells[0].to_owned(), cells[1].to_owned()), cells[2].to_owned())
    })
    .collect()
}

/// What cargo says of the packages that are used on this platform.
fn metadata() -> Vec<Value> {
    let told = Command::new("rustc").arg("-vV").output().unwrap();
    let told = String::from_utf8(told.stdout).unwrap();
    let host = told.lines().find_map(|line| line.strip_prefix("host: ")).unwrap();
    let output = Command::new(env!("CARGO"))
        .args([
            "metadata",
            "--format-version=1",
            "--locked",
            "--offline",
            "--filter-platform",
            host,
        ])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let value: Value = serde_json::from_slice(&output.stdout).unwrap();
    value["packages"].as_array().unwrap().clone()
}

#[test]
fn the_page_of_dependencies_is_about_what_is_locked() {
    let (locked, told) = (locked(), told());
    assert!(locked.len() > 40, "{} packages", locked.len());
    assert_eq!(told.keys().cloned().collect::<BTreeSet<_>>(), locked, "{SAYS_HOW}");
}

#[test]
fn licences_are_those_that_the_page_tells_and_free() {
    let told = told();
    let mut compared = 0;
    for package in metadata().iter().filter(|package| package["name"] != "pointmill") {
        let [name, version, licence] = ["name", "version", "license"]
            .map(|key| package[key].as_str().unwrap_or_default().to_owned());
        assert_eq!(told.get(&(name.clone(), version)), Some(&licence), "{name}: {SAYS_HOW}");
        compared += 1;
    }
    assert!(compared > 40, "{compared} packages");
    for (package, licence) in told {
        // All of what "AND" joins is asked for, and one of what "OR" (or a slash) leaves open.
        let free = licence.split(" AND ").all(|all| {
            let any = all.replace('/', " OR ");
            any.split(" OR ").any(|one| LICENCES.contains(&one.trim_matches(['(', ')', ' '])))
        });
        assert!(free, "{package:?} is under {licence:?}");
    }
}
