//! `reduce --size`: outputs of about so many bytes.

use std::fs;
use std::path::Path;

use crate::support::command::{done, fails, pointmill};

fn size(at: &Path, file: &str) -> f64 {
    fs::metadata(at.join(file)).unwrap().len() as f64
}

#[test]
fn outputs_take_the_bytes_that_are_asked_for() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "als", "-n", "60k", "-o", "scan.las"]);
    for (file, bytes) in [("out.laz", 100_000.0), ("out.las", 300_000.0), ("out.ply", 150_000.0)] {
        let asked = (bytes as u64).to_string();
        let (code, table, told) =
            pointmill(at, &["reduce", "scan.las", "-o", file, "--size", &asked]);
        assert_eq!(code, 0, "{told}");
        assert!((size(at, file) / bytes - 1.0).abs() <= 0.02, "{asked}: {table}{told}");
        // It is the reduction to that number of points, of which nothing else is left.
        let points = table.split(" in, ").nth(1).unwrap().split(' ').next().unwrap();
        let points = points.replace(',', "");
        let again = file.replace("out", "again");
        done(at, &["reduce", "scan.las", "-o", &again, "--keep", &points]);
        assert!(fs::read(at.join(file)).unwrap() == fs::read(at.join(&again)).unwrap(), "{file}");
    }
    assert_eq!(fs::read_dir(at).unwrap().count(), 7, "nothing of runs that missed is left");
}

#[test]
fn sizes_that_cannot_be_met_are_told() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "als", "-n", "3k", "-o", "scan.las"]);
    let sized = |size: &'static str| ["reduce", "scan.las", "-o", "out.laz", "--size", size];
    fails(at, &sized("300"), 1, &["an output with one point takes", "`--size` is 300 B"]);
    assert!(!at.join("out.laz").exists());
    fails(at, &sized("3 apples"), 2, &["is no size such as 512MiB"]);
    let both = [&sized("1MB")[..], &["--keep", "5%"]].concat();
    fails(at, &both, 2, &["--size and --keep do not go together"]);
    let (code, table, told) = pointmill(at, &sized("10MB"));
    assert!(code == 0 && table.starts_with("points     3,000 in, 3,000 out"), "{table}{told}");
    assert!(told.contains("which is less than 9.5 MiB"), "{told}");
}
