//! The program as a user starts it.

use std::path::Path;
use std::process::{Command, Stdio};

/// The program with `arguments` in the folder `at`.
pub fn command(at: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("pointmill"));
    command.current_dir(at).args(arguments).stdin(Stdio::null());
    command
}

/// Exit code, stdout and stderr.
pub fn pointmill(at: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = command(at, arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().expect("an exit code"), text(output.stdout), text(output.stderr))
}

/// Runs a command that must succeed and say nothing, but what it chose for so few points; its stdout.
pub fn done(at: &Path, arguments: &[&str]) -> String {
    let (code, stdout, stderr) = pointmill(at, arguments);
    let noise = |line: &&str| {
        line.starts_with("warning: normals scatter 0.") || line.starts_with("chosen   neighbors ")
    };
    let told: Vec<&str> = stderr.lines().filter(|line| !noise(line)).collect();
    assert_eq!((code, told), (0, Vec::new()), "{arguments:?}");
    stdout
}

/// Runs a command that must fail with `code` and say each of `parts` on stderr.
pub fn fails(at: &Path, arguments: &[&str], code: i32, parts: &[&str]) {
    let (given, stdout, stderr) = pointmill(at, arguments);
    assert_eq!(given, code, "{arguments:?}: {stderr}");
    assert_eq!(stdout, "", "{arguments:?}");
    for part in parts {
        assert!(stderr.contains(part), "{arguments:?} says {part:?}:\n{stderr}");
    }
}

/// A folder of made-up scans with these names.
pub fn scans(names: &[&str]) -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    for (i, name) in names.iter().enumerate() {
        let (points, seed) = ((3_000 + i).to_string(), i.to_string());
        done(at.path(), &["synth", "part", "-n", &points, "-o", name, "--seed", &seed]);
    }
    at
}
