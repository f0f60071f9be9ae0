//! Points from standard input and to standard output.

use std::fs;
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Output, Stdio};

use crate::support::command::{command, done, pointmill, scans};
use crate::support::scan::Scan;

/// Runs a command whose standard input is a pipe that gives `input`.
fn piped(at: &Path, arguments: &[&str], input: &[u8]) -> Output {
    let mut command = command(at, arguments);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let input = input.to_vec();
    let writing = std::thread::spawn(move || drop(stdin.write_all(&input)));
    let output = child.wait_with_output().unwrap();
    writing.join().unwrap();
    output
}

/// The same for one that must succeed and say nothing; its standard output.
fn streamed(at: &Path, arguments: &[&str], input: &[u8]) -> Vec<u8> {
    let output = piped(at, arguments, input);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), told.as_str()), (Some(0), ""), "{arguments:?}");
    output.stdout
}

#[test]
fn every_format_goes_through_pipes_as_it_does_through_files() {
    let at = scans(&["in.laz"]);
    let at = at.path();
    for name in ["in.las", "in.ply", "in.csv", "in.pcd", "in.e57"] {
        done(at, &["convert", "in.laz", "-o", name, "-q"]);
    }
    for (name, from) in [
        ("in.laz", None),
        ("in.las", None),
        ("in.ply", None),
        ("in.pcd", None),
        ("in.e57", None),
        ("in.csv", Some("csv")),
    ] {
        let input = fs::read(at.join(name)).unwrap();
        for to in ["las", "laz", "ply", "copc", "csv"] {
            let extension = if to == "copc" { "copc.laz" } else { to };
            let whole = format!("whole.{extension}");
            let mut flags = vec!["--no-provenance", "--quiet"];
            if !name.starts_with("in.la") && ["las", "laz", "copc"].contains(&to) {
                flags.extend(["--scale", "0.00001"]);
            }
            done(at, &[&["convert", name, "-o", &whole, "--to", to][..], &flags].concat());
            let given = from.map_or(Vec::new(), |from| vec!["--from", from]);
            let convert = [&["convert", "-", "-o", "-", "--to", to][..], &given, &flags].concat();
            let out = streamed(at, &convert, &input);
            assert!(out == fs::read(at.join(&whole)).unwrap(), "{name} to {to}");
        }
    }
    let names: Vec<_> = fs::read_dir(at).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(names.iter().all(|name| !name.to_string_lossy().starts_with('.')), "{names:?}");
}

#[test]
fn a_file_that_is_standard_input_is_read_as_it_is() {
    let at = scans(&["in.laz"]);
    let at = at.path();
    let mut command = command(at, &["convert", "-", "-o", "out.las", "-q"]);
    command.stdin(fs::File::open(at.join("in.laz")).unwrap());
    // No scratch can be made there.
    let output = command.env("TMPDIR", "/nonexistent").output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let [one, two] = ["in.laz", "out.las"].map(|name| Scan::read(&at.join(name), usize::MAX));
    assert!(one.records == two.records);
}

#[test]
fn other_commands_take_standard_input_too_and_messages_go_to_stderr() {
    let at = scans(&["in.laz"]);
    let at = at.path();
    let input = fs::read(at.join("in.laz")).unwrap();
    let reduce = ["reduce", "-", "-o", "-", "--to", "ply", "--keep", "20%"];
    let output = piped(at, &reduce, &input);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{told}");
    assert!(output.stdout.starts_with(b"ply\n"));
    assert!(told.contains("points     3,000 in") && told.contains("output     standard output"));
    let info = String::from_utf8(streamed(at, &["info", "-"], &input)).unwrap();
    assert!(info.contains("3000") && info.contains("standard input"), "{info}");
    streamed(at, &["validate", "-"], &input);
    let compared = streamed(at, &["compare", "in.laz", "-"], &input);
    assert!(String::from_utf8_lossy(&compared).contains("same"));
    let line = "read - ! grid side=1 ! write - format=las";
    assert!(streamed(at, &["run", line, "-q"], &input).starts_with(b"LASF"));
    let run = ["convert", "-", "-o", "-", "--to", "las", "-q", "--report", "r.json"];
    streamed(at, &run, &input);
    let report: serde_json::Value =
        serde_json::from_slice(&fs::read(at.join("r.json")).unwrap()).unwrap();
    let run = &report["run"];
    assert_eq!(run["inputs"][0]["path"], "/dev/stdin");
    assert_eq!(run["inputs"][0]["bytes"].as_u64(), Some(input.len() as u64));
    assert_eq!(run["outputs"][0]["path"], "/dev/stdout");
}

#[test]
fn what_came_through_a_pipe_can_be_made_again() {
    let at = scans(&["in.laz"]);
    let at = at.path();
    let input = fs::read(at.join("in.laz")).unwrap();
    fs::write(at.join("out.laz"), {
        streamed(at, &["reduce", "-", "-o", "-", "--to", "laz", "--keep", "20%", "-q"], &input)
    })
    .unwrap();
    streamed(at, &["reproduce", "out.laz", "-q"], &input);
    let (code, _, told) = pointmill(at, &["reproduce", "out.laz", "--inputs", "."]);
    assert_eq!(code, 0, "{told}");
    let other = piped(at, &["reproduce", "out.laz"], &input[1..]);
    let told = String::from_utf8(other.stderr).unwrap();
    assert!(told.contains("standard input: the input had"), "{told}");
}

#[test]
fn nothing_of_a_run_that_fails_is_sent_and_streams_are_called_what_they_are() {
    let at = scans(&["in.laz"]);
    let at = at.path();
    let mut damaged = fs::read(at.join("in.laz")).unwrap();
    let middle = damaged.len() / 2;
    damaged.truncate(middle);
    for (arguments, input, code, parts) in [
        (
            &["convert", "-", "-o", "-", "--to", "las"][..],
            &damaged[..],
            1,
            &["standard input: "][..],
        ),
        (&["convert", "-", "-o", "-"], &damaged, 2, &["the format of standard output", "--to"]),
        (&["convert", "-", "-o", "o.las"], b"hello\n", 2, &["format of standard input"]),
        (&["convert", "-", "-o", "o.las"], b"", 1, &["standard input: "]),
        (&["convert", "-", "-", "-o", "o.las"], &damaged, 2, &["named before"]),
        (&["convert", "-", "-o", "folder/", "--to", "las"], &damaged, 2, &["has no name"]),
        (&["convert", "-", "-o", "-", "--to", "las", "--resume"], &damaged, 2, &["--resume"]),
    ] {
        let output = piped(at, arguments, input);
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {told}");
        assert_eq!(output.stdout, b"", "{arguments:?}");
        assert!(parts.iter().all(|part| told.contains(part)), "{arguments:?}: {told}");
    }
}

#[test]
fn a_reader_who_has_gone_has_no_whole_file() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "als", "-n", "200k", "-o", "in.las"]);
    let mut command = command(at, &["convert", "in.las", "-o", "-", "--to", "las", "-q"]);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut stdout = child.stdout.take().unwrap();
    let mut first = [0; 4];
    stdout.read_exact(&mut first).unwrap();
    assert_eq!(&first, b"LASF");
    drop(stdout);
    let output = child.wait_with_output().unwrap();
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("standard output: its reader has gone before all was written"), "{told}");
}
