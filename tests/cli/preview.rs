//! `reduce --preview`, and what a run towards a tolerance says before it starts: what is foretold
//! is what comes out.

use std::path::Path;

use crate::support::command::{done, pointmill};
use serde_json::Value;

fn scan(kind: &str, more: &[&str]) -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    done(at.path(), &[&["synth", kind, "-o", "scan.las"], more].concat());
    at
}

/// The words of the first line that begins with `label`.
fn row(table: &str, label: &str) -> Vec<String> {
    let line = table.lines().find(|line| line.split_whitespace().next() == Some(label));
    let line = line.unwrap_or_else(|| panic!("no {label} in {table}"));
    line.split_whitespace().map(str::to_owned).collect()
}

fn number(text: &str) -> f64 {
    text.replace(',', "").parse().unwrap()
}

/// The figures of a reduction in the report.
fn reduced(at: &Path, arguments: &[&str]) -> Value {
    let base = ["reduce", "scan.las", "-o", "out.laz", "--report", "out.json"];
    done(at, &[&base[..], arguments].concat());
    let report: Value =
        serde_json::from_slice(&std::fs::read(at.join("out.json")).unwrap()).unwrap();
    report["result"].clone()
}

#[test]
fn a_preview_of_a_scan_that_is_tried_as_a_whole_is_what_comes_out() {
    let at = scan("als", &["-n", "40k"]);
    let at = at.path();
    let table =
        done(at, &["reduce", "scan.las", "--preview", "--keep", "3k", "--tolerance", "0.25"]);
    let files: Vec<_> = std::fs::read_dir(at).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(files, ["scan.las"], "a preview writes nothing");
    assert!(table.starts_with("40,000 of 40,000 points were tried"), "{table}");
    for share in ["1%", "10%", "20%"] {
        assert_eq!(row(&table, share).len(), 9, "{table}");
    }
    for (label, arguments) in
        [("5%", ["--keep", "5%"]), ("3k", ["--keep", "3k"]), ("0.25", ["--tolerance", "0.25"])]
    {
        let (foretold, result) = (row(&table, label), reduced(at, &arguments));
        let deviation = &result["totals"]["deviation"];
        assert_eq!(number(&foretold[1]) as u64, result["ledger"]["kept"], "{table}");
        for (n, figure) in [(4, "rms"), (5, "p95"), (6, "p99")] {
            let (told, is) = (number(&foretold[n]), deviation[figure].as_f64().unwrap());
            assert!((told / is - 1.0).abs() < 0.006, "{label}: {figure} {is}: {table}");
        }
    }
}

#[test]
fn a_preview_of_strips_over_each_other_sees_all_points_of_its_places() {
    let at = scan("als", &["-n", "600k"]);
    let at = at.path();
    let (code, table, told) = pointmill(at, &["reduce", "scan.las", "--preview"]);
    assert!(code == 0 && !told.contains("warning"), "{told}");
    let tried = number(table.split(' ').next().unwrap());
    assert!((50_000.0..=150_000.0).contains(&tried), "{table}");
    let (foretold, result) = (row(&table, "10%"), reduced(at, &["--keep", "10%"]));
    for (n, figure) in [(4, "rms"), (5, "p95"), (6, "p99")] {
        let is = result["totals"]["deviation"][figure].as_f64().unwrap();
        assert!((number(&foretold[n]) / is - 1.0).abs() < 0.15, "{figure} {is}: {table}");
    }
}

#[test]
fn a_preview_of_cells_has_numbers_alone() {
    let at = scan("part", &["-n", "10k"]);
    let table = done(at.path(), &["reduce", "scan.las", "--preview", "--preset", "paper"]);
    assert!(!table.contains("tolerance") && table.lines().count() == 7, "{table}");
    assert!(number(&row(&table, "10%")[1]) > 800.0, "{table}");
}

#[test]
fn a_tolerance_below_the_noise_is_told_before_the_run_with_one_that_does() {
    let at = scan("plane", &["-n", "300k", "--noise", "0.02"]);
    let at = at.path();
    let base = ["reduce", "scan.las", "-o", "out.laz", "--tolerance"];
    let (code, table, told) = pointmill(at, &[&base[..], &["0.002"]].concat());
    assert_eq!(code, 0, "{told}");
    let warning = told.lines().find(|line| line.contains("finer than the noise"));
    let warning = warning.unwrap_or_else(|| panic!("{told}{table}"));
    assert!(warning.starts_with("warning: `--tolerance 0.002` is finer"), "{warning}");
    let behind = |words: &str| warning.split(words).nth(1).unwrap().split(' ').next().unwrap();
    let (expected, kept) = (number(behind("about ")), number(&row(&table, "points")[3]));
    assert!((expected / kept - 1.0).abs() < 0.15, "{warning}: {kept}");
    let loose = behind("; `--tolerance ").trim_end_matches('`');
    let (code, table, told) = pointmill(at, &[&base[..], &[loose]].concat());
    assert!(code == 0 && !told.contains("finer"), "{told}");
    let share = number(&row(&table, "points")[3]) / 300_000.0;
    assert!((0.05..0.2).contains(&share), "{warning}: {table}");
    // A number of points besides bounds what stays.
    let (code, _, told) = pointmill(at, &[&base[..], &["0.002", "--keep", "5%"]].concat());
    assert!(code == 0 && !told.contains("finer"), "{told}");
    // A pipeline is as good as the command.
    let line = "read scan.las ! graded tolerance=0.002 ! write out.las";
    let (code, _, told) = pointmill(at, &["run", line]);
    assert!(code == 0 && told.contains("warning: `graded.tolerance = 0.002` is finer"), "{told}");
}
