//! A scan as triangles: CPU seconds, seconds of the triangulation alone, and peak memory, in memory
//! of 11 GiB and of 256 MiB. Both must give the same bytes.
//!
//! `cargo bench --bench mesh` makes an airborne scan of 10 million points first;
//! `cargo bench --bench mesh -- SCAN.laz 1.5` takes a scan of yours, with circles of that radius.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints and may fail")]

use std::path::Path;
use std::process::{Command, Stdio};

/// Times that each runs; the median is told.
const ROUNDS: usize = 3;

fn pointmill(arguments: &[&str]) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pointmill"));
    let status = command.args(arguments).stdout(Stdio::null()).status().unwrap();
    assert!(status.success(), "{arguments:?}");
}

/// CPU seconds, seconds of the triangulation and peak mebibytes of a run; and its triangles.
fn run(scan: &str, radius: &str, memory: &str, folder: &Path) -> ([f64; 3], Vec<u8>) {
    let at = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let (output, report) = (at("mesh.ply"), at("mesh.json"));
    let line = format!("read \"{scan}\" ! mesh \"{output}\" max_radius={radius}");
    let arguments = ["run", &line, "--memory", memory, "--report", &report, "--quiet"];
    pointmill(&arguments);
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    let phases = json["run"]["phases"].as_array().unwrap();
    let mesh = phases.iter().find(|phase| phase["name"] == "mesh").unwrap();
    let figure = |value: &serde_json::Value| value.as_f64().unwrap();
    let peak = figure(&json["run"]["peak_memory_bytes"]) / f64::from(1 << 20);
    let figures = [figure(&json["run"]["cpu_seconds"]), figure(&mesh["seconds"]), peak];
    (figures, std::fs::read(output).unwrap())
}

fn main() {
    let arguments: Vec<String> =
        std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let folder = tempfile::tempdir().unwrap();
    let made = folder.path().join("scan.laz").to_str().unwrap().to_owned();
    let (scan, radius) = match &arguments[..] {
        [scan, radius, ..] => (scan.clone(), radius.clone()),
        _ => {
            pointmill(&["synth", "als", "-n", "10M", "-o", &made, "--quiet"]);
            (made, "3".to_owned())
        }
    };
    let mut first: Option<Vec<u8>> = None;
    for memory in ["11GiB", "256MiB"] {
        let mut runs = Vec::new();
        for _ in 0..ROUNDS {
            let (figures, bytes) = run(&scan, &radius, memory, folder.path());
            assert!(*first.get_or_insert_with(|| bytes.clone()) == bytes, "other bytes");
            runs.push(figures);
        }
        let median = |of: usize| {
            let mut values: Vec<f64> = runs.iter().map(|run| run[of]).collect();
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        };
        let [cpu, mesh, peak] = [median(0), median(1), median(2)];
        println!("{memory:>7}: {cpu:.1} CPU s, mesh {mesh:.1} s, peak {peak:.0} MiB");
    }
}
