//! What `pointmill plan` foretells beside what the run then does, for each of some jobs.
//!
//! `cargo bench --bench forecast -- SCAN.laz …`: a line a job, what was foretold, what came, and by
//! how much of it the first is off; jobs run one after the other on all processors. Wall-clock time
//! means something on a machine that does nothing else.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints and may fail")]

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

const REDUCE: &str = "normals ! cells ! median !";

/// Name, what is read (none: the scan itself), the stages with the output, and further arguments.
const JOBS: [(&str, Option<&str>, &str, &[&str]); 6] = [
    ("reduce, paper", None, "write a.laz", &[]),
    ("the same, 256 MiB", None, "write a.laz", &["--memory", "256MiB"]),
    ("LAZ to LAZ", None, "write b.laz", &[]),
    ("LAZ to LAS", None, "write b.las", &[]),
    ("LAS to PLY", Some("b.las"), "write b.ply", &[]),
    ("grid", None, "grid side=1 ! write c.laz", &[]),
];

/// What is compared: its name, where it is foretold and where it is reported.
const FIGURES: [(&str, &str, &str); 6] = [
    ("peak MB", "/peak_memory_bytes", "/peak_memory_bytes"),
    ("scratch MB", "/scratch_bytes", "/spill_bytes"),
    ("points", "/outputs/0/points", "/outputs/0/points"),
    ("output MB", "/outputs/0/bytes", "/outputs/0/bytes"),
    ("CPU s", "/cpu_seconds", "/cpu_seconds"),
    ("wall s", "/seconds", "/seconds"),
];

fn pointmill(at: &Path, arguments: &[&str]) -> Vec<u8> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pointmill"));
    let output = command.current_dir(at).args(arguments).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {told}");
    output.stdout
}

fn main() {
    let scans: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    assert!(!scans.is_empty(), "cargo bench --bench forecast -- SCAN.laz …");
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for scan in scans {
        let scan = fs::canonicalize(scan).unwrap().display().to_string();
        println!("{scan}");
        for (name, input, stages, further) in JOBS {
            let reduces =
                if name.contains("reduce") || name.contains("same") { REDUCE } else { "" };
            let read = input.unwrap_or(&scan);
            let pipeline = format!("read \"{read}\" ! {reduces} {stages}");
            let plan = [&["plan", &pipeline, "--json"], further].concat();
            let plan: Value = serde_json::from_slice(&pointmill(at, &plan)).unwrap();
            pointmill(at, &[&["run", &pipeline, "-q", "--report", "r.json"], further].concat());
            let report: Value =
                serde_json::from_slice(&fs::read(at.join("r.json")).unwrap()).unwrap();
            println!("  {name}: {}", compared(&plan["prediction"], &report["run"]));
        }
    }
}

/// `CPU s 14.1 / 13.8 (+2 %)` for each figure.
fn compared(foretold: &Value, came: &Value) -> String {
    let each = FIGURES.iter().filter_map(|(name, said, is)| {
        let scale = if name.ends_with("MB") { 1e6 } else { 1.0 };
        let of = |value: &Value, key: &str| Some(value.pointer(key)?.as_f64()? / scale);
        let (said, is) = (of(foretold, said)?, of(came, is)?);
        let off = if is == 0.0 { 0.0 } else { 100.0 * (said - is) / is };
        Some(format!("{name} {said:.1} / {is:.1} ({off:+.0} %)"))
    });
    each.collect::<Vec<_>>().join("; ")
}
