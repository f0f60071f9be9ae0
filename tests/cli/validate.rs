//! `validate`: what pointmill writes breaks no rule, and each rule that is broken is told.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use pointmill::Registry;
use pointmill::stage::FormatName;
use serde_json::Value;

use crate::support::command::{done, fails, pointmill};

/// What is said of a file, and the names of the rules that it breaks, faults or all.
pub fn told(at: &Path, file: &str) -> (Value, BTreeSet<String>, BTreeSet<String>) {
    let (code, text, error) = pointmill(at, &["validate", "--json", file]);
    let all: Value = serde_json::from_str(&text).unwrap_or_else(|_| panic!("{text}{error}"));
    let one = all[0].clone();
    assert_eq!(code == 0, one["valid"].as_bool().unwrap(), "{error}");
    let names = |is_wanted: fn(&Value) -> bool| {
        let findings = one["findings"].as_array().unwrap().iter().filter(|f| is_wanted(f));
        findings.map(|finding| finding["name"].as_str().unwrap().to_owned()).collect()
    };
    (one.clone(), names(|finding| finding["severity"] == "fault"), names(|_| true))
}

/// The names of the rules of a format.
pub fn rules(format: &str) -> BTreeSet<String> {
    let registry = Registry::builtin();
    let format = registry.formats().named(&FormatName(format.to_owned())).unwrap();
    format.rules().iter().map(|rule| rule.name.to_owned()).collect()
}

#[test]
fn what_is_written_has_no_fault() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "als", "-n", "30k", "-o", "scan.laz"]);
    let mut files = vec!["scan.laz".to_owned()];
    for format in 0..=10 {
        let (format, name) = (format.to_string(), format!("f{format}.las"));
        let mut to = vec!["convert", "scan.laz", "-o", &name, "--point-format", &format, "-q"];
        if ["0", "1", "2", "3", "4", "5"].contains(&format.as_str()) {
            to.extend(["--drop", "Overlap,ScannerChannel,GpsTime,ScanAngle"]);
        }
        done(at, &to);
        files.push(name);
    }
    for name in ["s.las", "s.copc.laz", "s.ply", "s.pcd", "s.e57", "s.csv", "s.xyz"] {
        done(at, &["convert", "scan.laz", "-o", name, "--quiet"]);
        files.push(name.to_owned());
    }
    // Floats are rounded to steps of the scale, and stay in the cube of the octree.
    done(at, &["synth", "sphere", "-n", "20k", "-o", "ball.ply"]);
    done(at, &["convert", "ball.ply", "-o", "b.copc.laz", "--scale", "0.01", "--quiet"]);
    done(at, &["reduce", "scan.laz", "-o", "r.laz", "--keep", "10%", "--ranks", "--quiet"]);
    for name in ["b.copc.laz", "r.laz"] {
        files.push(name.to_owned());
    }
    for file in &files {
        let (one, faults, _) = told(at, file);
        assert!(faults.is_empty(), "{file}: {one:#}");
    }
}

/// A change of a file's bytes.
pub type Change<'a> = (&'static str, usize, &'a [u8]);

/// Makes `file` with each change and looks that it breaks the rule; the rules that were broken.
pub fn broken(
    at: &Path,
    original: &str,
    extension: &str,
    changes: &[Change<'_>],
) -> BTreeSet<String> {
    let bytes = fs::read(at.join(original)).unwrap();
    let mut met = BTreeSet::new();
    let name = format!("changed.{extension}");
    for (rule, place, change) in changes {
        let mut changed = bytes.clone();
        changed[*place..*place + change.len()].copy_from_slice(change);
        fs::write(at.join(&name), changed).unwrap();
        let (one, _, names) = told(at, &name);
        assert!(names.contains(*rule), "{rule} at {place}: {one:#}");
        met.extend(names);
    }
    met
}

pub fn word(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

#[test]
fn rules_of_records_and_of_octrees_are_told() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "als", "-n", "200k", "-o", "scan.laz"]);
    done(at, &["convert", "scan.laz", "-o", "s.copc.laz", "--quiet"]);
    let bytes = fs::read(at.join("s.copc.laz")).unwrap();
    let pages = word(&bytes, 429 + 40);
    let entry = pages;
    let laszip = bytes.windows(14).position(|bytes| bytes == b"laszip encoded").unwrap();
    let nan = f64::NAN.to_le_bytes();
    let changes: &[Change<'_>] = &[
        ("copc-info", 377, b"c0pc"),
        ("copc-info-reserved", 429 + 100, &[1]),
        ("copc-version", 94, &[0x80, 1]),
        ("copc-cube", 429, &nan),
        ("copc-cube-holds", 429 + 24, &0.5f64.to_le_bytes()),
        ("copc-spacing", 429 + 32, &(-1f64).to_le_bytes()),
        ("copc-gps-times", 429 + 56, &1f64.to_le_bytes()),
        ("copc-hierarchy", 429 + 40, &[0; 8]),
        ("copc-pages", 429 + 48, &[1]),
        ("copc-key", entry + 4, &[9]),
        ("copc-node", entry + 16, &[1]),
        ("copc-node-count", entry + 28, &[1]),
        ("copc-node-box", 429 + 24, &1e5f64.to_le_bytes()),
        ("copc-point-format", 104, &[0x80 | 9]),
        ("copc-chunks", laszip + 52 + 12, &50_000u32.to_le_bytes()),
        ("vlr-reserved", 375, &[1]),
        ("vlr-user", 391, b"x"),
        // The sign of the first time of a chunk, from which the others differ as whole numbers do.
        ("copc-time-order", word(&bytes, 96) + 8 + 29, &[0xc0]),
    ];
    let met = broken(at, "s.copc.laz", "copc.laz", changes);
    let own: BTreeSet<String> = rules("copc").difference(&rules("las")).cloned().collect();
    assert!(own.len() >= 15 && own.is_subset(&met), "no file breaks {:?}", own.difference(&met));
    let (one, faults, _) = told(at, "s.copc.laz");
    assert!(faults.is_empty(), "{one:#}");
}

#[test]
fn a_page_of_an_e57_file_that_is_damaged_is_told_with_its_checksum() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "part", "-n", "3k", "-o", "scan.las"]);
    done(at, &["convert", "scan.las", "-o", "s.e57", "--quiet"]);
    let changes: &[Change<'_>] = &[
        ("e57-version", 8, &[2]),
        ("e57-length", 16, &[1]),
        ("e57-page-size", 40, &[1]),
        ("e57-xml", 24, &[0xff; 8]),
        ("e57-checksum", 5000, &[1, 2, 3, 4, 5]),
    ];
    let met = broken(at, "s.e57", "e57", changes);
    assert!(met.is_subset(&rules("e57")) && met.contains("e57-section"), "{met:?}");
    let mut bytes = fs::read(at.join("s.e57")).unwrap();
    bytes[5000] ^= 1;
    fs::write(at.join("changed.e57"), bytes).unwrap();
    let (one, ..) = told(at, "changed.e57");
    let sums = one["findings"].as_array().unwrap().iter().find(|f| f["name"] == "e57-checksum");
    assert_eq!(sums.unwrap()["places"][0]["byte"], 5 * 1024 - 4);
}

#[test]
fn files_are_looked_at_to_the_last_whatever_is_wrong_with_one() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "als", "-n", "20k", "-o", "good.laz"]);
    let whole = fs::read(at.join("good.laz")).unwrap();
    let mut damaged = whole.clone();
    let middle = damaged.len() / 2;
    damaged[middle..middle + 400].fill(0xa5);
    fs::write(at.join("damaged.laz"), damaged).unwrap();
    fs::write(at.join("cut.laz"), &whole[..whole.len() / 3]).unwrap();
    fs::write(at.join("empty.laz"), "").unwrap();
    fs::write(
        at.join("short.ply"),
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n\
                                     property float y\nproperty float z\nend_header\n1 2 3\n",
    )
    .unwrap();
    fs::write(at.join("more.pts"), "1\n1 2 3\n4 5 6\n").unwrap();
    let (code, text, error) = pointmill(at, &["validate", "."]);
    assert_eq!(code, 1, "{text}");
    assert!(error.contains("5 of 6 files have faults"), "{error}");
    assert!(text.contains("it says that it has 1 points, and has 2"), "{text}");
    assert!(text.contains("an empty file") && text.contains("good.laz"), "{text}");
    assert!(text.matches("\n  fault ").count() >= 4, "{text}");
    for threads in ["1", "3"] {
        let again = pointmill(at, &["validate", ".", "--threads", threads, "--memory", "200MiB"]);
        assert_eq!(again.1, text);
    }
    let (code, text, _) = pointmill(at, &["validate", "good.laz"]);
    assert!(code == 0 && text.starts_with("good.laz: "), "{text}");
    assert_eq!(done(at, &["validate", "good.laz", "--quiet"]), "");
    fails(at, &["validate", "empty.laz", "-q"], 1, &["empty.laz", "--quiet"]);
    fails(at, &["validate", "good.laz", "--memory", "1MiB"], 1, &["--memory"]);
}
