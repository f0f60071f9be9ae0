//! Being asked to stop: exit code 130 and nothing left behind.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::support::command::PROGRAM;

/// A long run in an empty folder, a second after its start.
fn long_run(at: &Path, before: &str) -> Child {
    let run = format!("{before} exec \"$0\" synth als -n 100000000 -o scan.laz");
    let child = Command::new("sh")
        .current_dir(at)
        .args(["-c", &run])
        .arg(PROGRAM)
        .stderr(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while fs::read_dir(at).unwrap().count() == 0 {
        assert!(begun.elapsed() < Duration::from_secs(60), "it does not begin");
        sleep(Duration::from_millis(20));
    }
    sleep(Duration::from_secs(1));
    child
}

fn send(child: &Child, signal: &str) {
    let pid = child.id().to_string();
    assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
}

/// True if this process was started to ignore SIGHUP, as its children then are.
fn hangups_are_ignored() -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap_or("0");
    u64::from_str_radix(ignored.trim(), 16).unwrap() & 1 == 1
}

/// Starts a long run in an empty folder, sends `signal`, and looks at what is left.
fn stopped_by(signal: &str) {
    let at = tempfile::tempdir().unwrap();
    let child = long_run(at.path(), "");
    send(&child, signal);
    is_stopped(child, at.path(), signal);
}

/// The run ends as one that was interrupted, and leaves nothing.
fn is_stopped(mut child: Child, at: &Path, signal: &str) {
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
    let left: Vec<_> = fs::read_dir(at).unwrap().map(|e| e.unwrap().path()).collect();
    assert!(left.is_empty(), "{signal} leaves {left:?}");
}

#[test]
fn ctrl_c_leaves_nothing_behind() {
    stopped_by("-INT");
}

#[test]
fn a_run_that_is_asked_to_end_leaves_nothing_behind() {
    stopped_by("-TERM");
    if !hangups_are_ignored() {
        stopped_by("-HUP");
    }
}

#[test]
fn under_nohup_a_run_outlives_its_terminal_and_still_ends_when_it_is_asked_to() {
    let at = tempfile::tempdir().unwrap();
    let mut child = long_run(at.path(), "trap '' HUP;");
    send(&child, "-HUP");
    sleep(Duration::from_secs(1));
    assert!(child.try_wait().unwrap().is_none(), "it goes on");
    send(&child, "-TERM");
    is_stopped(child, at.path(), "-TERM under nohup");
}
