//! `check` and `stages`: what a pipeline can have, and whether one is right.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use crate::support::command::{done, fails, scans};
use pointmill::Registry;
use pointmill::graph::RunSettings;
use serde_json::Value;

fn pipeline(at: &Path, input: &str) {
    let text = format!(
        "[run]\nreport = 'r.json'\n[[stage]]\nkind = 'read'\npath = {input}\n\
         [[stage]]\nkind = 'normals'\n[[stage]]\nkind = 'cells'\n[[stage]]\nkind = 'median'\n\
         [[stage]]\nkind = 'write'\npath = 'out.laz'\n"
    );
    fs::write(at.join("p.toml"), text).unwrap();
}

fn files(at: &Path) -> BTreeSet<PathBuf> {
    fs::read_dir(at).unwrap().map(|entry| entry.unwrap().path()).collect()
}

#[test]
fn a_pipeline_that_is_right_is_said_to_be_and_nothing_is_written() {
    let at = scans(&["a.laz", "b.laz"]);
    pipeline(at.path(), "['a.laz', 'b.laz']");
    fs::write(at.path().join("out.laz"), "an older output").unwrap();
    let before = files(at.path());
    let told = done(at.path(), &["check", "p.toml"]);
    assert_eq!(told, "p.toml is right: 6,001 points from 2 files would become out.laz\n");
    assert_eq!(done(at.path(), &["check", "p.toml", "--quiet"]), "");
    assert_eq!(files(at.path()), before);
    assert_eq!(fs::read(at.path().join("out.laz")).unwrap(), b"an older output");
}

#[test]
fn every_mistake_of_a_pipeline_is_told_at_once() {
    let at = scans(&["a.laz"]);
    let text = "[run]\nthreads = 0\n[[stage]]\nkind = 'read'\npth = 'a.laz'\n\
                [[stage]]\nkind = 'cels'\n[[stage]]\nkind = 'write'\npath = 'o.zlas'\n";
    fs::write(at.path().join("p.toml"), text).unwrap();
    let places = ["p.toml:2:", "p.toml:5:", "p.toml:7:", "p.toml:10:", "did you mean `cells`?"];
    fails(at.path(), &["check", "p.toml"], 2, &places);
}

#[test]
fn inputs_that_cannot_be_read_are_all_told() {
    let at = scans(&["a.laz"]);
    let good = fs::read(at.path().join("a.laz")).unwrap();
    fs::write(at.path().join("cut.laz"), &good[..good.len() / 2]).unwrap();
    fs::write(at.path().join("empty.laz"), b"").unwrap();
    pipeline(at.path(), "['a.laz', 'no.laz', 'cut.laz', 'empty.laz']");
    let told = ["error: no.laz: ", "error: cut.laz: ", "error: empty.laz: "];
    fails(at.path(), &["check", "p.toml"], 1, &told);
}

#[test]
fn a_memory_that_cannot_do_is_told_before_a_run() {
    let at = scans(&["a.laz"]);
    pipeline(at.path(), "'a.laz'");
    fails(at.path(), &["check", "p.toml", "--memory", "1MiB"], 1, &["error: ", "MiB"]);
}

#[test]
fn stages_lists_what_the_registry_has_and_the_keys_of_each() {
    let at = tempfile::tempdir().unwrap();
    let all: Value = serde_json::from_str(&done(at.path(), &["stages", "--json"])).unwrap();
    let kinds: BTreeSet<&str> =
        all.as_array().unwrap().iter().map(|d| d["kind"].as_str().unwrap()).collect();
    let registry = Registry::builtin();
    let expected = registry.kinds().map(|(kind, _)| kind).chain(["accept", "run"]).collect();
    assert_eq!(kinds, expected);
    let text = done(at.path(), &["stages"]);
    for described in all.as_array().unwrap() {
        let kind = described["kind"].as_str().unwrap();
        let one: Value =
            serde_json::from_str(&done(at.path(), &["stages", kind, "--json"])).unwrap();
        assert_eq!(one, *described);
        let own = done(at.path(), &["stages", kind]);
        for key in described["keys"].as_array().unwrap() {
            let line = format!(
                "\n  {} = {}",
                key["key"].as_str().unwrap(),
                key["value"].as_str().unwrap()
            );
            assert!(own.contains(&line) && text.contains(&line), "{kind}: {line}");
            assert!(!key["about"].as_str().unwrap().is_empty(), "{kind}: {key}");
        }
    }
    let cells = done(at.path(), &["stages", "cells"]);
    assert!(cells.contains(
        "\n  max_angle = an angle (radians, or such as \"6deg\") or \"auto\" [default: 0.1]\n"
    ));
    let run = all.as_array().unwrap().iter().find(|d| d["kind"] == "run").unwrap();
    assert!(run["keys"].as_array().unwrap().len() >= 8);
    let _all_optional: RunSettings = toml::from_str("").unwrap();
    assert!(run["keys"].as_array().unwrap().iter().all(|key| key["required"] == false));
}
