//! Inputs as people name them: blanks, Unicode, dashes, folders, patterns, and many of them.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::support::command::{PROGRAM, done, pointmill, scans};
use serde_json::Value;

fn points(at: &Path, file: &str) -> u64 {
    let told: Value = serde_json::from_str(&done(at, &["info", "--json", "--", file])).unwrap();
    told[0]["points"].as_u64().unwrap()
}

#[test]
fn names_may_have_blanks_accents_and_dashes() {
    let names = ["two words.laz", "Größe 测量 🏔.laz", "-v.laz", "[a] 'q\" $x;*?.laz"];
    let at = scans(&["a.laz"]);
    for name in names {
        fs::copy(at.path().join("a.laz"), at.path().join(name)).unwrap();
        let output = format!("{name}.out.las");
        let to = format!("--output={output}");
        let reduced = done(at.path(), &["reduce", &to, "--", name]);
        assert!(reduced.starts_with("points     3,000 in, "), "{name}: {reduced}");
        assert!(reduced.contains(&format!("\noutput     {output}, ")), "{name}: {reduced}");
        assert!(points(at.path(), &output) > 0, "{name}");
        let dotted = format!("./{name}");
        done(at.path(), &["convert", &dotted, "-o", "converted/"]);
        assert_eq!(points(at.path(), &format!("converted/{name}")), 3_000, "{name}");
    }
}

#[test]
fn relative_paths_folders_and_patterns_mean_the_same_files() {
    let at = scans(&["a.laz", "b.laz"]);
    let inner = at.path().join("survey 1/inner");
    fs::create_dir_all(&inner).unwrap();
    for name in ["a.laz", "b.laz"] {
        fs::rename(at.path().join(name), at.path().join("survey 1").join(name)).unwrap();
    }
    fs::write(at.path().join("survey 1/readme.txt"), "not a scan").unwrap();
    let mut outputs = Vec::new();
    for (i, inputs) in
        [&["../a.laz", "../b.laz"][..], &[".."], &["../*.laz"], &["../../survey 1/?.laz"]]
            .iter()
            .enumerate()
    {
        let output = format!("o{i}.las");
        done(&inner, &[&["reduce", "-o", &output][..], inputs].concat());
        outputs.push(fs::read(inner.join(output)).unwrap());
    }
    assert!(outputs.windows(2).all(|pair| pair[0] == pair[1]) && !outputs[0].is_empty());
}

/// `count` copies of a scan of 4 points in the folder `many`.
fn many(at: &Path, count: usize, extension: &str) {
    let one = format!("one.{extension}");
    done(at, &["synth", "plane", "-n", "4", "-o", &one]);
    let bytes = fs::read(at.join(one)).unwrap();
    fs::create_dir(at.join("many")).unwrap();
    for i in 0..count {
        fs::write(at.join(format!("many/tile {i:04}.{extension}")), &bytes).unwrap();
    }
}

#[test]
fn a_pattern_may_mean_thousands_of_files() {
    let at = tempfile::tempdir().unwrap();
    many(at.path(), 3_000, "las");
    let told = done(at.path(), &["reduce", "many/*.las", "-o", "o.las", "--threads", "2"]);
    assert!(told.starts_with("points     12,000 in, "), "{told}");
    let (code, _, stderr) =
        pointmill(at.path(), &["convert", "many", "-o", "o.laz", "--progress", "json"]);
    assert_eq!(code, 0, "{stderr}");
    assert!(stderr.lines().next().unwrap().contains("\"inputs\":3000,"), "{stderr}");
    assert_eq!(points(at.path(), "o.laz"), 12_000);
}

#[test]
fn more_inputs_than_a_process_may_open_files_are_read() {
    for extension in ["laz", "ply"] {
        let at = tempfile::tempdir().unwrap();
        many(at.path(), 1_000, extension);
        for command in ["reduce", "convert"] {
            let output = format!("{command}.{extension}");
            let limited = format!(
                "ulimit -n 256 && exec '{PROGRAM}' {command} 'many/*' -o {output} --threads 4"
            );
            let run = Command::new("sh")
                .current_dir(at.path())
                .args(["-c", &limited])
                .stdin(Stdio::null())
                .output()
                .unwrap();
            let told = String::from_utf8_lossy(&run.stdout);
            let stderr = String::from_utf8_lossy(&run.stderr);
            assert!(run.status.success(), "{command} {extension}: {stderr}");
            assert!(told.starts_with("points     4,000 in, "), "{command} {extension}: {told}");
        }
    }
}
