//! `info --deep`: what all points of a file come to.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::command::{done, fails, pointmill};

fn deep(at: &Path, file: &str, more: &[&str]) -> Value {
    let all = done(at, &[&["info", "--deep", "--json", file], more].concat());
    let all: Value = serde_json::from_str(&all).unwrap();
    all[0]["deep"].clone()
}

/// A field of points, 0.5 apart, of two classes.
fn field(at: &Path) {
    let mut text = String::from("X,Y,Z,Intensity,Classification,ReturnNumber,NumberOfReturns\n");
    for (i, j) in (0..400).flat_map(|i| (0..300).map(move |j| (i, j))) {
        let [x, y] = [f64::from(i) * 0.5, f64::from(j) * 0.5];
        let class = if j < 100 { 2 } else { 6 };
        text += &format!("{x},{y},{},{},{class},1,{}\n", f64::from(i) / 100.0, j, 1 + i % 2);
    }
    fs::write(at.join("field.csv"), text).unwrap();
    done(at, &["convert", "field.csv", "-o", "field.laz", "--scale", "0.01", "--quiet"]);
}

#[test]
fn the_points_of_a_field_are_told_as_they_are() {
    let at = tempfile::tempdir().unwrap();
    field(at.path());
    for file in ["field.laz", "field.csv"] {
        let told = deep(at.path(), file, &[]);
        assert_eq!(told["points"], 120_000);
        let density = told["density"]["points_per_square"].as_f64().unwrap();
        assert!((density - 4.0).abs() < 0.2, "{density}");
        let classes = told["classes"].as_array().unwrap();
        let classes: Vec<_> =
            classes.iter().map(|c| (&c["class"], &c["name"], &c["points"])).collect();
        let (ground, building) = ("ground".into(), "building".into());
        let (two, six, few, many) = (2.into(), 6.into(), 40_000.into(), 80_000.into());
        assert_eq!(classes, [(&two, &ground, &few), (&six, &building, &many)]);
        assert_eq!(told["returns"][0]["points"], 120_000);
        assert_eq!(told["returns"][1]["of_pulses"], 60_000);
        let named = |name: &str| {
            let all = told["dimensions"].as_array().unwrap();
            all.iter().find(|dimension| dimension["name"] == name).unwrap().clone()
        };
        let z = named("Z");
        let figure = |key: &str| z[key].as_f64().unwrap();
        assert!((figure("mean") - 1.995).abs() < 1e-9 && figure("min") == 0.0, "{z}");
        assert!((figure("max") - 3.99).abs() < 1e-9);
        assert_eq!(named("Classification")["distinct"], 2);
        let heights = &told["quantiles"][0];
        assert_eq!(heights["name"], "Z");
        let median = heights["values"][4][1].as_f64().unwrap();
        assert!((median - 2.0).abs() < 0.02, "{heights}");
    }
}

#[test]
fn threads_change_no_figure() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "als", "-n", "300k", "-o", "scan.laz"]);
    let one = deep(at, "scan.laz", &["--threads", "1"]);
    assert_eq!(deep(at, "scan.laz", &["--threads", "4"]), one);
    assert_eq!(one["points"], 300_000);
    assert!(one["dimensions"].as_array().unwrap().iter().any(|d| !d["set"].is_null()));
    let text = done(at, &["info", "--deep", "scan.laz"]);
    for part in ["points per", "ground", "####", "Intensity", "50 %"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert!(!done(at, &["info", "scan.laz"]).contains("deep"));
}

#[test]
fn a_file_that_cannot_be_read_is_told_and_the_others_are_shown() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    field(at);
    fs::write(at.join("bad.csv"), "x,y,z\n1,2,3\n4,5,oops\n").unwrap();
    let (code, text, error) = pointmill(at, &["info", "--deep", "bad.csv", "field.laz"]);
    assert_eq!(code, 1);
    assert!(error.contains("bad.csv") && text.contains("120,000"), "{error}{text}");
    fails(at, &["info", "--deep", "field.laz", "--memory", "1MiB"], 1, &["--memory"]);
}
