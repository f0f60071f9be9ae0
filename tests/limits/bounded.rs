//! The budget bounds the peak of resident memory, and what does not fit is refused with the number
//! that would do. Each run is a process of its own, which reads its peak (VmHWM) itself.

use std::path::Path;

use serde_json::Value;

use crate::support::command::{mebibytes, pointmill_told};

/// Bytes of a record of a synthetic scan.
const RECORD: u64 = 30;
const MIB: u64 = 1 << 20;

fn synth(folder: &Path, points: u64) {
    let (code, told) = pointmill_told(folder, &format!("synth als -n {points} -o scan.las"));
    assert_eq!(code, 0, "{told}");
}

/// Runs a command with a budget; asserts that it was kept, and gives the report's `run`.
fn bounded(folder: &Path, command: &str, budget: u64) -> Value {
    let arguments = format!("{command} --memory {budget}MiB --report report.json");
    let (code, told) = pointmill_told(folder, &arguments);
    assert_eq!(code, 0, "{arguments}: {told}");
    let text = std::fs::read(folder.join("report.json")).unwrap();
    let mut report: Value = serde_json::from_slice(&text).unwrap();
    let run = report["run"].take();
    let peak = run["peak_memory_bytes"].as_u64().expect("a peak");
    println!("{arguments}: {} MiB at most, {} s", peak / MIB, run["seconds"]);
    assert_eq!(run["memory_bytes"], budget * MIB);
    assert!(peak <= budget * MIB, "{arguments}: {peak} bytes at most");
    run
}

/// The least budget in mebibytes that a refusal names.
fn refused(folder: &Path, command: &str, budget: u64, parts: &[&str]) -> u64 {
    let before = entries(folder);
    let (code, told) = pointmill_told(folder, &format!("{command} --memory {budget}MiB"));
    assert_eq!(code, 1, "{command} with {budget} MiB: {told}");
    parts.iter().for_each(|part| assert!(told.contains(part), "{part:?} is not in {told}"));
    assert_eq!(entries(folder), before, "a refusal leaves nothing behind");
    mebibytes(&told)
}

fn entries(folder: &Path) -> Vec<std::ffi::OsString> {
    let mut names: Vec<_> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    names
}

/// Runs commands on a scan at least three times as large as the budget, into outputs of their own.
fn three_times_larger(points: u64, budget: u64, commands: &[&str]) {
    assert!(points * RECORD >= 3 * budget * MIB);
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    synth(at, points);
    for command in commands {
        let run = bounded(at, command, budget);
        if command.starts_with("reduce") {
            assert!(run["spill_bytes"].as_u64().unwrap() > points * RECORD / 2, "{command}: {run}");
            assert!(run["work"]["tiles"].as_u64().unwrap() >= 30, "{command}: {run}");
        }
        let output = command.split_whitespace().nth(3).unwrap();
        assert!(at.join(output).metadata().unwrap().len() > points / 2, "{command}: {run}");
    }
}

#[test]
#[ignore = "takes minutes"]
fn memory_of_128_mib_bounds_the_reduction_of_a_scan_three_times_larger() {
    let commands = [
        "reduce scan.las -o reduced.laz --threads 1 --side spread",
        "reduce scan.las -o reduced.ply --threads 2 --side spread",
        "convert scan.las -o scan.laz --threads 2",
        "convert scan.laz -o scan.ply --threads 2",
        "reduce scan.laz -o again.laz --threads 2 --method pca",
    ];
    three_times_larger(14_000_000, 128, &commands);
}

#[test]
#[ignore = "takes minutes"]
fn memory_of_256_mib_bounds_the_reduction_of_a_scan_three_times_larger() {
    three_times_larger(
        27_000_000,
        256,
        &["reduce scan.las -o reduced.laz --threads 2 --side spread"],
    );
}

/// Outliers of the scan, then a target for the ground and a grid for the rest, with an output
/// between them.
const BY_CLASS: &str = r#"
[[stage]]
kind = "read"
path = "scan.las"

[[stage]]
kind = "outliers"
multiplier = 3.0
name = "clean"

[[stage]]
kind = "normals"
classes = [2, 6]

[[stage]]
kind = "cells"
classes = [2, 6]
keep = "10%"

[[stage]]
kind = "median"
classes = [2, 6]

[[stage]]
kind = "write"
path = "marked.laz"

[[stage]]
kind = "grid"
side = 1.1
classes = [5]

[[stage]]
kind = "write"
path = "reduced.laz"
"#;

#[test]
#[ignore = "takes minutes"]
fn memory_of_128_mib_bounds_stages_of_two_phases_selections_and_two_outputs() {
    let points = 3_200_000;
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    synth(at, points);
    std::fs::write(at.join("p.toml"), BY_CLASS).unwrap();
    let run = bounded(at, "run p.toml --threads 2", 128);
    assert!(run["spill_bytes"].as_u64().unwrap() > points * 8, "{run}");
    assert!(run["work"]["tiles"].as_u64().unwrap() >= 30, "{run}");
}

#[test]
fn a_budget_too_small_is_refused_before_any_work_with_the_number_that_does() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    synth(at, 400_000);
    let (code, told) = pointmill_told(at, "convert scan.las -o scan.laz");
    assert_eq!(code, 0, "{told}");
    for command in [
        "reduce scan.las -o out.laz --threads 1 --side spread",
        "reduce scan.laz -o out.ply --threads 2 --side spread",
        "reduce scan.laz -o out.laz --threads 4 --method pca --side 1.1",
        "convert scan.las -o out.laz --threads 3",
        "convert scan.laz -o out.ply --threads 1 --encoding ascii",
    ] {
        let least = refused(at, command, 5, &["5 MiB is too small", "thread"]);
        // What the program itself takes differs a little from run to run: a mebibyte is for that.
        refused(at, command, least - 4, &["is too small"]);
        bounded(at, command, least);
        std::fs::remove_file(at.join(if command.contains("ply") { "out.ply" } else { "out.laz" }))
            .unwrap();
        std::fs::remove_file(at.join("report.json")).unwrap();
    }
}

#[test]
fn a_cell_too_heavy_is_refused_after_the_decode_with_the_memory_that_does() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    synth(at, 300_000);
    for (threads, side) in [(1, "100000"), (2, "1000")] {
        let command = format!("reduce scan.las -o out.laz --threads {threads} --side {side}");
        let parts = ["the cube from [", "hold ", " positions, more than the "];
        let enough = refused(at, &command, 5, &["5 MiB is too small"]);
        let least = refused(at, &command, enough, &parts);
        assert!(least > enough, "{least} MiB");
        bounded(at, &command, least);
        std::fs::remove_file(at.join("out.laz")).unwrap();
        std::fs::remove_file(at.join("report.json")).unwrap();
    }
}
