//! Being asked to stop: exit code 130 and nothing left behind.

#![allow(clippy::unwrap_used, reason = "a test that fails says so")]

use std::fs;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Starts a long run in an empty folder, sends `signal`, and looks at what is left.
fn stopped_by(signal: &str) {
    let at = tempfile::tempdir().unwrap();
    // Signals that are ignored here, as under nohup, would be ignored by the program.
    let mut child = Command::new("env")
        .arg("--default-signal=HUP,INT,TERM")
        .arg(assert_cmd::cargo::cargo_bin("pointmill"))
        .current_dir(at.path())
        .args(["synth", "als", "-n", "100000000", "-o", "scan.laz"])
        .stderr(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    sleep(Duration::from_secs(1));
    let pid = child.id().to_string();
    assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
    let asked = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if asked.elapsed() > Duration::from_secs(30) {
            child.kill().unwrap();
            panic!("it goes on 30 s after {signal}");
        }
        sleep(Duration::from_millis(20));
    }
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{signal}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("error: interrupted\n"));
    assert_eq!(output.stdout, b"");
    let left: Vec<_> = fs::read_dir(at.path()).unwrap().map(|e| e.unwrap().path()).collect();
    assert!(left.is_empty(), "{signal} leaves {left:?}");
}

#[test]
fn ctrl_c_leaves_nothing_behind() {
    stopped_by("-INT");
}

#[test]
fn a_run_that_is_asked_to_end_leaves_nothing_behind() {
    stopped_by("-TERM");
    stopped_by("-HUP");
}
