//! What users get wrong, and what they are told: a wrong pipeline or a wrong command in each file,
//! with the exact text that the program answers, which a reviewer reads as a user would.
//!
//! `pipelines/` has files and lines for `pointmill check`, each with its answer beside it in a
//! `.txt`; `commands/` has a command and its answer in each file; `inputs/` is what they read,
//! besides the scans that are made here. `POINTMILL_WRITE_DOCS=1` writes the answers again.

use std::fs;
use std::path::{Path, PathBuf};

use crate::docs::examples::shell_words;
use crate::support::case_file;
use crate::support::command::{done, pointmill};

/// Pipelines and commands at least.
const PIPELINES: usize = 80;
const COMMANDS: usize = 40;

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/wrong").join(name)
}

/// The files of a folder of this one, sorted.
fn files(name: &str) -> Vec<PathBuf> {
    let files = fs::read_dir(folder(name)).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = files.collect();
    files.sort();
    files
}

/// A folder with all that the pipelines and the commands read.
fn inputs() -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    let copy = |from: &Path, name: &str| {
        fs::copy(from, at.path().join(name)).unwrap();
    };
    for input in files("inputs") {
        copy(&input, input.file_name().unwrap().to_str().unwrap());
    }
    copy(&case_file("190-float-intensity.ply"), "float-intensity.ply");
    copy(&case_file("108-float-utm.ply"), "float-utm.ply");
    for (scene, name) in [("als", "scan.laz"), ("part", "part.las"), ("part", "cloud.ply")] {
        done(at.path(), &["synth", scene, "-n", "1000", "-o", name]);
    }
    fs::create_dir(at.path().join("folder.laz")).unwrap();
    at
}

/// What a wrong command is told, and its exit code, which is none of success.
fn told(at: &Path, arguments: &[&str]) -> String {
    let (code, stdout, stderr) = pointmill(at, arguments);
    assert!(code != 0, "{arguments:?} is right: {stdout}");
    let here = at.canonicalize().unwrap().display().to_string();
    format!("{stdout}{stderr}exit code {code}\n").replace(&here, "/home/user/survey")
}

/// Compares what is told with what the file says, or writes it; returns both where they differ.
fn differs(file: &Path, told: &str) -> Option<String> {
    if std::env::var_os("POINTMILL_WRITE_DOCS").is_some() {
        fs::write(file, told).unwrap();
        return None;
    }
    let kept = fs::read_to_string(file).unwrap_or_default();
    let name = file.display();
    (kept != told).then(|| format!("{name} is\n{kept}\nand it is told\n{told}"))
}

fn none_differ(differing: &[String]) {
    assert!(differing.is_empty(), "{} answers differ\n{}", differing.len(), differing.join("\n"));
}

#[test]
fn wrong_pipelines_are_told_what_their_files_say() {
    let at = inputs();
    let (told_texts, wrong): (Vec<_>, Vec<_>) = files("pipelines")
        .into_iter()
        .partition(|file| file.extension().is_some_and(|ending| ending == "txt"));
    assert!(wrong.len() >= PIPELINES, "{} wrong pipelines", wrong.len());
    let mut differing = Vec::new();
    for file in &wrong {
        let name = file.file_name().unwrap().to_str().unwrap();
        fs::copy(file, at.path().join(name)).unwrap();
        let line = fs::read_to_string(file).unwrap();
        let pipeline = if name.ends_with(".line") { line.trim_end() } else { name };
        let told = told(at.path(), &["check", pipeline]);
        differing.extend(differs(&file.with_extension("txt"), &told));
    }
    none_differ(&differing);
    let lost = told_texts.iter().find(|text| {
        ["toml", "json", "line"].iter().all(|ending| !text.with_extension(ending).exists())
    });
    assert_eq!(lost, None, "an answer to no pipeline");
}

#[test]
fn wrong_commands_are_told_what_their_files_say() {
    let (at, all) = (inputs(), files("commands"));
    assert!(all.len() >= COMMANDS, "{} wrong commands", all.len());
    let mut differing = Vec::new();
    for file in &all {
        let text = fs::read_to_string(file).unwrap();
        let line = text.lines().next().unwrap_or_default();
        let command = line.strip_prefix("$ pointmill ").expect("a command in the first line");
        let told = told(at.path(), &shell_words(command));
        differing.extend(differs(file, &format!("{line}\n{told}")));
    }
    none_differ(&differing);
}
