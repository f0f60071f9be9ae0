//! `reproduce`: outputs say how they were made, and are made again by it.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::support::command::{done, fails, pointmill, scans};

/// What a LAS file says of how it was made.
fn said(path: &Path) -> Value {
    let bytes = fs::read(path).unwrap();
    let at = bytes.windows(13).position(|w| w == b"{\"pointmill\":").expect("a note");
    let mut values = serde_json::Deserializer::from_slice(&bytes[at..]).into_iter();
    values.next().unwrap().unwrap()
}

/// The hash that other programs give.
fn sha256(path: &Path) -> String {
    let told = std::process::Command::new("sha256sum").arg(path).output().unwrap();
    let told = String::from_utf8(told.stdout).unwrap();
    told.split_whitespace().next().unwrap().to_owned()
}

fn reproduced(at: &Path, file: &str) {
    let told = done(at, &["reproduce", file]);
    assert!(told.starts_with(&format!("{file} is reproduced: the same ")), "{told}");
}

#[test]
fn an_output_says_its_pipeline_and_the_hashes_of_its_inputs() {
    let at = scans(&["b.laz", "a.laz"]);
    let at = at.path();
    fs::create_dir(at.join("out")).unwrap();
    let report = ["--report", "out/r.json"];
    let run = ["reduce", "b.laz", "a.laz", "-o", "out/r.laz", "--keep", "500", "--threads", "1"];
    done(at, &[&run[..], &report].concat());
    let told = said(&at.join("out/r.laz"));
    let input = |name: &str| {
        let (path, bytes) = (at.join(name), fs::metadata(at.join(name)).unwrap().len());
        json!({ "path": format!("../{name}"), "bytes": bytes, "sha256": sha256(&path) })
    };
    assert_eq!(told["inputs"], json!([input("a.laz"), input("b.laz")]));
    assert_eq!(told["pointmill"], env!("CARGO_PKG_VERSION"));
    assert_eq!(told["run"], json!({ "noise": "drop" }), "what decides alone");
    assert_eq!(told["stage"][0]["path"], json!(["../a.laz", "../b.laz"]));
    assert_eq!(told["stage"][1]["keep"], 500);
    assert_eq!((&told["output"], &told["stage"][2]["path"]), (&told["output"], &told["output"]));
    assert_eq!(told["output"], "output.laz");
    let report: Value = serde_json::from_slice(&fs::read(at.join("out/r.json")).unwrap()).unwrap();
    let hash = |of: &str, n: usize| report["run"][of][n]["sha256"].as_str().unwrap().to_owned();
    assert_eq!(
        [hash("inputs", 0), hash("inputs", 1)],
        ["b.laz", "a.laz"].map(|n| sha256(&at.join(n)))
    );
    assert_eq!(hash("outputs", 0), sha256(&at.join("out/r.laz")));
    reproduced(at, "out/r.laz");
    assert_eq!(fs::read_dir(at.join("out")).unwrap().count(), 2, "no scratch is left");
}

#[test]
fn what_an_output_says_depends_on_what_was_read_alone() {
    let at = scans(&["a.laz", "b.laz"]);
    let at = at.path();
    let run = |inputs: &[&str], more: &[&str]| {
        let keep = ["-o", "r.laz", "--keep", "500"];
        done(at, &[&["reduce"], inputs, &keep, more].concat());
        fs::read(at.join("r.laz")).unwrap()
    };
    let first = run(&["a.laz", "b.laz"], &["--threads", "1"]);
    let typed = at.join("b.laz");
    let again = [typed.to_str().unwrap(), "./a.laz"];
    let scratch = std::env::temp_dir();
    let scratch = scratch.to_str().unwrap();
    let more = ["--threads", "2", "--memory", "300MiB", "--scratch", scratch, "--report", "r.json"];
    assert!(run(&again, &more) == first, "order, ways, threads, memory, scratch, report");
    let bare = run(&["a.laz", "b.laz"], &["--no-provenance"]);
    assert!(bare.len() < first.len() && !bare.windows(9).any(|w| w == b"\"sha256\":"));
    assert!(run(&again, &["--no-provenance"]) == bare);
    // A folder that is moved with all that is in it.
    fs::create_dir(at.join("moved")).unwrap();
    for name in ["a.laz", "b.laz"] {
        fs::rename(at.join(name), at.join("moved").join(name)).unwrap();
    }
    fs::write(at.join("moved/r.laz"), &first).unwrap();
    reproduced(at, "moved/r.laz");
    fails(at, &["reproduce", "r.laz"], 2, &["does not say how it was made", "provenance"]);
}

#[test]
fn every_kind_of_output_is_reproduced() {
    let at = scans(&["a.laz", "b.las"]);
    let at = at.path();
    fs::write(at.join("area.wkt"), "POLYGON((-20 -20, 60 -20, 60 60, -20 60))").unwrap();
    let both = "read [b.las,a.laz]";
    for (line, outputs) in [
        // In the order of the inputs, streamed; PLY, binary and text.
        ("read b.las ! write o.ply".to_owned(), &["o.ply"][..]),
        (format!("{both} ! sample every=3 ! write o.ply encoding=ascii"), &["o.ply"]),
        (format!("{both} ! assign set=\"UserData = 3\" ! write o.las"), &["o.las"]),
        (format!("{both} ! crop file=area.wkt ! grid side=2 ! write o.laz"), &["o.laz"]),
        (format!("{both} ! grid side=2 ! write folder=each format=laz"), &["each/a.laz"]),
        (
            format!("{both} ! write path=\"cut/{{x}}_{{y}}.laz\" side=50 order=canonical"),
            &["cut/0_0.laz"],
        ),
        ("synth sphere points=3000 seed=4 ! grid side=0.3 ! write o.laz".to_owned(), &["o.laz"]),
    ] {
        done(at, &["run", &line]);
        outputs.iter().for_each(|output| reproduced(at, output));
    }
}

#[test]
fn each_of_several_outputs_is_reproduced() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    let pipeline = "
        [run]
        withheld = \"keep\"
        memory = \"1GiB\"
        stage = [
            {kind = \"read\", path = \"a.laz\", name = \"scan\"},
            {kind = \"write\", path = \"all.ply\", from = \"scan\"},
            {kind = \"grid\", side = 2.0, from = \"scan\"},
            {kind = \"write\", path = \"thin.las\"},
        ]";
    let (run, stages) = pipeline.split_at(pipeline.find("stage = ").unwrap());
    fs::write(at.join("p.toml"), format!("{stages}\n{run}")).unwrap();
    done(at, &["run", "p.toml"]);
    assert_eq!(said(&at.join("thin.las"))["output"], "output-2.las");
    assert_eq!(said(&at.join("thin.las"))["run"], json!({ "withheld": "keep" }));
    ["all.ply", "thin.las"].iter().for_each(|output| reproduced(at, output));
}

#[test]
fn what_an_input_says_of_itself_is_not_carried_on() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    for (from, to) in
        [("a.laz", "b.ply"), ("b.ply", "c.ply"), ("a.laz", "d.las"), ("d.las", "e.laz")]
    {
        done(at, &["convert", from, "-o", to]);
        let bytes = fs::read(at.join(to)).unwrap();
        let notes = bytes.windows(13).filter(|w| *w == b"{\"pointmill\":").count();
        assert_eq!(notes, 1, "{to}");
        reproduced(at, to);
    }
    done(at, &["convert", "b.ply", "-o", "bare.ply", "--no-provenance"]);
    let bare = fs::read(at.join("bare.ply")).unwrap();
    assert!(!bare.windows(12).any(|w| w == b"{\"pointmill\""));
}

#[test]
fn a_file_that_was_changed_is_told() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    done(at, &["run", "read a.laz ! grid side=1 ! write r.las"]);
    let mut bytes = fs::read(at.join("r.las")).unwrap();
    let place = bytes.len() - 7;
    bytes[place] ^= 1;
    fs::write(at.join("r.las"), &bytes).unwrap();
    let (code, told, error) = pointmill(at, &["reproduce", "r.las", "--json"]);
    let told: Value = serde_json::from_str(&told).unwrap();
    assert_eq!((code, &told["same"], &told["differs_at"]), (1, &json!(false), &json!(place)));
    assert_eq!(told["inputs"][0]["sha256"], sha256(&at.join("a.laz")));
    assert!(error.contains("r.las: the run that made it gives other bytes"), "{error}");
    bytes.truncate(place);
    fs::write(at.join("r.las"), &bytes).unwrap();
    fails(at, &["reproduce", "r.las"], 1, &["they differ from byte ", "instead of"]);
}

#[test]
fn inputs_that_are_missing_or_others_are_all_named() {
    let at = scans(&["a.laz", "b.laz", "c.laz"]);
    let at = at.path();
    done(at, &["run", "read [a.laz,b.laz,c.laz] ! grid side=1 ! write r.las"]);
    let bytes = fs::read(at.join("b.laz")).unwrap();
    let mut other = bytes.clone();
    *other.last_mut().unwrap() ^= 1;
    fs::write(at.join("b.laz"), &other).unwrap();
    fs::rename(at.join("a.laz"), at.join("elsewhere.laz")).unwrap();
    fs::copy(at.join("b.laz"), at.join("kept.laz")).unwrap();
    fs::write(at.join("c.laz"), &bytes[..100]).unwrap();
    let told =
        ["3 mistakes", "the input a.laz is not there", "SHA-256 differ", "this file has 100"];
    fails(at, &["reproduce", "r.las"], 2, &told);
    // In a folder that is named, the first by its name.
    fs::create_dir(at.join("found")).unwrap();
    fails(at, &["reproduce", "r.las", "--inputs", "found"], 2, &["c.laz is not there"]);
    done(at, &["synth", "part", "-n", "3002", "-o", "found/c.laz", "--seed", "2"]);
    fs::write(at.join("found/b.laz"), &bytes).unwrap();
    fs::rename(at.join("elsewhere.laz"), at.join("found/a.laz")).unwrap();
    done(at, &["reproduce", "r.las", "--inputs", "found"]);
}

#[test]
fn what_cannot_be_tried_is_refused() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    fs::write(at.join("no.laz"), "no scan").unwrap();
    let untold = "does not say how it was made";
    fails(at, &["reproduce", "no.laz"], 2, &["no.laz", untold]);
    fails(at, &["reproduce", "none.laz"], 2, &["none.laz"]);
    fails(at, &["reproduce", "a.laz", "--report", "r.json"], 2, &["--report"]);
    // A note that would have other files read, or written over, does neither.
    done(at, &["convert", "a.laz", "-o", "r.las"]);
    let bytes = fs::read(at.join("r.las")).unwrap();
    let changed = |from: &[u8], to: &[u8]| {
        let mut bytes = bytes.clone();
        let at_byte = bytes.windows(from.len()).position(|w| w == from).unwrap();
        bytes[at_byte..at_byte + from.len()].copy_from_slice(to);
        fs::write(at.join("r.las"), bytes).unwrap();
    };
    changed(b"\"path\":\"output.las\"", b"\"path\":\"/utput.las\"");
    fails(at, &["reproduce", "r.las"], 2, &["r.las", "writes elsewhere"]);
    changed(b"\"read\",\"path\":\"a", b"\"read\",\"path\":\"b");
    fails(at, &["reproduce", "r.las"], 2, &["made of b.laz", "no hash"]);
    changed(b"{\"pointmill\":\"0", b"{\"pointmill\":\"9");
    let told = done(at, &["reproduce", "r.las"]);
    assert!(told.contains("the same") && told.contains("pointmill 9."), "{told}");
    changed(b"\"kind\":\"read", b"\"kind\":\"raed");
    fails(at, &["reproduce", "r.las"], 2, &["r.las", "raed"]);
}
