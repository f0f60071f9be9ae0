//! `compare` beside the decoding of the scans that it compares: CPU seconds, in turn.
//!
//! `cargo bench --bench compare` makes an airborne scan of 10 million points first;
//! `cargo bench --bench compare -- SCAN.laz` takes a scan of yours.
//!
//! Told are a scan beside itself, beside a copy without its last class, beside a tenth of it and
//! beside its own records in Morton order, each as a multiple of runs that decode both and do
//! nothing with them; and what `--distances` takes beside the tenth.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints and may fail")]

use std::fs;
use std::process::{Command, Stdio};

/// Times that each job runs; medians are told.
const ROUNDS: usize = 3;

/// CPU seconds of the children that ended.
fn children() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap();
    let behind_name = stat.rsplit_once(')').unwrap().1;
    let fields: Vec<&str> = behind_name.split_ascii_whitespace().collect();
    // Fields 16 and 17 of proc(5), in the 100th of a second that Linux tells everyone.
    fields[13..15].iter().map(|ticks| ticks.parse::<f64>().unwrap() / 100.0).sum()
}

/// CPU seconds of a command.
fn run(arguments: &[&str]) -> f64 {
    let before = children();
    let mut command = Command::new(env!("CARGO_BIN_EXE_pointmill"));
    let done = command.args(arguments).arg("--quiet").stdout(Stdio::null()).status().unwrap();
    assert!(done.success(), "{arguments:?}");
    children() - before
}

fn median(mut all: Vec<f64>) -> f64 {
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

fn main() {
    let given = std::env::args().skip(1).find(|argument| argument != "--bench");
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let scan = given.unwrap_or_else(|| {
        run(&["synth", "als", "-n", "10000000", "-o", &path("scan.laz")]);
        path("scan.laz")
    });
    let [part, tenth, sorted] = ["part.laz", "tenth.laz", "sorted.laz"].map(path);
    run(&["convert", &scan, "-o", &part, "--drop-classes", "5"]);
    run(&["run", &format!("read '{scan}' ! sample every=10 ! write '{tenth}'")]);
    run(&["run", &format!("read '{scan}' ! write '{sorted}' order=canonical")]);
    let decode = |path: &str| format!("read '{path}' ! discard");
    let jobs = [
        ("itself", &scan, &[][..]),
        ("without a class", &part, &[]),
        ("a tenth", &tenth, &[]),
        ("in Morton order", &sorted, &[]),
        ("a tenth, --distances", &tenth, &["--distances"]),
    ];
    println!("{:<22} {:>8} {:>8} {:>7}", "", "decode s", "CPU s", "times");
    for (name, other, more) in jobs {
        let (mut decoded, mut compared) = (Vec::new(), Vec::new());
        // In turn, so that a machine that slows down slows both.
        for _ in 0..ROUNDS {
            decoded.push(run(&["run", &decode(&scan)]) + run(&["run", &decode(other)]));
            compared.push(run(&[&["compare", &scan, other], more].concat()));
        }
        let [decoded, compared] = [decoded, compared].map(median);
        println!("{name:<22} {decoded:>8.2} {compared:>8.2} {:>7.2}", compared / decoded);
    }
}
