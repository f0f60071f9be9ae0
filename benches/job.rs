//! The whole job, LAZ → LAZ, as a user runs it: CPU seconds, wall seconds and peak memory in several
//! configurations, whose outputs must be the same bytes.
//!
//! `cargo bench --bench job` makes an airborne scan of 10 million points first;
//! `cargo bench --bench job -- SCAN.laz` takes a scan of yours;
//! `cargo bench --bench job -- SCAN.laz 512MiB` adds a run at that budget.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints and may fail")]

use std::path::{Path, PathBuf};
use std::process::Command;

/// Times that each configuration runs; the median is told.
const ROUNDS: usize = 3;

fn pointmill(arguments: &[&str]) {
    let status = Command::new(env!("CARGO_BIN_EXE_pointmill"))
        .args(arguments)
        .stdout(std::process::Stdio::null())
        .status()
        .unwrap();
    assert!(status.success(), "{arguments:?}");
}

struct Figures {
    cpu: f64,
    wall: f64,
    peak_mib: f64,
    spill_mib: f64,
    kept: u64,
}

fn run(scan: &str, configuration: &[&str], folder: &Path) -> (Figures, Vec<u8>) {
    let (output, report) = (folder.join("reduced.laz"), folder.join("reduced.json"));
    let (to, told) = (output.to_str().unwrap(), report.to_str().unwrap());
    let mut arguments = vec!["reduce", scan, "-o", to, "--report", told, "--progress", "never"];
    arguments.extend(configuration);
    pointmill(&arguments);
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap();
    let figure = |name: &str| json["run"][name].as_f64().unwrap_or(f64::NAN);
    let mib = |name: &str| figure(name) / f64::from(1 << 20);
    let figures = Figures {
        cpu: figure("cpu_seconds"),
        wall: figure("seconds"),
        peak_mib: mib("peak_memory_bytes"),
        spill_mib: mib("spill_bytes"),
        kept: json["result"]["ledger"]["kept"].as_u64().unwrap(),
    };
    (figures, std::fs::read(output).unwrap())
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    // `cargo bench` passes `--bench` on.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let folder = tempfile::tempdir().unwrap();
    let scan = arguments.first().map_or_else(|| folder.path().join("als.laz"), PathBuf::from);
    let scan = scan.to_str().unwrap();
    if arguments.is_empty() {
        pointmill(&["synth", "als", "-n", "10000000", "-o", scan]);
    }
    let mut configurations = vec![
        vec!["--threads", "1"],
        vec!["--threads", "2"],
        vec!["--threads", "2", "--memory", "256MiB"],
    ];
    if let Some(memory) = arguments.get(1) {
        configurations.push(vec!["--memory", memory]);
    }
    let mut figures: Vec<Vec<Figures>> = configurations.iter().map(|_| Vec::new()).collect();
    let mut first: Option<Vec<u8>> = None;
    // In turn, so that a machine that slows down slows all of them.
    for _ in 0..ROUNDS {
        for (configuration, figures) in configurations.iter().zip(&mut figures) {
            let (run, output) = run(scan, configuration, folder.path());
            let first = first.get_or_insert_with(|| output.clone());
            assert!(*first == output, "{configuration:?} gave other bytes");
            figures.push(run);
        }
    }
    println!("{scan}: medians of {ROUNDS} runs in turn, all of the same bytes");
    for (configuration, runs) in configurations.iter().zip(&figures) {
        println!(
            "{:<32} {:>6.1} CPU s {:>6.1} s {:>6.0} MiB peak {:>6.0} MiB spilled, {} kept",
            configuration.join(" "),
            median(runs.iter().map(|r| r.cpu).collect()),
            median(runs.iter().map(|r| r.wall).collect()),
            runs.iter().map(|r| r.peak_mib).fold(0.0, f64::max),
            runs.iter().map(|r| r.spill_mib).fold(0.0, f64::max),
            runs[0].kept,
        );
    }
}
