//! Rules by which a result is accepted: in the pipeline, on the command line, and what they come to.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::command::{done, fails, pointmill};

/// A scan in the folder, and a pipeline that thins it out and writes a report.
fn pipeline(at: &Path, accept: &str) {
    done(at, &["synth", "part", "-n", "4000", "-o", "scan.laz"]);
    let text = format!(
        "{accept}\n[run]\nreport = 'report.json'\n[[stage]]\nkind = 'read'\npath = 'scan.laz'\n\
         [[stage]]\nkind = 'grid'\nside = 5\n[[stage]]\nkind = 'write'\npath = 'thin.laz'\n"
    );
    fs::write(at.join("p.toml"), text).unwrap();
}

fn report(at: &Path) -> Value {
    serde_json::from_slice(&fs::read(at.join("report.json")).unwrap()).unwrap()
}

#[test]
fn rules_that_hold_are_told_and_the_run_ends_with_0() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    pipeline(at, "[accept]\nrules = ['max <= 10, rms <= 10', 'kept <= 50%, kept >= 1, lossless']");
    let (code, table, told) = pointmill(at, &["run", "p.toml"]);
    assert_eq!(code, 0, "{told}");
    assert_eq!(table.matches("PASS").count(), 5, "{table}");
    let accept = &report(at)["result"]["accept"];
    assert_eq!(accept["passed"], true);
    let rules: Vec<&str> =
        accept["rules"].as_array().unwrap().iter().map(|r| r["rule"].as_str().unwrap()).collect();
    assert_eq!(rules, ["max <= 10", "rms <= 10", "kept <= 50%", "kept >= 1", "lossless"]);
    let totals = &report(at)["result"]["totals"]["deviation"];
    assert_eq!(accept["rules"][0]["found"], totals["max"]);
    assert_eq!(accept["rules"][1]["found"], totals["rms"]);
    assert_eq!(accept["rules"][2]["bound"], 2000.0);
    assert!(totals["max"].as_f64().unwrap() > 0.0);
}

#[test]
fn a_result_that_is_not_accepted_is_written_and_ends_with_3() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    pipeline(at, "[accept]\nrules = 'kept >= 1'");
    let (code, table, told) =
        pointmill(at, &["run", "p.toml", "--accept", "max <= 1e-9, kept >= 1, p50 < 1e-9"]);
    assert_eq!(code, 3, "{told}");
    assert!(table.contains("accept     FAIL  max <= 1e-9, and it is "), "{table}");
    assert!(table.contains("           PASS  kept >= 1, and it is "), "{table}");
    assert!(told.contains("error: the result is not accepted: max <= 1e-9, and it is "), "{told}");
    assert!(told.contains("p50 < 1e-9") && !told.contains("kept"), "{told}");
    assert!(at.join("thin.laz").exists(), "the output is written");
    assert_eq!(report(at)["result"]["accept"]["passed"], false);
    // The file's own rule holds.
    let (code, ..) = pointmill(at, &["run", "p.toml", "--quiet"]);
    assert_eq!(code, 0);
}

#[test]
fn events_say_that_a_result_is_not_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    pipeline(at, "");
    let (code, _, told) =
        pointmill(at, &["run", "p.toml", "--accept", "kept < 1", "--progress", "json"]);
    assert_eq!(code, 3);
    let events: Vec<Value> = told.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |name: &str| events.iter().find(|event| event["event"] == name).unwrap();
    assert_eq!(of("done")["accept"]["passed"], false);
    assert_eq!(
        (&of("error")["kind"], &of("error")["exit_code"]),
        (&"not accepted".into(), &3.into())
    );
}

#[test]
fn rules_that_a_run_cannot_answer_are_refused_before_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    pipeline(at, "");
    for (arguments, told) in [
        (
            &["convert", "scan.laz", "-o", "o.las", "--accept", "p99 <= 1"][..],
            "does not measure `p99`",
        ),
        (&["convert", "scan.laz", "-o", "o.ply", "--accept", "lossless"], "another form"),
        (
            &["convert", "scan.laz", "-o", "o.las", "--scale", "1", "--accept", "lossless"],
            "another",
        ),
        (&["run", "p.toml", "--accept", "max <= 5mm"], "has a unit, and the scan does not say"),
        (&["run", "p.toml", "--accept", "mxa <= 5"], "did you mean `max`?"),
        (
            &["run", "read scan.laz ! assign 'UserData = 1' ! write o.las", "--accept", "lossless"],
            "`assign` changes records",
        ),
    ] {
        fails(at, arguments, 2, &[told, "accept"]);
        assert!(["o.las", "o.ply", "thin.laz"].iter().all(|name| !at.join(name).exists()));
    }
    fails(at, &["verify", "scan.laz", "scan.laz", "--accept", "max <= 1"], 2, &["--accept"]);
    let (code, ..) = pointmill(at, &["convert", "scan.laz", "-o", "o.las", "--accept", "lossless"]);
    assert_eq!(code, 0);
}

#[test]
fn each_branch_is_held_to_the_rules() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    pipeline(at, "");
    let text = "[[stage]]\nkind = 'read'\npath = 'scan.laz'\n\
                [[stage]]\nkind = 'grid'\nfrom = 'read'\nside = 5\n\
                [[stage]]\nkind = 'write'\npath = 'fine.laz'\n\
                [[stage]]\nkind = 'grid'\nfrom = 'read'\nside = 40\n\
                [[stage]]\nkind = 'write'\npath = 'coarse.laz'\n";
    fs::write(
        at.join("two.toml"),
        text.replacen("kind = 'read'", "kind = 'read'\nname = 'all'", 1)
            .replace("from = 'read'", "from = 'all'"),
    )
    .unwrap();
    let (code, table, told) =
        pointmill(at, &["run", "two.toml", "--accept", "kept >= 500", "--report", "report.json"]);
    assert_eq!(code, 3, "{told}");
    let report = report(at);
    let passed = |result: &Value| result["accept"]["passed"].as_bool().unwrap();
    assert!(passed(&report["result"]) && !passed(&report["further"][0]), "{table}");
}
