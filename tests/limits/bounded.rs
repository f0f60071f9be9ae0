//! The budget bounds the peak of resident memory, and what does not fit is refused with the number
//! that would do. Each run is a process of its own, which reads its peak (VmHWM) itself.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic and tell why")]

use std::path::Path;
use std::time::Duration;

use assert_cmd::Command;
use serde_json::Value;

/// Bytes of a record of a synthetic scan.
const RECORD: u64 = 30;
const MIB: u64 = 1 << 20;

/// Runs pointmill in `folder`; gives its exit code and what it told on stderr.
fn pointmill(folder: &Path, arguments: &str) -> (i32, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_pointmill"))
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .timeout(Duration::from_secs(900))
        .output()
        .unwrap();
    (output.status.code().expect("an exit code"), String::from_utf8(output.stderr).unwrap())
}

fn synth(folder: &Path, points: u64) {
    let (code, told) = pointmill(folder, &format!("synth als -n {points} -o scan.las"));
    assert_eq!(code, 0, "{told}");
}

/// Runs a command with a budget; asserts that it was kept, and gives the report's `run`.
fn bounded(folder: &Path, command: &str, mebibytes: u64) -> Value {
    let arguments = format!("{command} --memory {mebibytes}MiB --report report.json");
    let (code, told) = pointmill(folder, &arguments);
    assert_eq!(code, 0, "{arguments}: {told}");
    let text = std::fs::read(folder.join("report.json")).unwrap();
    let mut report: Value = serde_json::from_slice(&text).unwrap();
    let run = report["run"].take();
    let peak = run["peak_memory_bytes"].as_u64().expect("a peak");
    println!("{arguments}: {} MiB at most, {} s", peak / MIB, run["seconds"]);
    assert_eq!(run["memory_bytes"], mebibytes * MIB);
    assert!(peak <= mebibytes * MIB, "{arguments}: {peak} bytes at most");
    run
}

/// The least budget in mebibytes that a refusal names.
fn refused(folder: &Path, command: &str, mebibytes: u64, parts: &[&str]) -> u64 {
    let before = entries(folder);
    let (code, told) = pointmill(folder, &format!("{command} --memory {mebibytes}MiB"));
    assert_eq!(code, 1, "{command} with {mebibytes} MiB: {told}");
    parts.iter().for_each(|part| assert!(told.contains(part), "{part:?} is not in {told}"));
    assert_eq!(entries(folder), before, "a refusal leaves nothing behind");
    let help = told.lines().rfind(|line| line.starts_with("help:"));
    let before = help.and_then(|help| help.split_once("MiB")).unwrap_or_else(|| panic!("{told}")).0;
    before.rsplit(|c: char| !c.is_ascii_digit()).next().unwrap().parse().unwrap()
}

fn entries(folder: &Path) -> Vec<std::ffi::OsString> {
    let mut names: Vec<_> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    names
}

/// Runs commands on a scan at least three times as large as the budget, into outputs of their own.
fn three_times_larger(points: u64, mebibytes: u64, commands: &[&str]) {
    assert!(points * RECORD >= 3 * mebibytes * MIB);
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    synth(at, points);
    for command in commands {
        let run = bounded(at, command, mebibytes);
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
        "reduce scan.las -o reduced.laz --threads 1",
        "reduce scan.las -o reduced.ply --threads 2",
        "convert scan.las -o scan.laz --threads 2",
        "convert scan.laz -o scan.ply --threads 2",
        "reduce scan.laz -o again.laz --threads 2 --method pca",
    ];
    three_times_larger(14_000_000, 128, &commands);
}

#[test]
#[ignore = "takes minutes"]
fn memory_of_256_mib_bounds_the_reduction_of_a_scan_three_times_larger() {
    three_times_larger(27_000_000, 256, &["reduce scan.las -o reduced.laz --threads 2"]);
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
    let (code, told) = pointmill(at, "convert scan.las -o scan.laz");
    assert_eq!(code, 0, "{told}");
    for command in [
        "reduce scan.las -o out.laz --threads 1",
        "reduce scan.laz -o out.ply --threads 2",
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
