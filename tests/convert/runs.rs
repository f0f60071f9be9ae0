//! The command as users run it: conversions into files and folders, what it refuses, names of all
//! kinds, what `info` and `plan` tell.

use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;

use crate::support::assert_holds;
use crate::support::command::{command, done, fails, pointmill, scans};
use crate::support::las_file::STRIDES;
use crate::support::records::{assert_contained, read};
use serde_json::Value;

fn records(path: PathBuf) -> Vec<u8> {
    read(&path).1
}

#[test]
fn many_inputs_become_one_output_each_in_a_folder() {
    let at = scans(&["a.las", "b.laz", "c.LAS"]);
    let at = at.path();
    let plain = "--no-provenance";
    done(at, &["convert", "a.las", "b.laz", "c.LAS", "-o", "all/", "--to", "laz", plain]);
    assert_holds(&at.join("all"), &["a.laz", "b.laz", "c.laz"]);
    for (old, new) in [("a.las", "a.laz"), ("b.laz", "b.laz"), ("c.LAS", "c.laz")] {
        assert!(records(at.join(old)) == records(at.join("all").join(new)), "{old}");
    }
    // Without a format each keeps its own; a pattern and a folder name the inputs.
    fs::create_dir(at.join("same")).unwrap();
    done(at, &["convert", "all", "*.las", "-o", "same", "--threads", "1", plain]);
    assert_holds(&at.join("same"), &["a.las", "a.laz", "b.laz", "c.laz"]);
    let same = |name: &str| fs::read(at.join("all").join(name)).unwrap();
    assert!(fs::read(at.join("same/b.laz")).unwrap() == same("b.laz"), "LAZ of equal records");
    // To PLY and back, every point.
    done(at, &["convert", "*.las", "b.laz", "-o", "ply/", "--to", "ply"]);
    let (schema, _) = read(&at.join("a.las"));
    let scale = schema.find("X").unwrap().scale.to_string();
    done(at, &["convert", "ply", "-o", "back/", "--to", "las", "--scale", &scale]);
    assert_holds(&at.join("back"), &["a.las", "b.las"]);
    let points = |path: &str| {
        let (schema, all) = read(&at.join(path));
        all.len() / schema.stride
    };
    assert_eq!((points("back/a.las"), points("back/b.las")), (3_000, 3_001));
}

#[test]
fn many_inputs_become_one_file_in_their_order_at_any_number_of_threads() {
    let at = scans(&["a.las", "b.laz", "c.las"]);
    let at = at.path();
    // Enough for several chunks, so that threads have something to get out of order.
    done(at, &["synth", "als", "-n", "200000", "-o", "d.laz"]);
    done(at, &["convert", "d.laz", "-o", "d.ply"]);
    for (name, inputs) in [
        ("one.las", &["c.las", "a.las", "b.laz"][..]),
        ("one.laz", &["d.laz"]),
        ("two.las", &["d.laz"]),
        ("two.ply", &["d.ply"]),
        ("three.ply", &["c.las", "a.las"]),
    ] {
        let mut outputs = Vec::new();
        for threads in ["1", "4"] {
            let arguments = [&["convert"], inputs, &["-o", name, "--threads", threads]].concat();
            done(at, &arguments);
            outputs.push(fs::read(at.join(name)).unwrap());
        }
        assert!(outputs[0] == outputs[1], "{name}: threads change the output");
        if name != "three.ply" {
            let expected: Vec<u8> = inputs.iter().flat_map(|i| records(at.join(i))).collect();
            assert!(!expected.is_empty() && records(at.join(name)) == expected, "{name}");
        }
    }
}

#[test]
fn the_format_is_that_of_the_extension_or_the_one_that_is_asked_for() {
    let at = scans(&["a.las"]);
    let at = at.path();
    let begins = |name: &str, with: &[u8]| {
        let bytes = fs::read(at.join(name)).unwrap();
        assert!(bytes.starts_with(with), "{name}: {:?}", &bytes[..4]);
        bytes
    };
    done(at, &["convert", "a.las", "-o", "x.data", "--to", "laz"]);
    let laz = begins("x.data", b"LASF");
    assert_eq!(laz[104] & 0x80, 0x80, "compressed");
    let misnamed = ["convert", "a.las", "-o", "y.las", "--to", "ply"];
    let (code, _, stderr) = pointmill(at, &misnamed);
    let told = "warning: y.las: this is named as LAS and becomes PLY, as `--to` says: programs";
    assert!(code == 0 && stderr.starts_with(told) && stderr.lines().count() == 1, "{stderr}");
    begins("y.las", b"ply\nformat binary_little_endian");
    done(at, &["convert", "a.las", "-o", "z.PLY", "--encoding", "ascii"]);
    begins("z.PLY", b"ply\nformat ascii");
    fails(at, &["convert", "a.las", "-o", "x.data"], 2, &["-o: the extension of `x.data`"]);
    // A format that the name does not say can be read where a pipeline says it.
    let pipeline = "[[stage]]\nkind = \"read\"\npath = \"x.data\"\nformat = \"laz\"\n\
                    [[stage]]\nkind = \"write\"\npath = \"w.las\"\n";
    fs::write(at.join("p.toml"), pipeline).unwrap();
    done(at, &["run", "p.toml"]);
    assert!(records(at.join("w.las")) == records(at.join("a.las")));
}

#[test]
fn an_input_is_never_written_over() {
    let at = scans(&["a.las"]);
    let at = at.path();
    let before = fs::read(at.join("a.las")).unwrap();
    std::os::unix::fs::symlink("a.las", at.join("link.las")).unwrap();
    fs::hard_link(at.join("a.las"), at.join("hard.las")).unwrap();
    fs::create_dir(at.join("sub")).unwrap();
    for output in ["a.las", "./a.las", "sub/../a.las", "link.las", "hard.las"] {
        for name in ["a.las", "link.las"] {
            let told = ["error: ", "input"];
            fails(at, &["convert", name, "-o", output], 2, &told);
            fails(at, &["reduce", name, "-o", output], 2, &told);
            fails(at, &["convert", name, "-o", "out.las", "--report", output], 2, &told);
        }
    }
    fails(at, &["convert", "a.las", "-o", "."], 2, &["is the input a.las"]);
    assert!(fs::read(at.join("a.las")).unwrap() == before);
    assert_holds(at, &["a.las", "hard.las", "link.las", "sub"]);
}

#[test]
fn outputs_that_cannot_be_are_told_before_any_work_and_leave_nothing() {
    let at = scans(&["a.las"]);
    let at = at.path();
    fs::write(at.join("file"), b"in the way").unwrap();
    fs::create_dir(at.join("folder.las")).unwrap();
    let _socket = std::os::unix::net::UnixListener::bind(at.join("socket.las")).unwrap();
    let there = ["a.las", "file", "folder.las", "socket.las"];
    for command in ["convert", "reduce"] {
        let told = |output: &str, code: i32, parts: &[&str]| {
            fails(at, &[command, "a.las", "-o", output], code, parts);
            assert_holds(at, &there);
        };
        told("no/such/out.las", 1, &["no/such: ", "the folder does not exist", "help: "]);
        told("file/out.las", 1, &["file: ", "this is a file: nothing can be written below it"]);
        told("socket.las", 2, &["socket.las: this is no regular file"]);
        let report = ["--report", "no/report.json"];
        fails(at, &[&[command, "a.las", "-o", "out.las"], &report[..]].concat(), 1, &["no: "]);
        let report = ["--report", "socket.las"];
        fails(
            at,
            &[&[command, "a.las", "-o", "out.las"], &report[..]].concat(),
            2,
            &["socket.las"],
        );
        assert_holds(at, &there);
    }
    fails(at, &["reduce", "a.las", "-o", "folder.las"], 2, &["is a folder, not a file"]);
    fails(at, &["convert", "a.las", "-o", "file/"], 1, &["file/: cannot make the folder"]);
    let scratch = ["--scratch", "file", "--memory", "256MiB"];
    fs::write(at.join("p.toml"), "[run]\nspill = \"always\"\n").unwrap();
    let pipeline = fs::read_to_string(at.join("p.toml")).unwrap()
        + crate::support::setup::REDUCE.split_once("[run]").unwrap().1;
    fs::write(at.join("p.toml"), pipeline).unwrap();
    let sets = ["--set", "read.path=a.las", "--set", "write.path=out.las"];
    fails(
        at,
        &[&["run", "p.toml"], &sets[..], &scratch[..]].concat(),
        1,
        &["file: the folder for scratch does not exist"],
    );
    fs::remove_file(at.join("p.toml")).unwrap();
    assert_holds(at, &there);
    assert_eq!(fs::read(at.join("file")).unwrap(), b"in the way");
}

#[test]
fn inputs_that_cannot_be_read_are_told_and_leave_no_output() {
    let at = scans(&["a.las", "z.laz"]);
    let at = at.path();
    let whole = fs::read(at.join("z.laz")).unwrap();
    fs::write(at.join("cut.laz"), &whole[..whole.len() / 2]).unwrap();
    fs::write(at.join("text.las"), "not a scan").unwrap();
    fs::write(at.join("empty.ply"), "").unwrap();
    fs::create_dir(at.join("none")).unwrap();
    let there = ["a.las", "cut.laz", "empty.ply", "none", "text.las", "z.laz"];
    for command in ["convert", "reduce"] {
        for bad in ["cut.laz", "text.las", "empty.ply", "missing.las"] {
            let output = format!("out.{}", bad.split_once('.').unwrap().1);
            fails(at, &[command, bad, "-o", &output], 1, &[&format!("error: {bad}: ")]);
            assert_holds(at, &there);
        }
        fails(at, &[command, "none", "-o", "out.las"], 1, &["the folder `none` has no las"]);
        fails(at, &[command, "a.las", "a.las", "-o", "out.las"], 2, &["named before"]);
    }
    // One bad file among several: the others are converted, the exit code tells.
    let inputs = ["a.las", "cut.laz", "text.las", "z.laz"];
    let arguments = [&["convert"], &inputs[..], &["-o", "out/", "--to", "laz"]].concat();
    let parts = ["error: cut.laz: ", "error: text.las: ", "2 of 4 conversions failed"];
    let (code, stdout, stderr) = pointmill(at, &arguments);
    assert_eq!(code, 1);
    assert!(parts.iter().all(|part| stderr.contains(part)), "{stderr}");
    // What is done is summed up, and that it is not all.
    assert!(stdout.starts_with("files      2\nfailed     2\n"), "{stdout}");
    assert!(stdout.contains("points     6,001\n"), "{stdout}");
    assert_holds(&at.join("out"), &["a.laz", "z.laz"]);
    assert!(records(at.join("out/z.laz")) == records(at.join("z.laz")));
    // An earlier output stays as it was when a later run fails.
    let before = fs::read(at.join("out/a.laz")).unwrap();
    fails(at, &["reduce", "cut.laz", "-o", "out/a.laz"], 1, &["cut.laz"]);
    assert!(fs::read(at.join("out/a.laz")).unwrap() == before);
    assert_holds(&at.join("out"), &["a.laz", "z.laz"]);
}

#[test]
fn names_with_spaces_and_of_all_scripts_work_everywhere() {
    let names = ["über uns.las", "点 云.laz", "a'b\"c$d&e;f.ply", "-minus.las", "br[a]cket?*.las"];
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    fs::create_dir(at.join("ein Ordner")).unwrap();
    for name in names {
        let path = format!("./ein Ordner/{name}");
        done(at, &["synth", "plane", "-n", "500", "-o", &path]);
        let shown = done(at, &["info", &path]);
        assert!(shown.starts_with(&path), "{shown}");
        let reduced = format!("./ein Ordner/reduced {name}");
        let report = format!("./ein Ordner/{name}.json");
        done(at, &["reduce", &path, "-o", &reduced, "--report", &report]);
        let (schema, all) = read(&at.join(&path));
        assert_contained(name, &records(at.join(&reduced)), &all, schema.stride);
        let report: Value = serde_json::from_slice(&fs::read(at.join(&report)).unwrap()).unwrap();
        assert_eq!(report["run"]["inputs"][0]["path"], path.as_str());
        done(at, &["convert", &path, "-o", "./neuer Ordner/ö/"]);
    }
    assert_holds(&at.join("neuer Ordner/ö"), &names);
    let pipeline = "[[stage]]\nkind = \"read\"\npath = \"ein Ordner/点*.laz\"\n\
                    [[stage]]\nkind = \"write\"\npath = \"aus gabe.las\"\n";
    fs::write(at.join("meine Kette.toml"), pipeline).unwrap();
    done(at, &["run", "meine Kette.toml"]);
    assert!(at.join("aus gabe.las").exists());
}

#[test]
fn a_name_that_is_no_text_is_told_not_guessed() {
    let at = scans(&["a.las"]);
    let at = at.path();
    let name = std::ffi::OsStr::from_bytes(b"b\xff.las");
    fs::copy(at.join("a.las"), at.join(name))
        .expect("a file system that takes any bytes as a name: let TMPDIR name a folder on one");
    // Of several files the other one is converted.
    for (input, output, wanted) in [(".", "both.laz", 2), ("*.las", "out/", 1)] {
        let (code, _, stderr) = pointmill(at, &["convert", input, "-o", output]);
        assert_eq!(code, wanted, "{stderr}");
        assert!(stderr.contains("not UTF-8"), "{stderr}");
    }
    let output = command(at, &["info"]).arg(name).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn info_is_json_with_the_same_keys_for_every_file_of_a_format() {
    const LAS: [&str; 24] = [
        "kind",
        "version",
        "point_format",
        "record_length",
        "points",
        "scale",
        "offset",
        "min",
        "max",
        "crs",
        "units",
        "gps_time",
        "system_identifier",
        "generating_software",
        "creation_day",
        "creation_year",
        "dimensions",
        "extra_bytes",
        "vlrs",
        "evlrs",
        "compressor",
        "chunk_points",
        "chunks",
        "warnings",
    ];
    const PLY: [&str; 7] =
        ["kind", "encoding", "bytes", "points", "elements", "comments", "obj_info"];
    let at = scans(&["a.las", "b.laz", "c.ply"]);
    let at = at.path();
    for (format, stride) in STRIDES.into_iter().enumerate() {
        let (described, more) = crate::support::las_file::extra_bytes();
        let file = crate::support::las_file::LasFile {
            format: format as u8,
            stride: stride + more,
            scale: [0.01; 3],
            offset: [0.0; 3],
            vlrs: &[described],
            evlrs: &[],
            records: &vec![0; 3 * (stride + more)],
        };
        fs::write(at.join(format!("f{format:02}.las")), file.bytes()).unwrap();
    }
    let json: Value = serde_json::from_str(&done(at, &["info", "--json", "."])).unwrap();
    let files = json.as_array().unwrap();
    assert_eq!(files.len(), 3 + 11);
    let keys = |file: &Value| -> Vec<String> {
        let mut keys: Vec<String> = file.as_object().unwrap().keys().cloned().collect();
        keys.sort();
        keys
    };
    let sorted = |keys: &[&str]| -> Vec<String> {
        let mut keys: Vec<String> = keys.iter().map(|&key| key.to_owned()).collect();
        keys.sort();
        keys
    };
    for (i, file) in files.iter().enumerate() {
        let own = if i == 2 { &PLY[..] } else { &LAS };
        // The first say how they were made.
        let told = if i < 3 { &["provenance"][..] } else { &[] };
        assert_eq!(keys(file), sorted(&[own, told].concat()));
    }
    assert_eq!((&files[0]["kind"], &files[1]["kind"]), (&"LAS".into(), &"LAZ".into()));
    assert_eq!((&files[0]["points"], &files[2]["points"]), (&3_000.into(), &3_002.into()));
    assert_eq!(files[0]["compressor"], "none");
    assert_eq!(files[1]["chunks"], 1);
    assert_eq!(files[2]["encoding"], "binary_little_endian");
    assert_eq!(files[2]["elements"][0]["name"], "vertex");
    for (format, file) in files[3..].iter().enumerate() {
        assert_eq!((&file["point_format"], &file["points"]), (&format.into(), &3.into()));
        assert_eq!(file["extra_bytes"].as_array().unwrap().len(), 6);
        assert_eq!(file["vlrs"][0]["user_id"], "LASF_Spec");
    }
    // One file is a list too; a bad file is told, the others are shown.
    let one: Value = serde_json::from_str(&done(at, &["info", "a.las", "--json"])).unwrap();
    assert_eq!(one.as_array().unwrap().len(), 1);
    fs::write(at.join("bad.las"), "LASF").unwrap();
    let (code, stdout, stderr) = pointmill(at, &["info", "--json", "a.las", "bad.las", "c.ply"]);
    assert_eq!(code, 1);
    assert_eq!(serde_json::from_str::<Value>(&stdout).unwrap().as_array().unwrap().len(), 2);
    assert!(stderr.contains("error: bad.las: "), "{stderr}");
    for name in ["a.las", "b.laz", "c.ply"] {
        let text = done(at, &["info", name]);
        assert!(text.starts_with(name) && text.contains("300"), "{text}");
    }
}

#[test]
fn plan_tells_what_a_run_would_do_and_does_none_of_it() {
    let at = scans(&["a.las"]);
    let at = at.path();
    fs::write(at.join("p.toml"), crate::support::setup::REDUCE).unwrap();
    let sets = ["--set", "read.path=a.las", "--set", "write.path=out.laz"];
    let plan = |more: &[&'static str]| [&["plan", "p.toml"], &sets[..], more].concat();
    let told = done(at, &plan(&["--memory", "300MiB", "--threads", "2"]));
    for part in [
        "3000 points",
        "normals",
        "20 nearest",
        "cells",
        "median",
        "out.laz",
        "300 MiB",
        "threads  2",
    ] {
        assert!(told.contains(part), "{part}:\n{told}");
    }
    let parts = ["a memory budget of 10 MiB is too small", "help: give `--memory ", "MiB"];
    fails(at, &plan(&["--memory", "10MiB"]), 1, &parts);
    assert_holds(at, &["a.las", "p.toml"]);
}

#[test]
fn files_that_an_earlier_split_left_are_told() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    std::fs::write(at.join("two.xyz"), "1 2 3\n200 2 3\n").unwrap();
    std::fs::write(at.join("one.xyz"), "1 2 3\n").unwrap();
    std::fs::create_dir(at.join("tiles")).unwrap();
    for (scan, is_told) in [("two", false), ("one", true)] {
        let line = format!("read {scan}.xyz columns=x,y,z ! write tiles/{{x}}_{{y}}.csv side=100");
        let (code, _, told) = crate::support::command::pointmill(
            at,
            &["run", &line, "--set", "run.existing=replace"],
        );
        assert_eq!(code, 0, "{told}");
        assert_eq!(told.contains("beside those of this one: tiles/200_0.csv;"), is_told, "{told}");
    }
}

#[test]
fn waveforms_have_no_copy_beside_standard_output() {
    let at = tempfile::tempdir().unwrap();
    for name in ["22-ext-waveform.las", "22-ext-waveform.wdp"] {
        std::fs::copy(crate::support::case_file(name), at.path().join(name)).unwrap();
    }
    let convert = ["convert", "22-ext-waveform.las", "-o", "-", "--to", "las"];
    let output = crate::support::command::command(at.path(), &convert).output().unwrap();
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && output.stdout.starts_with(b"LASF"), "{told}");
    assert!(told.contains("records of standard output refer to waveforms in "), "{told}");
    assert!(!std::path::Path::new("/dev/stdout.wdp").exists());
}
