//! Many conversions in one command: laid out as the inputs are, several at once, gone on with, and
//! what became of each.

use std::fs;
use std::path::Path;
use std::time::{Duration, SystemTime};

use serde_json::Value;

use crate::support::case_file;
use crate::support::command::{done, fails, pointmill};

/// A folder of scans in folders, one of which cannot be read.
fn survey() -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    for (name, case) in [
        ("survey/a/x.las", "23a.las"),
        ("survey/b/x.las", "23e.las"),
        ("survey/b/deep/y.las", "23f.las"),
        ("survey/bad.las", "20a-count-too-many.las"),
    ] {
        let file = at.path().join(name);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::copy(case_file(case), file).unwrap();
    }
    at
}

fn summary(at: &Path) -> Value {
    serde_json::from_slice(&fs::read(at.join("all.json")).unwrap()).unwrap()
}

fn outcomes(summary: &Value) -> Vec<(&str, &str)> {
    let files = summary["files"].as_array().unwrap();
    files.iter().map(|f| (f["input"].as_str().unwrap(), f["outcome"].as_str().unwrap())).collect()
}

#[test]
fn outputs_are_laid_out_as_inputs_are_and_one_failure_stops_no_other() {
    let at = survey();
    let at = at.path();
    for jobs in ["1", "2", "5"] {
        let out = format!("out{jobs}");
        let run = ["convert", "survey/**/*.las", "-o", &format!("{out}/"), "--to", "laz"];
        let more = ["--jobs", jobs, "--summary", "all.json", "--no-provenance"];
        let (code, stdout, told) = pointmill(at, &[&run[..], &more[..]].concat());
        assert_eq!(code, 1, "{told}");
        assert!(stdout.starts_with("files      3\nfailed     1\n"), "{stdout}");
        assert!(told.contains("error: 1 of 4 conversions failed: survey/bad.las"), "{told}");
        for name in ["a/x.laz", "b/x.laz", "b/deep/y.laz"] {
            let [one, other] = ["out1", &out].map(|out| fs::read(at.join(out).join(name)).unwrap());
            assert!(one == other, "{name} by {jobs}");
        }
        assert!(!at.join(&out).join("bad.laz").exists());
        let all = summary(at);
        assert_eq!((all["converted"].as_u64(), all["failed"].as_u64()), (Some(3), Some(1)));
        let bad = all["files"].as_array().unwrap().iter().find(|f| f["outcome"] == "failed");
        let error = &bad.unwrap()["error"];
        assert_eq!((error["kind"].as_str(), error["byte"].as_u64()), (Some("data"), Some(367)));
        assert!(error["help"].as_str().unwrap().contains("incomplete"), "{error}");
    }
}

#[test]
fn what_is_done_and_unchanged_is_left() {
    let at = survey();
    let at = at.path();
    fs::remove_file(at.join("survey/bad.las")).unwrap();
    let run = |more: &[&str]| {
        let all = ["convert", "survey/**/*.las", "-o", "out", "--to", "laz", "--quiet"];
        done(at, &[&all[..], &["--resume", "--summary", "all.json"], more].concat());
        summary(at)
    };
    fs::create_dir(at.join("out")).unwrap();
    let [a, x, y] = ["survey/a/x.las", "survey/b/x.las", "survey/b/deep/y.las"];
    let all = |of_a, of_x, of_y| vec![(a, of_a), (y, of_y), (x, of_x)];
    let [new, old] = ["converted", "unchanged"];
    assert_eq!(outcomes(&run(&[])), all(new, new, new));
    let written = fs::read(at.join("out/a/x.laz")).unwrap();
    assert_eq!(outcomes(&run(&[])), all(old, old, old));
    // A newer file of the same bytes is the same, one of others is not.
    let touch = |name: &str| {
        let file = fs::File::options().append(true).open(at.join(name)).unwrap();
        file.set_modified(SystemTime::now() + Duration::from_secs(60)).unwrap();
    };
    touch(a);
    assert_eq!(outcomes(&run(&[])), all(old, old, old));
    let mut bytes = fs::read(at.join(x)).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(at.join(x), bytes).unwrap();
    touch(x);
    assert_eq!(outcomes(&run(&[])), all(old, new, old));
    // So is what is missing, cut short, or made otherwise.
    fs::remove_file(at.join("out/a/x.laz")).unwrap();
    fs::write(at.join("out/b/deep/y.laz"), b"LASF").unwrap();
    let clobber = ["convert", "survey/**/*.las", "-o", "out", "--to", "laz", "--resume"];
    fails(at, &[&clobber[..], &["--no-clobber"]].concat(), 1, &["out/b/deep/y.laz", "exists"]);
    assert_eq!(outcomes(&run(&[])), all(new, old, new));
    assert!(written == fs::read(at.join("out/a/x.laz")).unwrap());
    assert_eq!(outcomes(&run(&["--point-format", "7"])), all(new, new, new));
    assert_eq!(outcomes(&run(&["--point-format", "7", "--threads", "1"])), all(old, old, old));
}

#[test]
fn what_is_for_many_outputs_is_refused_for_one() {
    let at = survey();
    let at = at.path();
    let run = |more: &[&str], parts: &[&str]| {
        fails(at, &[&["convert", "survey/a/x.las", "-o", "x.laz"], more].concat(), 2, parts);
    };
    run(&["--jobs", "2"], &["--jobs: is for a folder", "`-o x/`"]);
    run(&["--resume"], &["--resume: is for a folder"]);
    run(&["--summary", "s.json"], &["--summary: is for a folder"]);
    run(&["--jobs", "0"], &["from 1 to 256"]);
    run(&["--resume", "--no-provenance"], &["--no-provenance"]);
    let before = fs::read(at.join("survey/a/x.las")).unwrap();
    let own = ["convert", "survey/a/x.las", "-o", "o/", "--summary", "survey/a/x.las"];
    fails(at, &own, 2, &["--summary: survey/a/x.las"]);
    assert!(fs::read(at.join("survey/a/x.las")).unwrap() == before && !at.join("o").exists());
}

#[test]
fn warnings_of_one_of_many_inputs_name_it() {
    let at = survey();
    let at = at.path();
    let all = ["convert", "survey/a/x.las", "survey/b/deep/y.las", "-o", "o/"];
    for jobs in ["1", "2"] {
        let more = ["--drop-classes", "77", "--jobs", jobs];
        let (code, _, told) = pointmill(at, &[&all[..], &more[..]].concat());
        assert_eq!(code, 0, "{told}");
        assert!(told.contains("warning: survey/a/x.las: no point is of class 77"), "{told}");
        assert!(told.contains("warning: survey/b/deep/y.las: no point is of class 77"), "{told}");
    }
}
