//! Places that take no output, disks that are full, inputs that change while they are read: an error
//! with path and remedy, the right exit code, and nothing left behind.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::support::assert_holds;
use crate::support::case::{Case, REDUCE, execute};
use crate::support::command::{PROGRAM, done, fails};
use crate::support::records::read;
use pointmill::ErrorKind;
use pointmill::{Overrides, Quiet, Watch};

/// A scan of a few thousand points called `in.laz` in a folder of its own.
fn scan() -> tempfile::TempDir {
    crate::support::command::scans(&["in.laz"])
}

#[test]
fn places_where_nothing_can_be_written_are_told_before_any_work() {
    let at = scan();
    let path = at.path();
    fs::write(path.join("file"), "a file").unwrap();
    let refused = |output: &str, parts: &[&str]| {
        fails(path, &["reduce", "in.laz", "-o", output], 1, parts);
        fails(path, &["convert", "in.laz", "-o", output], 1, parts);
        assert_holds(path, &["file", "in.laz"]);
    };
    refused("none/out.laz", &["error: none: the folder does not exist", "create it first"]);
    refused("file/out.laz", &["error: file: this is a file", "help: "]);
    refused("file/deeper/out.laz", &["error: file: this is a file", "help: "]);
    refused("/proc/out.laz", &["/proc: cannot create a scratch folder", "write to another"]);
    fails(path, &["reduce", "missing.laz", "-o", "out.laz"], 1, &["missing.laz: cannot open it"]);
    fails(path, &["reduce", "file/in.laz", "-o", "out.laz"], 1, &["file/in.laz: cannot open it"]);
    let report = ["reduce", "in.laz", "-o", "out.laz", "--report", "file/r.json"];
    fails(path, &report, 1, &["error: file: this is a file"]);
    let scratch = ["reduce", "in.laz", "-o", "out.laz", "--scratch", "none"];
    fails(path, &scratch, 1, &["none: the folder for scratch does not exist", "--scratch"]);
    assert_holds(path, &["file", "in.laz"]);
}

#[test]
fn an_output_is_never_an_input_by_whatever_name() {
    let at = scan();
    let path = at.path();
    let before = fs::read(path.join("in.laz")).unwrap();
    std::os::unix::fs::symlink("in.laz", path.join("soft.laz")).unwrap();
    fs::hard_link(path.join("in.laz"), path.join("hard.laz")).unwrap();
    fs::create_dir(path.join("folder")).unwrap();
    std::os::unix::fs::symlink("..", path.join("folder/up")).unwrap();
    let pairs = [
        ("in.laz", "in.laz"),
        ("in.laz", "./in.laz"),
        ("in.laz", "soft.laz"),
        ("in.laz", "hard.laz"),
        ("in.laz", "folder/up/in.laz"),
        ("soft.laz", "in.laz"),
        ("hard.laz", "soft.laz"),
    ];
    for (input, output) in pairs {
        for command in ["reduce", "convert"] {
            fails(path, &[command, input, "-o", output], 2, &["input"]);
        }
        fails(path, &["reduce", input, "-o", "out.laz", "--report", output], 2, &["input"]);
    }
    assert!(fs::read(path.join("in.laz")).unwrap() == before);
    assert_holds(path, &["folder", "hard.laz", "in.laz", "soft.laz"]);
}

/// Runs pointmill with files limited to so many half KiB, as a full disk or a quota would.
fn limited(at: &Path, blocks: u32, arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new("sh")
        .current_dir(at)
        .args(["-c", &format!("ulimit -f {blocks}; exec \"$0\" \"$@\"")])
        .arg(PROGRAM)
        .args(arguments)
        .output()
        .unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn a_disk_that_is_full_while_writing_or_spilling_fails_the_run_and_is_left_clean() {
    let at = tempfile::tempdir().unwrap();
    let path = at.path();
    done(path, &["synth", "part", "-n", "60000", "-o", "in.laz"]);
    fs::write(path.join("out.las"), "old").unwrap();
    let text = "[run]\nspill = 'always'\n[[stage]]\nkind = 'read'\npath = 'in.laz'\n[[stage]]\n\
                kind = 'normals'\n[[stage]]\nkind = 'cells'\nmax_angle = 3.0\n[[stage]]\nkind = 'median'\n\
                [[stage]]\nkind = 'write'\npath = 'out.las'\n";
    fs::write(path.join("spills.toml"), text).unwrap();
    let convert = ["convert", "in.laz", "-o", "out.las"];
    let canonical = ["run", "spills.toml", "--set", "write.order=canonical"];
    let report = ["run", "spills.toml", "--report", "report.json"];
    for (arguments, blocks) in [(&convert[..], 1), (&convert, 400), (&canonical, 400), (&report, 0)]
    {
        let (code, told) = limited(path, blocks, arguments);
        assert_eq!(code, Some(1), "{arguments:?}: {told}");
        assert!(told.contains("File too large") && told.contains("(`ulimit -f`)"), "{told}");
        assert_eq!(fs::read(path.join("out.las")).unwrap(), b"old");
        assert_holds(path, &["in.laz", "out.las", "spills.toml"]);
    }
    assert_eq!(limited(path, 1 << 20, &convert).0, Some(0), "with room it is done");
    assert_eq!(read(&path.join("out.las")).0.stride, read(&path.join("in.laz")).0.stride);
}

/// Does something to a file at the first report of progress.
struct Meddler<F: Fn()>(AtomicBool, F);

impl<F: Fn() + Sync> Watch for Meddler<F> {
    fn phase(&self, _name: &'static str, _total: Option<u64>) {}
    fn advance(&self, _points: u64) {
        if !self.0.swap(true, Ordering::Relaxed) {
            self.1();
        }
    }
    fn warn(&self, _message: &str) {}
    fn cancelled(&self) -> bool {
        false
    }
}

/// A scan of a few batches in the format of `name`.
fn several_batches(name: &str) -> Vec<u8> {
    let at = tempfile::tempdir().unwrap();
    let encoding: &[&str] = if name == "text.ply" { &["--encoding", "ascii"] } else { &[] };
    done(at.path(), &["synth", "part", "-n", "30000", "-o", "made.laz"]);
    done(at.path(), &[&["convert", "made.laz", "-o", name], encoding].concat());
    fs::read(at.path().join(name)).unwrap()
}

#[test]
fn an_input_that_changes_while_it_is_read_is_named() {
    for name in ["in.las", "in.laz", "binary.ply", "text.ply"] {
        let whole = several_batches(name);
        for change in ["shrinks", "grows", "is written to", "is replaced", "is removed"] {
            for stages in ["", REDUCE] {
                let case = Case::new();
                let input = case.path(name);
                fs::write(&input, &whole).unwrap();
                let meddle = || match change {
                    "shrinks" => truncate(&input, -1000),
                    "grows" => truncate(&input, 1000),
                    "is written to" => {
                        let mut bytes = fs::read(&input).unwrap();
                        let at = bytes.len() - 100;
                        bytes[at] ^= 1;
                        std::thread::sleep(std::time::Duration::from_millis(20));
                        use std::os::unix::fs::FileExt;
                        let file = fs::File::options().write(true).open(&input).unwrap();
                        file.write_all_at(&bytes[at..=at], at as u64).unwrap();
                    }
                    "is replaced" => {
                        fs::copy(&input, case.path("other")).unwrap();
                        fs::rename(case.path("other"), &input).unwrap();
                    }
                    _ => fs::remove_file(&input).unwrap(),
                };
                let text = case.text("threads = 1", stages, "").replace("in.ply", name);
                let text = text.replace("out.ply", &format!("out-{name}"));
                let watch = Meddler(AtomicBool::new(false), meddle);
                let error = execute(&text, &Overrides::default(), &watch).expect_err(change);
                let what = format!("{name} {change}: {error:?}");
                assert_eq!(error.path(), Some(input.as_path()), "{what}");
                let removed = change == "is removed";
                let kind = if removed { ErrorKind::Io } else { ErrorKind::Data };
                assert_eq!(error.kind(), kind, "{what}");
                assert_eq!(
                    error.to_string().contains("changed while it was read"),
                    !removed,
                    "{what}"
                );
                let left: &[&str] = if removed { &[] } else { &[name] };
                assert_eq!(case.left(), left, "{what}");
            }
        }
    }
}

fn truncate(path: &Path, by: i64) {
    let file = fs::File::options().write(true).open(path).unwrap();
    let length = file.metadata().unwrap().len();
    file.set_len(length.checked_add_signed(by).unwrap()).unwrap();
}

#[test]
#[ignore = "needs a file system in memory at /dev/shm"]
fn scratch_in_memory_is_warned_of_if_anything_spilled_there() {
    let mounts = fs::read_to_string("/proc/mounts").unwrap();
    assert!(mounts.lines().any(|line| line.contains(" /dev/shm tmpfs ")), "{mounts}");
    let scratch = tempfile::tempdir_in("/dev/shm").unwrap();
    let case = Case::new();
    case.ply(
        &(0..3000u32).map(|i| ([f64::from(i % 60), f64::from(i / 60), 0.0], i)).collect::<Vec<_>>(),
    );
    let overrides = Overrides { scratch: Some(scratch.path().to_owned()), ..Overrides::default() };
    for (spill, warned) in [("always", true), ("auto", false)] {
        let text = case.text(&format!("spill = '{spill}'"), REDUCE, "");
        let done = execute(&text, &overrides, &Quiet).unwrap();
        let warnings = done.report.run.warnings.join("\n");
        assert_eq!(warnings.contains("in memory (tmpfs)"), warned, "{warnings}");
        assert_eq!(warnings.contains("`run.scratch`"), warned, "{warnings}");
    }
    assert_holds(scratch.path(), &[]);
}
