//! What a run says while it works: events for programs, more or less text for people.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::support::command::{done, pointmill, scans};
use serde_json::Value;

/// The events on stderr: every line is one, in order of time.
fn events(at: &Path, arguments: &[&str], code: i32) -> Vec<Value> {
    let (given, _, stderr) = pointmill(at, arguments);
    assert_eq!(given, code, "{arguments:?}: {stderr}");
    let parse = |line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}"));
    let events: Vec<Value> = stderr.lines().map(parse).collect();
    let seconds: Vec<f64> = events.iter().map(|e| e["seconds"].as_f64().unwrap()).collect();
    assert!(seconds.is_sorted() && !events.is_empty(), "{arguments:?}: {stderr}");
    events.iter().for_each(documented);
    events
}

/// Every key of an event is named in docs/formats.md.
fn documented(event: &Value) {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/formats.md"));
    let text = text.unwrap();
    let (_, section) = text.split_once("\n## Events\n").unwrap();
    for key in event.as_object().unwrap().keys() {
        assert!(section.contains(&format!("`{key}`")), "docs/formats.md does not name {key}");
    }
    assert!(section.contains(&format!("`{}`", event["event"])), "{event}");
}

fn names(events: &[Value]) -> Vec<&str> {
    events.iter().map(|e| e["event"].as_str().unwrap()).collect()
}

#[test]
fn every_line_is_an_event_and_they_tell_the_run() {
    let at = scans(&["a.laz", "b.laz"]);
    let report = ["--report", "r.json", "--progress", "json"];
    let arguments =
        [&["reduce", "a.laz", "b.laz", "-o", "o.laz", "--side", "spread"][..], &report].concat();
    let events = events(at.path(), &arguments, 0);
    let (first, last) = (&events[0], &events[events.len() - 1]);
    assert_eq!((&first["event"], &last["event"]), (&"plan".into(), &"done".into()));
    assert_eq!((&first["inputs"], &first["points"]), (&2.into(), &6001.into()));
    assert_eq!((&first["outputs"][0], &first["report"]), (&"o.laz".into(), &"r.json".into()));
    assert!(first["text"].as_str().unwrap().starts_with("source   read"));
    assert!(first["memory_bytes"].as_u64() > Some(0) && first["threads"].as_u64() > Some(0));

    let mut phase: Option<&Value> = None;
    let mut told = BTreeSet::new();
    for event in &events[1..events.len() - 1] {
        match event["event"].as_str().unwrap() {
            "phase" => phase = Some(event),
            "progress" => {
                let phase = phase.expect("a phase before its progress");
                assert_eq!(event["phase"], phase["name"]);
                assert_eq!(event["total"], phase["total"]);
                assert!(event["done"].as_u64() <= event["total"].as_u64(), "{event}");
                if event["done"] == event["total"] {
                    told.insert(event["phase"].as_str().unwrap());
                }
            }
            "chosen" => {
                let values = event["values"].as_array().unwrap();
                assert!(values.iter().any(|v| v["name"] == "neighbors"), "{event}");
            }
            // So few points are noisy.
            "warning" => assert!(event["message"].as_str().unwrap().starts_with("normals scatter")),
            other => panic!("{other}: {event}"),
        }
    }
    assert_eq!(told, BTreeSet::from(["decode", "gather", "merge", "mill", "survey"]));

    let written: Value =
        serde_json::from_slice(&fs::read(at.path().join("r.json")).unwrap()).unwrap();
    for key in ["ledger", "classes", "totals", "decisions"] {
        assert_eq!(last[key], written["result"][key], "{key}");
    }
    for key in ["outputs", "memory_bytes", "peak_memory_bytes", "spill_bytes", "phases"] {
        assert_eq!(last[key], written["run"][key], "{key}");
    }
    assert_eq!(last["report"], "r.json");
    assert!(last["ledger"]["kept"].as_u64() > Some(0));
}

#[test]
fn errors_and_warnings_are_events_too() {
    let at = scans(&["a.laz", "p.ply"]);
    let cut = fs::read(at.path().join("a.laz")).unwrap();
    fs::write(at.path().join("cut.laz"), &cut[..cut.len() / 2]).unwrap();
    let json = |arguments: &[&str], code| {
        events(at.path(), &[arguments, &["--progress", "json"]].concat(), code)
    };

    let told = json(&["reduce", "cut.laz", "-o", "o.laz"], 1);
    let error = &told[told.len() - 1];
    assert_eq!((&error["event"], &error["kind"]), (&"error".into(), &"data".into()));
    assert_eq!((&error["file"], &error["exit_code"]), (&"cut.laz".into(), &1.into()));
    assert!(error["byte"].is_u64() && error["help"].is_string(), "{error}");
    assert!(error["message"].as_str().unwrap().starts_with("cut.laz: "), "{error}");

    let told = json(&["reduce", "a.laz", "-o", "o.laz", "--split", "x"], 2);
    assert_eq!((names(&told), &told[0]["kind"]), (vec!["error"], &"pipeline".into()));
    let told = json(&["reduce", "no.laz", "-o", "o.laz"], 1);
    assert_eq!((names(&told), &told[0]["kind"]), (vec!["error"], &"io".into()));
    assert!(told[0]["causes"][0].as_str().unwrap().contains("No such file"), "{told:?}");
    let told = json(&["reduce", "a.laz", "-o", "o.laz", "--memory", "1MiB"], 1);
    assert_eq!((names(&told), &told[0]["kind"]), (vec!["error"], &"memory".into()));

    let told = json(&["convert", "p.ply", "-o", "o.las", "--scale", "0.01"], 0);
    let warning = told.iter().find(|e| e["event"] == "warning").expect("rounded coordinates");
    assert!(warning["message"].as_str().unwrap().contains("rounded"), "{warning}");

    let told = json(&["convert", "a.laz", "cut.laz", "-o", "f/", "--to", "las"], 1);
    let ends = ["plan", "done", "error"];
    let told: Vec<&str> = names(&told).into_iter().filter(|name| ends.contains(name)).collect();
    assert_eq!(told, ["plan", "done", "error", "error"]);
}

#[test]
fn quiet_says_nothing_but_errors() {
    let at = scans(&["a.laz", "p.ply"]);
    for arguments in [
        &["reduce", "a.laz", "-o", "o.laz", "--quiet"][..],
        &["convert", "p.ply", "-o", "o.las", "--scale", "0.01", "-q"],
        &["convert", "p.ply", "-o", "f/", "-q", "--progress", "json"],
        &["synth", "part", "-n", "1e2", "-o", "s.laz", "-q"],
    ] {
        let (code, stdout, stderr) = pointmill(at.path(), arguments);
        assert_eq!((code, stdout.as_str(), stderr.as_str()), (0, "", ""), "{arguments:?}");
    }
    let (code, _, stderr) = pointmill(at.path(), &["reduce", "no.laz", "-o", "o.laz", "-q"]);
    assert!(code == 1 && stderr.starts_with("error: no.laz: "), "{stderr}");
}

#[test]
fn verbose_says_what_was_decided_and_how_long_it_took() {
    let at = scans(&["a.laz"]);
    let by_cells = ["reduce", "a.laz", "-o", "o.laz", "-v", "--side", "spread"];
    let (code, stdout, stderr) = pointmill(at.path(), &by_cells);
    assert_eq!(code, 0, "{stderr}");
    for told in ["source   read", "\nscratch  .\n", "\nmill     ", "\ndecided  cells: side = "] {
        assert!(stderr.contains(told), "{told:?}: {stderr}");
    }
    assert!(!stderr.contains('\u{1b}'), "no bar is drawn: {stderr:?}");
    assert!(stdout.starts_with("points     3,000 in, "), "{stdout}");
}

#[test]
fn verbose_and_the_report_say_what_the_memory_was_for() {
    let at = scans(&["a.laz"]);
    for command in ["reduce a.laz -o o.laz -v", "convert a.laz -o o.las -v"] {
        let arguments: Vec<&str> = command.split(' ').chain(["--report", "r.json"]).collect();
        let (code, _, stderr) = pointmill(at.path(), &arguments);
        assert_eq!(code, 0, "{stderr}");
        let line = stderr.lines().find_map(|line| line.strip_prefix("at peak  ")).unwrap();
        let report = std::fs::read(at.path().join("r.json")).unwrap();
        let run = &serde_json::from_slice::<Value>(&report).unwrap()["run"];
        let holders = run["memory_holders"].as_array().unwrap();
        let bytes: Vec<u64> = holders.iter().map(|h| h["bytes"].as_u64().unwrap()).collect();
        assert!((3..=8).contains(&bytes.len()) && bytes.is_sorted_by(|a, b| a >= b), "{run}");
        let first = holders[0]["name"].as_str().unwrap();
        assert!(line.split(',').next().unwrap().ends_with(&format!(" for the {first}")), "{line}");
        assert!(holders.iter().any(|holder| holder["name"] == "program"), "{run}");
        // Those that are not listed hold little.
        let (sum, leased) = (bytes.iter().sum::<u64>(), run["leased_bytes"].as_u64().unwrap());
        assert!(sum <= leased && sum > leased / 10 * 9, "{sum} of {leased}");
    }
}

#[test]
fn every_run_ends_with_a_summary() {
    let at = scans(&["a.laz", "b.laz"]);
    let lines = |arguments: &[&str]| -> Vec<String> {
        let stdout = done(at.path(), arguments);
        stdout.lines().map(|l| l.split("  ").next().unwrap().to_owned()).collect()
    };
    let reduced = lines(&["reduce", "a.laz", "-o", "o.laz", "--report", "r.json"]);
    for heading in ["points", "plane RMS", "deviation", "memory", "time", "output", "report"] {
        assert!(reduced.iter().any(|line| line == heading), "{heading}: {reduced:?}");
    }
    let streamed = ["points", "memory", "time", "output"];
    assert_eq!(lines(&["synth", "part", "-n", "1_000", "-o", "s.laz"]), streamed);
    assert_eq!(lines(&["convert", "a.laz", "-o", "c.las"]), streamed);
    let many = lines(&["convert", "a.laz", "b.laz", "-o", "c/", "--to", "las"]);
    assert_eq!(many, ["files", "points", "memory", "time", "output"]);
}

#[test]
fn classes_that_are_named_are_reduced_and_all_others_stay() {
    let at = tempfile::tempdir().unwrap();
    done(at.path(), &["synth", "als", "-n", "20k", "-o", "a.laz"]);
    let arguments = ["reduce", "a.laz", "-o", "o.laz", "--classes", "2", "--progress", "json"];
    let told = events(at.path(), &arguments, 0);
    let classes = told[told.len() - 1]["classes"].as_array().unwrap();
    assert!(classes.len() >= 3, "{classes:?}");
    for class in classes {
        let (before, after) = (class["before"].as_u64().unwrap(), class["after"].as_u64().unwrap());
        match class["class"].as_u64() {
            Some(2) => assert!(after < before / 2, "{class}"),
            _ => assert_eq!(after, before, "{class}"),
        }
    }
    let told = done(at.path(), &["reduce", "a.laz", "-o", "o.laz"]);
    assert!(told.contains("\nclasses    2 ground "), "{told}");
}

#[test]
fn outliers_passes_marks_and_targets_are_flags_of_reduce() {
    let at = tempfile::tempdir().unwrap();
    done(at.path(), &["synth", "als", "-n", "20k", "-o", "a.laz"]);
    let kept = |flags: &[&str]| {
        let arguments = [&["reduce", "a.laz", "-o", "o.laz", "--progress", "json"], flags].concat();
        let told = events(at.path(), &arguments, 0);
        told[told.len() - 1]["ledger"].clone()
    };
    let once = kept(&[]);
    let twice = kept(&["--passes", "2"]);
    assert!(twice["kept"].as_u64() < once["kept"].as_u64(), "{once} {twice}");
    let marked = kept(&["--mark", "key-point"]);
    assert_eq!(marked["kept"], 20_000, "{marked}");
    let marked = kept(&["--mark", "7"]);
    assert_eq!(marked["kept"], 20_000, "{marked}");
    assert_eq!(kept(&["--keep", "10%"])["kept"], 2_000);
    assert_eq!(kept(&["--keep", "1k"])["kept"], 1_000);
    let covered = kept(&["--max-side", "2"]);
    assert!(covered["kept"].as_u64() > once["kept"].as_u64(), "{once} {covered}");
    let spaced = kept(&["--min-spacing", "2"]);
    assert!(spaced["kept"].as_u64() < once["kept"].as_u64(), "{once} {spaced}");
    let outliers = kept(&["--outliers", "--classes", "2,5,6"]);
    assert_eq!(outliers["removed"][1]["stage"], "outliers", "{outliers}");
}
