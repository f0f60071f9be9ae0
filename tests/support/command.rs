//! The program as a user starts it.

use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// The program.
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_pointmill");

/// Time that a run may take: one that hangs is ended, and fails its test.
const PATIENCE: Duration = Duration::from_secs(900);

/// The program with `arguments` in the folder `at`.
pub fn command<S: AsRef<OsStr>>(at: &Path, arguments: &[S]) -> Command {
    let mut command = Command::new(PROGRAM);
    command.current_dir(at).args(arguments).stdin(Stdio::null());
    command
}

/// Exit code, stdout and stderr.
pub fn pointmill<S: AsRef<OsStr>>(at: &Path, arguments: &[S]) -> (i32, String, String) {
    let output = ended(command(at, arguments), PATIENCE);
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().expect("an exit code"), text(output.stdout), text(output.stderr))
}

/// What a command came to that must end within `limit`.
pub fn ended(command: Command, limit: Duration) -> std::process::Output {
    assert_cmd::Command::from_std(command).timeout(limit).output().unwrap()
}

/// The same arguments in one text; exit code and stderr.
pub fn pointmill_told(at: &Path, arguments: &str) -> (i32, String) {
    let (code, _, told) = pointmill(at, &arguments.split_whitespace().collect::<Vec<_>>());
    (code, told)
}

/// The budget in mebibytes that a refusal's last line names.
pub fn mebibytes(told: &str) -> u64 {
    let help = told.lines().rfind(|line| line.starts_with("help:"));
    let before = help.and_then(|help| help.split_once("MiB")).unwrap_or_else(|| panic!("{told}")).0;
    before.rsplit(|c: char| !c.is_ascii_digit()).next().unwrap().parse().unwrap()
}

/// Runs a command that must succeed and say nothing, but what it chose for so few points; its
/// stdout.
pub fn done(at: &Path, arguments: &[&str]) -> String {
    let (code, stdout, stderr) = pointmill(at, arguments);
    let noise = |line: &&str| {
        line.starts_with("warning: normals scatter 0.") || line.starts_with("chosen   neighbors ")
    };
    let told: Vec<&str> = stderr.lines().filter(|line| !noise(line)).collect();
    assert_eq!((code, told), (0, Vec::new()), "{arguments:?}");
    stdout
}

/// What `info` says of a file, as JSON.
pub fn info(at: &Path, scan: &str) -> serde_json::Value {
    let all: serde_json::Value =
        serde_json::from_str(&done(at, &["info", "--json", scan])).unwrap();
    all[0].clone()
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
