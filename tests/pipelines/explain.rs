//! What takes effect in a pipeline, and where it comes from.

#![allow(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use std::fs;

use pointmill::{Explained, Graph, PipelineText, Registry, Set};
use serde_json::Value;

use super::jobs::{inputs, pipelines, sets};
use crate::support::command::{done, scans};

const TEXT: &str = "\
[params]
side = 0.25
out = { default = '${ENV:OUT}', about = 'where' }

[run]
threads = 2

[[stage]]
kind = 'synth'
name = 'scan'
scene = 'als'
points = '10k'

[[stage]]
kind = 'grid'
from = 'scan'
side = '${side}'

[[stage]]
kind = 'write'
path = '${out}/$${x}-${ENV:NAME:-thin}.laz'
";

fn text(text: &str, name: &str) -> PipelineText {
    let is_out = |name: &str| (name == "OUT").then(|| "folder".into());
    PipelineText::new(text, name).with_environment(is_out)
}

/// What a pipeline means is what its explanation means, and each line of that has an origin.
fn explained(text: &PipelineText, sets: &[Set]) -> Explained {
    let registry = Registry::builtin();
    let graph = text.graph(&registry, sets).unwrap();
    let explained = text.explain(&registry, sets).unwrap();
    let told = explained.to_string();
    let again = Graph::parse(&told, "again.toml", &registry)
        .unwrap_or_else(|error| panic!("{error}\n{told}"));
    assert_eq!(again.to_json(), graph.to_json(), "{told}");
    assert_eq!(again.to_toml().unwrap(), graph.to_toml().unwrap(), "{told}");
    assert_eq!(again.settings, graph.settings, "{told}");
    let is_key = |line: &&str| !line.is_empty() && !line.starts_with('[') && !line.ends_with(':');
    let lines: Vec<&str> = told.lines().filter(is_key).collect();
    assert!(lines.len() > 15, "{told}");
    assert!(lines.iter().all(|line| line.contains("  # ")), "{told}");
    explained
}

/// The line of the text that begins with `key =`, the `n`th; its origin.
fn origin(told: &Explained, key: &str, n: usize) -> String {
    let told = told.to_string();
    let found = told.lines().filter(|line| line.starts_with(&format!("{key} = "))).nth(n);
    found.unwrap_or_else(|| panic!("{key}\n{told}")).rsplit_once("  # ").unwrap().1.to_owned()
}

#[test]
fn every_pipeline_of_the_folder_is_explained_as_a_file_that_means_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let (scan, area) = inputs(folder.path());
    let all = pipelines();
    assert!(all.len() >= 15, "{all:?}");
    for file in all {
        let (name, text) = (file.display().to_string(), fs::read_to_string(&file).unwrap());
        let sets = sets(&text, folder.path(), &scan, &area);
        explained(&PipelineText::new(text, name), &sets);
    }
}

#[test]
fn a_value_says_the_line_argument_parameter_or_variable_that_it_is_from() {
    let told = explained(&text(TEXT, "p.toml"), &[]);
    for (key, n, from) in [
        ("# side", 0, "p.toml:2"),
        ("# out", 0, "p.toml:3, ${ENV:OUT}"),
        ("threads", 0, "p.toml:6"),
        ("spill", 0, "default"),
        ("kind", 1, "p.toml:15"),
        ("name", 0, "p.toml:10"),
        ("from", 0, "p.toml:16"),
        ("points", 0, "p.toml:12"),
        ("side", 0, "p.toml:17, params.side (p.toml:2)"),
        ("pick", 0, "default"),
    ] {
        assert_eq!(origin(&told, key, n), from, "{key}");
    }
    let path = "p.toml:21, params.out (p.toml:3, ${ENV:OUT}), the default of ${ENV:NAME:-thin}";
    assert_eq!(origin(&told, "path", 0), path);
    let set = ["synth.points=20k", "run.threads=1"].map(|set| Set::parse(set).unwrap());
    let param = Set::param("side=0.5").unwrap();
    let flag = Set::argument("--memory", "run.memory", "1GiB".into());
    let told = explained(&text(TEXT, "p.toml"), &[&set[..], &[param, flag]].concat());
    for (key, from) in [
        ("# side", "--param side"),
        ("side", "p.toml:17, --param side"),
        ("points", "--set"),
        ("threads", "--set"),
        ("memory", "--memory"),
    ] {
        assert_eq!(origin(&told, key, 0), from, "{key}");
    }
}

#[test]
fn what_has_no_value_and_what_the_scan_decides_is_said() {
    let line =
        "synth als points=9k ! normals neighbors=auto ! cells keep=10% ! median ! write out.laz";
    let told = explained(&PipelineText::line(line), &[]);
    let chosen = "chosen from the scan in a run";
    assert_eq!(origin(&told, "neighbors", 0), format!("the pipeline, {chosen}"));
    assert_eq!(origin(&told, "side", 0), format!("default, {chosen}"));
    assert_eq!(origin(&told, "# sees", 0), "default");
    assert_eq!(origin(&told, "keep", 0), "the pipeline");
    let told = told.to_string();
    for line in ["# memory has no value", "# max_angle has no value", "# where has no value"] {
        assert!(told.lines().any(|told| told.starts_with(line)), "{line}\n{told}");
    }
}

#[test]
fn json_and_what_is_wrong_are_told_as_of_a_run() {
    let json = r#"{"stage": [{"kind": "synth", "scene": "plane", "points": 7},
        {"kind": "write", "path": "a.laz"}]}"#;
    let told = explained(&text(json, "p.json"), &[]);
    assert_eq!(origin(&told, "path", 0), "p.json:2");
    let registry = Registry::builtin();
    let wrong = TEXT.replace("side = '${side}'", "sied = '${side}'");
    let told = |error: pointmill::Error| error.to_string();
    let wrong = text(&wrong, "p.toml");
    let run = wrong.graph(&registry, &[]).map_err(told).unwrap_err();
    assert_eq!(wrong.explain(&registry, &[]).map_err(told).unwrap_err(), run);
}

#[test]
fn the_command_opens_no_input_and_prints_a_file_or_json() {
    let at = scans(&["a.laz"]);
    fs::write(at.path().join("a.laz"), "no scan").unwrap();
    let line = "read a.laz ! grid side=0.5 ! write out\u{202e}.laz";
    let told = done(at.path(), &["explain", line, "--set", "grid.side=2.5"]);
    assert!(told.contains("side = 2.5"), "{told}");
    assert!(told.contains("\"out\\u202e.laz\""), "what a terminal would obey is escaped: {told}");
    fs::write(at.path().join("again.toml"), &told).unwrap();
    let again = done(at.path(), &["explain", "again.toml", "--json"]);
    let json: Value = serde_json::from_str(&again).unwrap();
    let stage = json["stages"][1].as_array().unwrap();
    let side = stage.iter().find(|key| key["key"] == "side").unwrap();
    assert_eq!(side["value"], 2.5);
    assert!(side["origin"].as_str().unwrap().starts_with("again.toml:"), "{side}");
    assert_eq!(json["run"].as_array().unwrap().iter().filter(|k| k["value"] == "auto").count(), 2);
}
