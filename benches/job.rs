//! The whole job, LAZ → LAZ and LAS → LAS, as a user runs it: CPU seconds, wall seconds and peak
//! memory in several configurations. Those of one format and method must give the same bytes.
//!
//! `cargo bench --bench job` makes an airborne scan of 10 million points first;
//! `cargo bench --bench job -- SCAN.laz` takes a scan of yours;
//! `cargo bench --bench job -- SCAN.laz 512MiB` adds a run at that budget.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints and may fail")]

use std::collections::BTreeMap;
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

/// One way to run the job.
struct Configuration {
    format: &'static str,
    method: &'static str,
    options: Vec<String>,
    runs: Vec<Figures>,
}

impl Configuration {
    fn new(format: &'static str, method: &'static str, options: &str) -> Configuration {
        let options = options.split_whitespace().map(str::to_owned).collect();
        Configuration { format, method, options, runs: Vec::new() }
    }

    fn name(&self) -> String {
        format!("{} {} {}", self.format, self.method, self.options.join(" "))
    }

    /// Runs it once on the scan of its format in `folder`, and returns the output.
    fn run(&mut self, scan: &str, folder: &Path) -> Vec<u8> {
        let at = |name: &str| folder.join(name).to_str().unwrap().to_owned();
        let (output, report) = (at(&format!("reduced.{}", self.format)), at("reduced.json"));
        let pipeline = concat!(env!("CARGO_MANIFEST_DIR"), "/pipelines/reduce.toml");
        let set = [
            format!("read.path={scan}"),
            format!("write.path={output}"),
            format!("normals.method={}", self.method),
        ];
        // The published method, whose cost can be compared over versions.
        let paper = [
            "normals.neighbors=10",
            "cells.measure=axis",
            "cells.max_angle=0.1",
            "cells.side=auto",
            "cells.min_spacing=none",
        ];
        let mut arguments = vec!["run", pipeline, "--progress", "never", "--report", &report];
        set.iter()
            .map(String::as_str)
            .chain(paper)
            .for_each(|set| arguments.extend(["--set", set]));
        arguments.extend(self.options.iter().map(String::as_str));
        pointmill(&arguments);
        let json: serde_json::Value =
            serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
        let figure = |name: &str| json["run"][name].as_f64().unwrap_or(f64::NAN);
        let mib = |name: &str| figure(name) / f64::from(1 << 20);
        self.runs.push(Figures {
            cpu: figure("cpu_seconds"),
            wall: figure("seconds"),
            peak_mib: mib("peak_memory_bytes"),
            spill_mib: mib("spill_bytes"),
            kept: json["result"]["ledger"]["kept"].as_u64().unwrap(),
        });
        std::fs::read(output).unwrap()
    }
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
    let las = folder.path().join("scan.las");
    let las = las.to_str().unwrap();
    pointmill(&["convert", scan, "-o", las]);
    let mut configurations = vec![
        Configuration::new("laz", "varady", "--threads 1"),
        Configuration::new("laz", "varady", "--threads 2"),
        Configuration::new("laz", "varady", "--threads 2 --memory 256MiB"),
        Configuration::new("laz", "pca", "--threads 2"),
        Configuration::new("las", "varady", "--threads 2"),
        Configuration::new("las", "pca", "--threads 2"),
    ];
    if let Some(memory) = arguments.get(1) {
        configurations.push(Configuration::new("laz", "varady", &format!("--memory {memory}")));
    }
    let mut first: BTreeMap<[&str; 2], Vec<u8>> = BTreeMap::new();
    // In turn, so that a machine that slows down slows all of them.
    for _ in 0..ROUNDS {
        for configuration in &mut configurations {
            let of_format = if configuration.format == "las" { las } else { scan };
            let output = configuration.run(of_format, folder.path());
            let kind = [configuration.format, configuration.method];
            let first = first.entry(kind).or_insert_with(|| output.clone());
            assert!(*first == output, "{} gave other bytes", configuration.name());
        }
    }
    println!("{scan}: medians of {ROUNDS} runs in turn");
    for configuration in &configurations {
        let runs = &configuration.runs;
        println!(
            "{:<40} {:>6.1} CPU s {:>6.1} s {:>6.0} MiB peak {:>6.0} MiB spilled, {} kept",
            configuration.name(),
            median(runs.iter().map(|r| r.cpu).collect()),
            median(runs.iter().map(|r| r.wall).collect()),
            runs.iter().map(|r| r.peak_mib).fold(0.0, f64::max),
            runs.iter().map(|r| r.spill_mib).fold(0.0, f64::max),
            runs[0].kept,
        );
    }
}
