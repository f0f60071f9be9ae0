//! The command as users meet it: help, exit codes, and where mistakes are told.

use std::fs;
use std::path::Path;

use crate::support::command;
use std::process::Stdio;

/// What the command gave: exit code, stdout, stderr.
struct Outcome {
    code: i32,
    stdout: String,
    stderr: String,
}

fn pointmill(at: &Path, arguments: &[&str]) -> Outcome {
    let (code, stdout, stderr) = command::pointmill(at, arguments);
    Outcome { code, stdout, stderr }
}

/// Asserts exit code 2, nothing on stdout, and each of `parts` on stderr.
fn refused(at: &Path, arguments: &[&str], parts: &[&str]) {
    let Outcome { code, stdout, stderr } = pointmill(at, arguments);
    assert_eq!(code, 2, "{arguments:?}: {stderr}");
    assert_eq!(stdout, "", "{arguments:?}");
    for part in parts {
        assert!(stderr.contains(part), "{arguments:?} says {part:?}:\n{stderr}");
    }
}

fn here() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

#[test]
fn help_names_commands_and_exit_codes() {
    let at = here();
    let help = pointmill(at.path(), &["--help"]);
    assert_eq!((help.code, help.stderr.as_str()), (0, ""));
    for command in [
        "run", "reduce", "convert", "info", "validate", "plan", "check", "stages", "graph", "new",
        "synth", "compare",
    ] {
        assert!(help.stdout.contains(&format!("\n  {command} ")), "{command}");
        let own = pointmill(at.path(), &[command, "--help"]);
        assert_eq!(own.code, 0);
        assert!(own.stdout.contains(&format!("pointmill {command}")), "{}", own.stdout);
    }
    for code in ["  0    done", "  1    the run failed", "  2    the command", "  130  interrupted"]
    {
        assert!(help.stdout.contains(code), "{code}");
    }
}

#[test]
fn defaults_in_the_help_are_those_of_the_pipeline() {
    let at = here();
    let help = pointmill(at.path(), &["reduce", "--help"]).stdout;
    let file = include_str!("../../pipelines/paper.toml");
    for (flag, key, default) in [
        ("--neighbors", "neighbors", "auto"),
        ("--side", "side", "spread"),
        ("--min-spacing", "min_spacing", "auto"),
        ("--measure", "measure", "cone"),
        ("--min-points", "min_points", "1"),
        ("--split", "split", "voronoi"),
        ("--method", "method", "varady"),
    ] {
        let lines = help.split(flag).nth(1).expect(flag);
        let lines: Vec<&str> = lines.lines().take(2).collect();
        assert!(lines.join(" ").contains(&format!("[default: {default}]")), "{flag}: {lines:?}");
        let line = file
            .lines()
            .map(|line| line.trim_start_matches("# "))
            .find(|l| l.starts_with(&format!("{key} = ")))
            .expect(key);
        let value = line.split('=').nth(1).unwrap().split('#').next().unwrap();
        assert_eq!(value.trim().trim_matches('"'), default, "{key}");
    }
}

#[test]
fn a_wrong_command_line_exits_with_2() {
    let at = here();
    refused(at.path(), &[], &["Usage: pointmill"]);
    refused(at.path(), &["redcue"], &["redcue", "reduce"]);
    refused(at.path(), &["reduce", "a.laz"], &["--output <OUT>"]);
    let text =
        "[[stage]]\nkind = 'read'\npath = 'a.las'\n[[stage]]\nkind = 'write'\npath = 'o.laz'\n";
    fs::write(at.path().join("p.toml"), text).unwrap();
    refused(at.path(), &["run", "p.toml", "--memory", "2G"], &["--memory", "512MiB or 2GiB"]);
    let threads = ["--threads", "--threads: takes a whole number from 1 to 1024, not 0"];
    refused(at.path(), &["run", "p.toml", "--threads", "0"], &threads);
    let progress = ["auto", "json", "never"];
    refused(at.path(), &["run", "p.toml", "--progress", "jsn"], &progress);
    refused(at.path(), &["run", "p.toml", "-q", "-v"], &["--quiet", "--verbose"]);
    refused(
        at.path(),
        &["stages", "cels"],
        &["there is no stage `cels`", "help: did you mean `cells`? stages: "],
    );
    refused(
        at.path(),
        &["run", "p.toml", "--set", "x"],
        &["--set: there is no `=`", "= write STAGE.KEY=VALUE"],
    );
}

#[test]
fn a_wrong_pipeline_exits_with_2_and_names_file_line_and_words() {
    let at = here();
    let text = "[[stage]]\nkind = \"raed\"\n";
    fs::write(at.path().join("p.toml"), text).unwrap();
    for command in ["run", "plan", "check"] {
        let parts = ["error: p.toml:2:8: there is no stage `raed`", "did you mean `read`?"];
        refused(at.path(), &[command, "p.toml"], &parts);
    }
}

#[test]
fn what_is_not_there_exits_with_1() {
    let at = here();
    for arguments in [&["run", "no.toml"][..], &["info", "no.laz"], &["check", "no.toml"]] {
        let outcome = pointmill(at.path(), arguments);
        assert_eq!(outcome.code, 1, "{arguments:?}: {}", outcome.stderr);
        assert!(outcome.stderr.starts_with(&format!("error: {}: cannot ", arguments[1])));
        assert!(outcome.stderr.contains("No such file"), "the cause: {}", outcome.stderr);
        assert_eq!(outcome.stdout, "");
    }
}

#[test]
fn inputs_that_are_not_there_exit_with_1_however_they_are_named() {
    let at = here();
    fs::create_dir(at.path().join("empty")).unwrap();
    for (input, told) in [
        ("no.laz", "no.laz: cannot open"),
        ("*.las", "IN: no file matches `*.las`"),
        ("empty", "IN: the folder `empty` has no las, laz, ply, pcd, e57, ptx, pts or xyz file"),
    ] {
        for command in ["reduce", "convert"] {
            let outcome = pointmill(at.path(), &[command, input, "-o", "b.laz"]);
            assert_eq!((outcome.code, outcome.stdout.as_str()), (1, ""), "{command} {input}");
            assert!(outcome.stderr.contains(told), "{command} {input}: {}", outcome.stderr);
        }
    }
    let read =
        "[[stage]]\nkind = 'read'\npath = '*.laz'\n[[stage]]\nkind = 'write'\npath = 'o.laz'\n";
    fs::write(at.path().join("p.toml"), read).unwrap();
    let outcome = pointmill(at.path(), &["check", "p.toml"]);
    assert_eq!(outcome.code, 1, "{}", outcome.stderr);
    assert!(outcome.stderr.starts_with("error: p.toml:3:8: no file matches"), "{}", outcome.stderr);
    fs::write(at.path().join("p.toml"), read.replace("path = 'o", "pth = 'o")).unwrap();
    refused(at.path(), &["check", "p.toml"], &["2 mistakes", "p.toml:3:8: no file", "p.toml:6:"]);
}

#[test]
fn conversions_into_a_folder_are_checked_before_the_first() {
    let at = here();
    for name in ["a.las", "a.laz", "b.las", "c.dat"] {
        fs::write(at.path().join(name), b"").unwrap();
    }
    let convert = |arguments: &[&str], parts: &[&str]| {
        refused(at.path(), &[&["convert"], arguments].concat(), parts);
        assert!(!at.path().join("out").exists());
    };
    convert(&["a.las", "a.laz", "-o", "out/", "--to", "ply"], &["would both become out/a.ply"]);
    convert(&["c.dat", "-o", "out/"], &["c.dat: its name says no format"]);
    convert(&["a.las", "b.las", "-o", "out/", "--report", "r.json"], &["--report: is for one"]);
    convert(&["a.las", "b.las", "-o", "out/", "--to", "lax"], &["--to: ", "did you mean `las`?"]);
    convert(&["a.las", "b.las", "-o", "."], &["-o: ./a.las is the input a.las: it cannot be"]);
    convert(&["a.las", "-o", "x.laz", "--scale", "-1"], &["--scale: ", "a number above 0"]);
    convert(
        &["a.las", "-o", "x.laz", "--scale", "1,2"],
        &["--scale: takes a number above 0 without a unit, three of them", "not 2 values"],
    );
    convert(&["a.las", "-o", "x.laz", "--scale", "1,0,1"], &["--scale: ", "a number above 0"]);
    convert(&["a.las", "-o", "x.ply", "--encoding", "txt"], &["--encoding: ", "ascii, binary"]);
    convert(&["a.las", "-o", "x"], &["-o: the extension of `x` names no format"]);
}

#[test]
fn messages_go_to_stderr_and_no_bar_is_drawn_off_a_terminal() {
    let at = here();
    fs::write(at.path().join("a.laz"), b"not a scan").unwrap();
    let outcome = pointmill(at.path(), &["reduce", "a.laz", "-o", "b.laz"]);
    assert_eq!(outcome.code, 1, "{}", outcome.stderr);
    assert_eq!(outcome.stdout, "");
    assert!(outcome.stderr.lines().any(|l| l.starts_with("error: ")), "{}", outcome.stderr);
    assert!(!outcome.stderr.contains('\u{1b}'), "{:?}", outcome.stderr);
    assert!(!at.path().join("b.laz").exists());
}

#[test]
fn a_reader_who_has_gone_is_no_error() {
    let at = here();
    let demo = concat!(env!("CARGO_MANIFEST_DIR"), "/pipelines/demo.toml");
    let mut child = command::command(at.path(), &["plan", demo])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}

#[test]
fn a_length_that_the_memory_does_not_do_for_is_told_by_its_key() {
    let at = here();
    let line = "synth als points=400k ! sample distance=500 ! write out.laz";
    let told = pointmill(at.path(), &["run", "--memory", "96MiB", "--threads", "1", line]);
    let (code, stderr) = (told.code, told.stderr);
    assert_eq!(code, 1, "{stderr}");
    assert!(stderr.contains("or more, or a smaller `sample.distance`"), "{stderr}");
    assert!(!at.path().join("out.laz").exists());
}
