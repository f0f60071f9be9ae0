//! `plan`: what a run is expected to use and to leave, beside what it then does.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::command::{done, fails, scans};

/// By how much a prediction may be off, as a share of what came.
const OFF: f64 = 0.3;

/// A made-up airborne scan of so many points.
fn scan(at: &Path, name: &str, points: &str) {
    done(at, &["synth", "als", "-n", points, "-o", name, "--seed", "3", "--quiet"]);
}

fn json(at: &Path, arguments: &[&str]) -> Value {
    serde_json::from_str(&done(at, &[arguments, &["--json"]].concat())).unwrap()
}

fn number(value: &Value, key: &str) -> f64 {
    value.pointer(key).and_then(Value::as_f64).unwrap_or_else(|| panic!("{key} in {value:#}"))
}

/// Predicts and runs a pipeline: outputs are as predicted, and neither memory nor scratch files are
/// much more.
fn assert_foretold(at: &Path, pipeline: &str, arguments: &[&str]) -> (Value, Value) {
    let foretold = json(at, &[&["plan", pipeline], arguments].concat())["prediction"].clone();
    let report = ["--report", "r.json", "--quiet"];
    done(at, &[&["run", pipeline], arguments, &report].concat());
    let report: Value = serde_json::from_slice(&fs::read(at.join("r.json")).unwrap()).unwrap();
    let run = &report["run"];
    let outputs = run["outputs"].as_array().unwrap();
    assert_eq!(foretold["outputs"].as_array().unwrap().len(), outputs.len());
    for (n, output) in outputs.iter().enumerate() {
        for key in ["points", "bytes"] {
            let came = number(output, &format!("/{key}"));
            let said = number(&foretold, &format!("/outputs/{n}/{key}"));
            assert!((said - came).abs() <= OFF * came, "{key}: {said} foretold, {came} came");
        }
    }
    for (said, came) in
        [("peak_memory_bytes", "/peak_memory_bytes"), ("scratch_bytes", "/spill_bytes")]
    {
        let (said_bytes, came) = (number(&foretold, &format!("/{said}")), number(run, came));
        assert!(said_bytes >= (1.0 - OFF) * came, "{said}: {said_bytes} foretold, {came} came");
    }
    (foretold, report)
}

#[test]
fn outputs_memory_and_scratch_files_are_as_foretold() {
    let at = scans(&[]);
    let at = at.path();
    scan(at, "in.laz", "1M");
    let mut tried = Vec::new();
    for pipeline in [
        "read in.laz ! normals ! cells ! median ! write a.laz",
        "read in.laz ! normals ! cells keep=70k ! median ! write b.laz",
        "read in.laz ! grid side=1.5 ! write c.ply",
        "read in.laz ! filter keep_classes=[2] ! write d.laz",
        "read in.laz ! write e.las",
    ] {
        let (foretold, _) = assert_foretold(at, pipeline, &["--threads", "2"]);
        tried.push(number(&foretold, "/trial/points"));
        let (cpu, seconds) = (number(&foretold, "/cpu_seconds"), number(&foretold, "/seconds"));
        let phases = foretold["phases"].as_array().unwrap();
        let all: f64 = phases.iter().map(|phase| number(phase, "/cpu_seconds")).sum();
        assert!(cpu > 0.0 && seconds <= cpu && (all - cpu).abs() < 1e-9, "{foretold:#}");
    }
    assert!(tried.iter().all(|points| (100_000.0..600_000.0).contains(points)), "{tried:?}");
    let spilled = "read in.laz ! grid side=1.5 ! write f.laz";
    let (foretold, _) = assert_foretold(at, spilled, &["--set", "run.spill=always"]);
    assert!(number(&foretold, "/scratch_bytes") > 2e7, "{foretold:#}");
}

#[test]
fn several_inputs_and_outputs_are_foretold_and_small_scans_are_tried_as_a_whole() {
    let at = scans(&["a.laz", "b.laz"]);
    let text = "[[stage]]\nkind = 'read'\npath = 'a.laz'\nname = 'a'\n\
                [[stage]]\nkind = 'read'\npath = 'b.laz'\nname = 'b'\n\
                [[stage]]\nkind = 'merge'\nfrom = ['a', 'b']\nname = 'all'\n\
                [[stage]]\nkind = 'grid'\nside = 0.2\n[[stage]]\nkind = 'write'\npath = 'c.laz'\n\
                [[stage]]\nkind = 'filter'\nfrom = 'all'\nwhere = 'Z > 0'\n\
                [[stage]]\nkind = 'write'\npath = 'd.laz'\n";
    fs::write(at.path().join("p.toml"), text).unwrap();
    let (foretold, report) = assert_foretold(at.path(), "p.toml", &[]);
    let read = number(&report, "/result/ledger/read");
    assert_eq!(number(&foretold, "/trial/points"), read);
    for n in 0..2 {
        let key = format!("/outputs/{n}/points");
        let came = number(&report, &format!("/run{key}"));
        assert_eq!(number(&foretold, &key), came, "all points were tried");
        assert!(came > 0.0);
    }
    fs::create_dir(at.path().join("each")).unwrap();
    let folder = "read [a.laz, b.laz] ! grid side=0.2 ! write folder=each";
    let told = json(at.path(), &["plan", folder]);
    assert_eq!(told["prediction"]["outputs"][0]["path"], "each", "{told:#}");
    assert!(number(&told, "/prediction/outputs/0/points") > 100.0, "{told:#}");
}

#[test]
fn without_a_trial_what_headers_cannot_tell_is_left_out_and_said() {
    let at = scans(&["a.laz"]);
    let reduce = "read a.laz ! grid side=0.2 ! write b.laz";
    let told = done(at.path(), &["plan", reduce, "--no-trial"]);
    assert!(told.contains("outputs: not known: no trial was made"), "{told}");
    assert!(told.contains("time: not known") && !told.contains("CPU s"), "{told}");
    let told = json(at.path(), &["plan", reduce, "--no-trial"]);
    let foretold = &told["prediction"];
    for key in ["/cpu_seconds", "/seconds", "/outputs/0/points", "/outputs/0/bytes", "/trial"] {
        assert_eq!(foretold.pointer(key), Some(&Value::Null), "{key}");
    }
    assert!(number(foretold, "/peak_memory_bytes") > 1e6);
    let told = json(at.path(), &["plan", "read a.laz ! write b.las", "--no-trial"]);
    let points = number(&told, "/source/points");
    assert_eq!(number(&told, "/prediction/outputs/0/points"), points, "nothing is removed");
    assert_eq!(told["passes"], Value::Array(Vec::new()));
}

#[test]
fn a_plan_says_what_it_tried_and_leaves_nothing_behind() {
    let at = scans(&["a.laz"]);
    fs::create_dir(at.path().join("scratch")).unwrap();
    let line = "read a.laz ! grid side=0.2 ! write b.laz";
    let spill = ["--set", "run.spill=always", "--scratch", "scratch"];
    let told = done(at.path(), &[&["plan", line], &spill[..]].concat());
    let (_, trial) = told.split_once("a trial on 3,").unwrap_or_else(|| panic!("{told}"));
    assert!(trial.contains(" points, which took "), "{told}");
    let there = |folder: &Path| fs::read_dir(folder).unwrap().count();
    assert_eq!((there(at.path()), there(&at.path().join("scratch"))), (2, 0));
    fails(at.path(), &["run", line, "--no-trial"], 2, &["--no-trial"]);
}
