//! How fast the formats are read and written, points a second of CPU of one thread, as a user runs
//! them: `convert` into each format, and from each into `discard`.
//!
//! `cargo bench --bench formats` makes an airborne scan of 5 million points first;
//! `cargo bench --bench formats -- SCAN.laz` takes a scan of yours. What reading costs is that of a
//! pipeline that throws the points away; what writing costs, that of a conversion from LAS less that
//! of reading LAS.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints and may fail")]

use std::path::Path;
use std::process::Command;

/// Times that each job runs; medians are told.
const ROUNDS: usize = 3;
/// The outputs, and what is asked of them.
const OUTPUTS: [(&str, &[&str]); 8] = [
    ("b.las", &["--scale", "0.001", "--offset", "350000,5600000,0"]),
    ("b.laz", &["--scale", "0.001", "--offset", "350000,5600000,0"]),
    ("b.ply", &[]),
    ("t.ply", &["--encoding", "ascii"]),
    ("b.pcd", &[]),
    ("t.pcd", &["--encoding", "ascii"]),
    ("b.txt", &[]),
    ("b.e57", &[]),
];

/// User and system seconds of the children that have ended.
fn children() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap();
    let fields: Vec<&str> = text[text.rfind(')').unwrap()..].split(' ').collect();
    let ticks: f64 = fields[14..16].iter().map(|field| field.parse::<f64>().unwrap()).sum();
    ticks / 100.0
}

/// CPU seconds of a run of the program; the median of some.
fn seconds(at: &Path, arguments: &[&str]) -> f64 {
    let run = || {
        let before = children();
        let plain = ["--threads", "1", "--memory", "256MiB", "--quiet"];
        let mut command = Command::new(env!("CARGO_BIN_EXE_pointmill"));
        let status = command.current_dir(at).args(arguments).args(plain).status().unwrap();
        assert!(status.success(), "{arguments:?}");
        children() - before
    };
    let mut all: Vec<f64> = (0..ROUNDS).map(|_| run()).collect();
    all.sort_by(f64::total_cmp);
    all[ROUNDS / 2]
}

fn main() {
    let given = std::env::args().skip(1).find(|argument| !argument.starts_with("--"));
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scan = given.map(|scan| std::fs::canonicalize(scan).unwrap().display().to_string());
    let scan = scan.unwrap_or_else(|| {
        seconds(at, &["synth", "als", "-n", "5000000", "-o", "scan.laz"]);
        "scan.laz".to_owned()
    });
    // Coordinates and intensity, so that formats have the same to do.
    seconds(at, &["convert", &scan, "-o", "all.csv", "--header", "true"]);
    let names = std::fs::read_to_string(at.join("all.csv")).unwrap();
    let lines = names.lines().count() as f64 - 1.0;
    let heading = names.lines().next().unwrap();
    let kept = ["X", "Y", "Z", "Intensity"];
    let drop: Vec<&str> = heading.split(',').filter(|name| !kept.contains(name)).collect();
    let drop = drop.join(",");
    std::fs::remove_file(at.join("all.csv")).unwrap();
    seconds(at, &["convert", &scan, "-o", "base.pcd", "--drop", &drop, "--no-provenance"]);
    let read = |name: &str| {
        let line = format!("read {name} ! discard");
        seconds(at, &["run", &line])
    };
    let base = read("base.pcd");
    println!("{lines} points of coordinates and intensity, millions a second of CPU");
    println!("{:10} {:>8} {:>8} {:>12}", "", "read", "written", "bytes");
    for (name, more) in OUTPUTS {
        let arguments = [&["convert", "base.pcd", "-o", name, "--no-provenance"], more];
        let written = seconds(at, &arguments.concat()) - base;
        let bytes = std::fs::metadata(at.join(name)).unwrap().len();
        let speed = |seconds: f64| lines / 1e6 / seconds.max(1e-9);
        println!("{name:10} {:8.1} {:8.1} {bytes:12}", speed(read(name)), speed(written));
    }
}
