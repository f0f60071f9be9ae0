//! Runs that are killed or asked to stop: no output under its name, and no scratch that stays.

use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::support::assert_holds;
use crate::support::command::{PROGRAM, done, scans};

/// A run of minutes whose points do not fit in its memory.
const LONG: &str = "[run]\nmemory = \"200MiB\"\nthreads = 2\nreport = \"report.json\"\n\
    [[stage]]\nkind = \"synth\"\nscene = \"als\"\npoints = 20_000_000\n\
    [[stage]]\nkind = \"normals\"\n[[stage]]\nkind = \"cells\"\n[[stage]]\nkind = \"median\"\n\
    [[stage]]\nkind = \"write\"\npath = \"out.laz\"\n";

/// A long run, once its scratch folder is there and `bytes` are in it.
fn long_run(at: &Path, bytes: u64) -> Child {
    fs::write(at.join("long.toml"), LONG).unwrap();
    // Signals that are ignored here, as under nohup, would be ignored by the program.
    let mut child = Command::new("env")
        .arg("--default-signal=HUP,INT,TERM")
        .arg(PROGRAM)
        .args(["run", "long.toml"])
        .current_dir(at)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while scratch(at).iter().map(|folder| size(folder)).sum::<u64>() < bytes
        || scratch(at).is_empty()
    {
        if let Some(status) = child.try_wait().unwrap() {
            panic!("the run has ended: {status} {:?}", child.wait_with_output());
        }
        if begun.elapsed() > Duration::from_secs(120) {
            child.kill().unwrap();
            panic!("no {bytes} bytes of scratch after two minutes");
        }
        sleep(Duration::from_millis(10));
    }
    child
}

fn scratch(at: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(at).unwrap().map(|e| e.unwrap());
    entries
        .filter(|e| e.file_name().as_bytes().starts_with(b".pointmill-"))
        .map(|e| e.path())
        .collect()
}

fn size(folder: &Path) -> u64 {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter_map(|e| e.metadata().ok()).map(|m| m.len()).sum()
}

#[test]
fn a_killed_run_leaves_a_scratch_folder_that_the_next_removes() {
    for bytes in [0, 1 << 20, 64 << 20] {
        let at = scans(&["small.las"]);
        let at = at.path();
        let mut child = long_run(at, bytes);
        child.kill().unwrap();
        assert_eq!(child.wait().unwrap().code(), None, "killed");
        let left = scratch(at);
        assert_eq!(left.len(), 1);
        assert!(!at.join("out.laz").exists() && !at.join("report.json").exists());
        // A run elsewhere leaves it alone, one beside it removes it.
        fs::create_dir(at.join("sub")).unwrap();
        done(at, &["convert", "small.las", "-o", "sub/other.laz"]);
        assert_eq!(scratch(at), left);
        done(at, &["reduce", "small.las", "-o", "out.laz"]);
        assert_holds(at, &["long.toml", "out.laz", "small.las", "sub"]);
    }
}

#[test]
fn runs_beside_each_other_leave_each_other_alone() {
    let at = scans(&["small.las"]);
    let at = at.path();
    let mut child = long_run(at, 1 << 20);
    let living = scratch(at);
    done(at, &["reduce", "small.las", "-o", "other.laz"]);
    assert_eq!(scratch(at), living);
    assert!(child.try_wait().unwrap().is_none(), "the long run goes on");
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn a_run_that_is_interrupted_leaves_nothing() {
    for (signal, bytes) in [("-INT", 0), ("-INT", 64 << 20), ("-TERM", 1 << 20)] {
        let at = tempfile::tempdir().unwrap();
        let mut child = long_run(at.path(), bytes);
        // The folder may be there a moment before the signal is heard: give it that moment.
        sleep(Duration::from_millis(100));
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
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(130), "{signal}: {stderr}");
        assert_eq!((stderr.as_str(), output.stdout.len()), ("error: interrupted\n", 0));
        assert_holds(at.path(), &["long.toml"]);
    }
}
