//! Messages in the words of what was typed: flags for commands, keys for pipeline files, and what
//! to type instead.

use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

use crate::support::case_file;
use crate::support::command::{command, done, pointmill, scans};

/// What a command that fails with `code` prints on stderr.
fn told(at: &Path, arguments: &[&str], code: i32) -> String {
    let (given, stdout, stderr) = pointmill(at, arguments);
    assert_eq!((given, stdout.as_str()), (code, ""), "{arguments:?}: {stderr}");
    stderr
}

/// A file of `tests/cases`, copied beside the others.
fn case(at: &Path, name: &str) {
    fs::copy(case_file(name), at.join(name)).unwrap();
}

#[test]
fn remedies_are_flags_of_the_command_and_keys_of_a_pipeline_file() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    let help = |arguments: &[&str]| {
        let told = told(at, arguments, 1);
        told.lines().find(|line| line.starts_with("help: ")).unwrap().to_owned()
    };
    let small = help(&["reduce", "a.laz", "-o", "o.laz", "--memory", "10MiB", "--threads", "2"]);
    assert!(small.starts_with("help: give `--memory "), "{small}");
    assert!(small.contains("MiB` or more, or fewer `--threads`"), "{small}");
    // What it names would do.
    let budget = small.split(['`', ' ']).find(|word| word.ends_with("MiB")).unwrap();
    done(at, &["reduce", "a.laz", "-o", "o.laz", "--memory", budget, "--threads", "2"]);
    let text = "[[stage]]\nkind = 'read'\npath = 'a.laz'\n[[stage]]\nkind = 'write'\n\
                path = 'o.ply'\n";
    fs::write(at.join("p.toml"), text).unwrap();
    let small = help(&["run", "p.toml", "--memory", "10MiB"]);
    assert!(small.starts_with("help: give `--memory "), "{small}");
}

#[test]
fn warnings_are_in_flags_where_they_are_told_and_in_keys_in_the_report() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    let flags = "raise `--neighbors` or `--max-angle`, or give `--keep`";
    let keys = "raise `normals.neighbors` or `cells.max_angle`, or give `cells.keep`";
    let preset = ["--preset", "paper"];
    let reduce = [&["reduce", "a.laz", "-o", "o.laz", "--report", "r.json"][..], &preset].concat();
    let (code, _, stderr) = pointmill(at, &reduce);
    assert_eq!(code, 0, "{stderr}");
    assert!(stderr.contains(flags), "{stderr}");
    let report: serde_json::Value =
        serde_json::from_slice(&fs::read(at.join("r.json")).unwrap()).unwrap();
    assert!(report["run"]["warnings"][0].as_str().unwrap().contains(keys), "{report}");
    let (_, _, events) = pointmill(at, &[&reduce[..], &["--progress", "json"]].concat());
    assert!(events.lines().any(|l| l.contains("\"warning\"") && l.contains(flags)), "{events}");
    let text = "[[stage]]\nkind = 'read'\npath = 'a.laz'\n[[stage]]\nkind = 'normals'\n\
                [[stage]]\nkind = 'cells'\n[[stage]]\nkind = 'median'\n[[stage]]\n\
                kind = 'write'\npath = 'o.laz'\n";
    fs::write(at.join("p.toml"), text).unwrap();
    let (_, _, stderr) = pointmill(at, &["run", "p.toml"]);
    assert!(stderr.contains(keys), "{stderr}");
}

#[test]
fn what_a_conversion_would_lose_is_told_as_flags_or_as_keys() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty double y\n\
               property double z\nproperty float a_name_of_more_than_thirty_two_bytes\nend_header\n\
               1 2 3 4\n";
    fs::write(at.join("a.ply"), ply).unwrap();
    let one = told(at, &["convert", "a.ply", "-o", "o.las"], 2);
    assert!(one.contains("\nhelp: give `--scale auto`, which looks"), "{one}");
    let one = told(at, &["convert", "a.ply", "-o", "o.las", "--scale", "0.001"], 2);
    let name = "a_name_of_more_than_thirty_two_bytes";
    assert!(one.contains(&format!("\nhelp: `--drop {name}` leaves them out\n")), "{one}");
    let text = "[[stage]]\nkind = 'read'\npath = 'a.ply'\n[[stage]]\nkind = 'write'\n\
                path = 'o.las'\nscale = 0.001\n";
    fs::write(at.join("p.toml"), text).unwrap();
    let one = told(at, &["run", "p.toml"], 2);
    let help = format!("\nhelp: `write.drop = [\"{name}\"]` leaves them out\n");
    assert!(one.contains(&help), "{one}");
    let events = told(at, &["convert", "a.ply", "-o", "o.las", "--progress", "json"], 2);
    let event: serde_json::Value = serde_json::from_str(events.lines().last().unwrap()).unwrap();
    assert!(event["help"].as_str().unwrap().contains("`--scale 0.001`"), "{event}");
}

#[test]
fn commands_never_tell_places_in_the_pipelines_behind_them() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    case(at, "98-noclass.ply");
    let no_class = told(at, &["reduce", "98-noclass.ply", "-o", "o.ply", "--classes", "2,6"], 2);
    assert_eq!(
        no_class,
        "error: --classes: selects points by Classification, which the input does not have\n   \
         | 2,6\n   | ^^^\nhelp: leave `--classes` out\n"
    );
    let twice = ["reduce", "a.laz", "-o", "o.laz", "--passes", "3", "--keep", "10%"];
    assert_eq!(
        told(at, &twice, 2),
        "error: `cells` looks at the whole scan and cannot be repeated\nhelp: leave `--passes` \
         out, or run the pipeline twice\n"
    );
    let text = "[[stage]]\nkind = 'read'\npath = '98-noclass.ply'\n[[stage]]\nkind = 'normals'\n\
                classes = [2]\n[[stage]]\nkind = 'write'\npath = 'o.ply'\n";
    fs::write(at.join("p.toml"), text).unwrap();
    assert_eq!(
        told(at, &["check", "p.toml"], 2),
        "error: p.toml:6:11: `normals.classes` selects points by Classification, which the input \
         does not have\n  6 | classes = [2]\n    |           ^^^\nhelp: leave `normals.classes` \
         out\n"
    );
}

#[test]
fn stages_that_do_not_fit_are_told_with_line_column_and_caret() {
    let at = scans(&["a.laz"]);
    let text = "[[stage]]\nkind = 'read'\npath = 'a.laz'\n[[stage]]\nkind = 'median'\n\
                [[stage]]\nkind = 'write'\npath = 'o.laz'\n";
    fs::write(at.path().join("p.toml"), text).unwrap();
    assert_eq!(
        told(at.path(), &["check", "p.toml"], 2),
        "error: 2 mistakes\np.toml:5:8: `median` needs Cell, which nothing before it gives\n  \
         5 | kind = 'median'\n    |        ^^^^^^^^\n  = put a `cells` stage before it\n\
         p.toml:5:8: `median` needs Normal, which nothing before it gives\n  \
         5 | kind = 'median'\n    |        ^^^^^^^^\n  = put a `normals` stage before it\n"
    );
}

#[test]
fn almost_pipelines_are_told_what_to_type() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    case(at, "60k-stage-table.toml");
    assert_eq!(
        told(at, &["run", "60k-stage-table.toml"], 2),
        "error: 60k-stage-table.toml:1:1: a stage is one of several tables: write [[stage]]\n  \
         1 | [stage]\n    | ^^^^^^^\n    = so are lines 5, 8, 12, 15\n"
    );
    let write = "[[stage]]\nkind = 'write'\npath = 'o.laz'\n";
    let read = "[[stage]]\nkind = 'read'\npath = 'a.laz'\n";
    for (text, expected) in [
        (
            format!("{read}{write}").replace("[[stage]]", "[[stages]]"),
            "error: p.toml:1:3: a pipeline file has no `stages`: write [[stage]]\n",
        ),
        (
            format!("{read}[[stage]]\nname = 'normals'\n{write}"),
            "error: p.toml:5:8: a stage needs `kind`: write kind = \"normals\"\n",
        ),
        (
            format!("{read}[[stage]]\ntype = 'normal'\n{write}"),
            "error: p.toml:5:1: a stage has no `type`: write `kind`\n",
        ),
        (
            "{\n \"pipeline\": [ \"a.laz\", { \"type\": \"filters.normal\" } ]\n}".to_owned(),
            "error: p.toml:1:1: this is a pipeline of PDAL, which pointmill does not run\n",
        ),
        (
            "[ \"a.laz\", { \"type\": \"filters.normal\" } ]".to_owned(),
            "error: p.toml:1:1: this is a pipeline of PDAL, which",
        ),
        (
            "{ \"stage\": ".to_owned(),
            "error: p.toml:1:12: not JSON: expected value after colon in object property\n",
        ),
    ] {
        fs::write(at.join("p.toml"), &text).unwrap();
        let one = told(at, &["check", "p.toml"], 2);
        assert!(one.starts_with(expected), "{text}\n{one}");
    }
    fs::write(at.join("p.toml"), format!("{read}[[stage]]\ntype = 'normal'\n{write}")).unwrap();
    assert!(
        told(at, &["check", "p.toml"], 2)
            .contains("= did you mean `normals`? kinds: assign, cells, ")
    );
}

#[test]
fn files_that_are_not_there_are_told_what_their_paths_are_relative_to() {
    let at = tempfile::tempdir().unwrap();
    let folder = at.path().canonicalize().unwrap();
    let relative = format!("the path is relative to the folder you are in, {}\n", folder.display());
    let home = "`~` means your home folder in a shell alone: write its whole name\n";
    let check = |read: &str, write: &str| {
        let text = format!(
            "[[stage]]\nkind = 'read'\npath = '{read}'\n[[stage]]\nkind = 'write'\npath = '{write}'\n"
        );
        fs::write(folder.join("p.toml"), text).unwrap();
        told(&folder, &["check", "p.toml"], 1)
    };
    for read in ["no.laz", "no/*.laz"] {
        let one = check(read, "o.laz");
        assert!(one.ends_with(&relative), "{read}: {one}");
    }
    assert!(check("~/a.laz", "o.laz").ends_with(home));
    let whole = check("/no/a.laz", "o.laz");
    assert!(!whole.contains("relative"), "{whole}");
    assert!(told(&folder, &["run", "no.toml"], 1).ends_with(&relative));
    fs::write(folder.join("a.las"), b"").unwrap();
    let one = check("a.las", "no/o.laz");
    let create = |name: &str| format!("= create it first, such as by `mkdir -p {name}`");
    assert!(
        one.contains(&create("no")) && one.contains(relative.trim_start_matches("help: ")),
        "{one}"
    );
    let one = check("a.las", "~/o.laz");
    assert!(one.contains(&create("~")) && one.contains(home.trim_start_matches("help: ")), "{one}");
}

#[test]
fn values_of_flags_are_told_what_is_right() {
    let at = scans(&["a.laz"]);
    let reduce = |flag: &str, value: &str| {
        told(at.path(), &["reduce", "a.laz", "-o", "o.laz", flag, value], 2)
    };
    for (flag, value, expected) in [
        (
            "--neighbors",
            "ten",
            "--neighbors: takes a whole number from 3 to 64, not the text \"ten\"",
        ),
        ("--passes", "1.5", "--passes: takes a whole number from 1 to 16, not 1.5"),
        ("--max-side", "two", "--max-side: "),
        ("--offset", "1,x,3", "--offset: takes a number, not the text \"x\""),
        (
            "--classes",
            "grund",
            "classes are numbers from 0 to 255, or ranges such as 3-5; ground is 2",
        ),
        ("--classes", "2,256", "classes are numbers from 0 to 255, or ranges such as 3-5\n"),
        ("--offset", "1,2", "error: --offset: takes a list of 3 values, not 2 values\n"),
        ("--mark", "keypoint", "= did you mean `key-point`?"),
        ("--side", "atuo", "= did you mean `auto`?"),
        (
            "--keep",
            "lots",
            "error: --keep: takes a share of up to 100% such as \"10%\", a number of points",
        ),
        ("--withheld", "drp", "error: --withheld: cannot be `drp`\n"),
        ("--method", "pcb", "= did you mean `pca`? valid: cubic, delaunay, pca, quadric, varady"),
    ] {
        let one = reduce(flag, value);
        assert!(one.contains(expected), "{flag} {value}: {one}");
    }
    let convert = ["convert", "a.laz", "-o", "o.ply", "--drop", "Intensty"];
    assert!(told(at.path(), &convert, 2).starts_with(
        "error: o.ply: `--drop` names `Intensty`, which the input does not have\nhelp: did you mean \
         `Intensity`? it has `X`, `Y`, `Z`, "
    ));
    let set = told(at.path(), &["run", "p.toml", "--set", "cells"], 2);
    let expected = "error: --set: there is no `=`\n   | cells\n   | ^^^^^\n   = write STAGE.KEY=VALUE, \
                    such as cells.max_angle=0.2 or run.threads=2\n";
    assert_eq!(set, expected);
    let text =
        "[[stage]]\nkind = 'read'\npath = 'a.laz'\n[[stage]]\nkind = 'write'\npath = 'o.ply'\n";
    fs::write(at.path().join("p.toml"), text).unwrap();
    let set = told(at.path(), &["run", "p.toml", "--set", "wirte.path=b.laz"], 2);
    assert!(set.contains("no stage `wirte`") && set.contains("did you mean `write`?"), "{set}");
}

#[test]
fn every_wrong_value_has_a_caret_below_what_was_typed() {
    let at = scans(&["a.laz"]);
    for (flag, value, expected) in [
        ("--max-side", "-2m", "takes a length above 0 in the scan's unit, or with a unit"),
        ("--min-points", "-1", "takes a whole number from 1, not -1"),
        ("--keep", "-5", "takes a share of up to 100% such as"),
        ("--keep", "0%", "takes a share of up to 100% such as"),
        ("--keep", "110%", "takes a share of up to 100% such as"),
        ("--max-side", "2k", "takes a length above 0"),
        ("--max-angle", "-6deg", "takes an angle from 0 to pi"),
        ("--max-angle", "6", "an angle is in radians, at most pi, and 6 is more"),
        ("--z-scale", "0", "takes a number above 0, or \"auto\", not 0"),
        ("--reference", "0,0,0", "a vector [x, y, z] is of finite numbers, one of them not 0"),
        ("--scale", "1cm", "takes a number above 0 without a unit"),
        (
            "--lattice",
            "1mm",
            "takes a number above 0, in the scan's unit and without a unit behind it",
        ),
        ("--neighbors", "1e2", "takes a whole number from 3 to 64, not 100"),
        ("--threads", "2k", "takes a whole number from 1 to 1024, not 2000"),
        (
            "--threads",
            "18446744073709551616",
            "takes a whole number from 1 to 1024, not 18446744073709551616\n",
        ),
        (
            "--neighbors",
            "-99999999999999999999",
            "takes a whole number from 3 to 64, not -99999999999999999999\n",
        ),
        ("--passes", "1e300", "takes a whole number from 1 to 16, not 1e300\n"),
        ("--memory", "2G", "`2G` is no size such as 512MiB or 2GiB: write 2GiB (units"),
        ("--memory", "-1", "`-1` is no size"),
        ("--classes", "5-1", "`5-1` is no range of classes: write 1-5"),
        ("--preset", "papr", "cannot be `papr`"),
        ("--progress", "jsn", "cannot be `jsn`"),
    ] {
        let one = told(at.path(), &["reduce", "a.laz", "-o", "o.laz", flag, value], 2);
        let carets = "^".repeat(value.len());
        assert!(one.starts_with(&format!("error: {flag}: {expected}")), "{flag} {value}: {one}");
        let shown = format!("\n   | {value}\n   | {carets}\n");
        assert!(one.contains(&shown), "{flag} {value}: {one}");
        assert!(!one.contains("did you mean `1") && !one.contains("did you mean `2"), "{one}");
        assert!(!one.contains("For more information"), "{one}");
    }
    let synth = ["synth", "plane", "-n", "9", "-o", "o.laz"];
    for (flag, value) in [("--seed", "-1"), ("--noise", "1mm"), ("-n", "-9")] {
        let given =
            if flag == "-n" { &[&synth[..2], &synth[4..]].concat()[..] } else { &synth[..] };
        let one = told(at.path(), &[given, &[flag, value]].concat(), 2);
        assert!(one.contains(&format!("{flag}: takes a ")), "{one}");
        assert!(one.contains(&format!("\n   | {value}\n   | ^^")), "{one}");
    }
}

#[test]
fn numbers_and_ranges_are_read_in_every_form() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    let reduce = |more: &[&str]| {
        let all = [&["reduce", "a.laz", "-o", "o.laz", "--keep", "1e2"], more].concat();
        let (code, _, stderr) = pointmill(at, &all);
        assert_eq!(code, 0, "{stderr}");
        fs::read(at.join("o.laz")).unwrap()
    };
    let plain = reduce(&["--neighbors", "10", "--min-points", "2", "--threads", "2"]);
    let forms = ["--neighbors", "1e1", "--min-points", "2.0", "--threads", "2e0"];
    assert_eq!(reduce(&forms), plain);
    let classes = |given: &str| reduce(&["--classes", given]);
    assert_eq!(classes("1-3,5"), classes("1,2,3,5"));
    let text = "[[stage]]\nkind = 'read'\npath = 'a.laz'\n[[stage]]\nkind = 'normals'\n\
                neighbors = '1e1'\n[[stage]]\nkind = 'cells'\nmin_points = '1k'\n[[stage]]\n\
                kind = 'median'\npasses = 1e0\n[[stage]]\nkind = 'write'\npath = 'o.laz'\n";
    fs::write(at.join("p.toml"), text).unwrap();
    done(at, &["check", "p.toml", "--set", "normals.neighbors=2e1"]);
    let one = told(at, &["check", "p.toml", "--set", "median.passes=0"], 2);
    assert!(one.contains("--set: `passes`: takes a whole number from 1 to 16, not 0\n"), "{one}");
}

#[test]
fn options_that_are_not_there_and_outputs_without_one_are_told_what_to_type() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    let one = told(at, &["reduce", "a.laz", "--out", "x.laz"], 2);
    assert!(one.contains("did you mean `--output` or "), "{one}");
    for command in ["reduce", "convert"] {
        let one = told(at, &[command, "a.laz", "out.laz"], 2);
        assert!(one.ends_with("help: if `out.laz` is the output, write `-o out.laz`\n"), "{one}");
    }
    let one = told(at, &["reduce"], 2);
    assert!(
        one.starts_with("error: `reduce` needs --output <OUT> or --outdir <DIR>, and <IN>..."),
        "{one}"
    );
    let one = told(at, &["convert"], 2);
    assert!(one.starts_with("error: `convert` needs --output <OUT|DIR> and <IN>..."), "{one}");
    let one = told(at, &["convert", "a.laz", "a.laz"], 2);
    assert!(!one.contains("is the output"), "a file that is there is an input: {one}");
    let one = told(at, &["reduce", "a.laz", "-o", "o.laz", "--keep", "1", "--keep", "2"], 2);
    assert!(one.starts_with("error: --keep is given twice\n"), "{one}");
}

#[test]
fn what_is_no_scan_or_no_pipeline_is_called_what_it_is() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    for arguments in
        [&["reduce", "nowhere", "-o", "o.laz"][..], &["picture", "no", "where", "-o", "o.png"]]
    {
        let one = told(at, arguments, 1);
        assert!(
            one.contains(": cannot open it") && one.contains("No such file"),
            "{arguments:?}: {one}"
        );
    }
    let one = told(at, &["run", "a.laz"], 1);
    assert!(one.contains("this is a LAS or LAZ file, not a pipeline file"), "{one}");
    assert!(one.contains("`pointmill reduce a.laz -o OUT`"), "{one}");
    for name in ["a.rcp", "a.drc"] {
        fs::write(at.join(name), b"\0\x01\x02").unwrap();
        let one = told(at, &["reduce", name, "-o", "o.laz"], 2);
        assert!(one.contains("which is not read") && !one.contains("read.format"), "{one}");
    }
    // What is not there is told alike, whatever its name.
    for (command, output) in [("reduce", "o.laz"), ("convert", "o.laz"), ("picture", "o.png")] {
        for name in ["no.laz", "no.ply", "no.txt", "no"] {
            let one = told(at, &[command, name, "-o", output], 1);
            let expected = format!("error: {name}: cannot open it\n  No such file or directory");
            assert!(one.starts_with(&expected), "{command:?} {name}: {one}");
        }
    }
    let text = "[[stage]]\nkind = 'read'\npath = 'a.laz'\nkind = 'write'\npath = 'o.laz'\n";
    fs::write(at.join("p.toml"), text).unwrap();
    let one = told(at, &["check", "p.toml"], 2);
    assert!(one.contains("= a second stage begins with a line [[stage]] of its own"), "{one}");
    let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty half x\nend_header\n1\n";
    fs::write(at.join("h.ply"), ply).unwrap();
    let one = told(at, &["info", "h.ply"], 1);
    assert!(one.contains("no property has the type `half`; types are char, uchar"), "{one}");
}

#[test]
fn messages_name_no_flag_that_was_not_typed_and_no_stage_that_a_command_hides() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    case(at, "98-noclass.ply");
    let warned = |arguments: &[&str]| pointmill(at, arguments).2;
    let none = warned(&["reduce", "a.laz", "-o", "o.laz", "--classes", "33"]);
    assert!(none.contains("no point is of class 33: what was asked for those points"), "{none}");
    let paper = warned(&["reduce", "a.laz", "-o", "o.laz", "--preset", "paper"]);
    assert!(paper.contains("more than the largest angle of a cell, 0.1 rad:"), "{paper}");
    let keep = ["reduce", "98-noclass.ply", "-o", "o.ply", "--keep-classes", "2"];
    let keep = told(at, &keep, 2);
    assert!(
        keep.contains("`--keep-classes` selects points by Classification")
            && keep.ends_with("help: leave `--keep-classes` out\n"),
        "{keep}"
    );
}

#[test]
fn commands_that_write_nothing_neither_offer_nor_take_flags_about_files() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    for command in ["plan", "check"] {
        let help = done(at, &[command, "--help"]);
        assert!(help.contains("--memory"), "{help}");
        for flags in [&["--report", "r.json"][..], &["--no-clobber"]] {
            assert!(!help.contains(flags[0]), "{help}");
            let one = told(at, &[&[command, "p.toml"], flags].concat(), 2);
            let expected = format!("error: {}: is for commands that write files\n", flags[0]);
            assert!(one.starts_with(&expected), "{one}");
        }
    }
}

#[test]
fn one_name_that_is_no_text_does_not_keep_the_other_files_from_being_converted() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    fs::create_dir(at.join("in")).unwrap();
    fs::copy(at.join("a.laz"), at.join("in/a.laz")).unwrap();
    fs::copy(at.join("a.laz"), at.join("in").join(std::ffi::OsStr::from_bytes(b"b\xff.laz")))
        .unwrap();
    let (code, stdout, stderr) = pointmill(at, &["convert", "in", "-o", "out/", "--to", "ply"]);
    assert_eq!(code, 1, "{stderr}");
    assert!(at.join("out/a.ply").exists());
    assert!(stderr.contains("in/b\\xff.laz: the name is not UTF-8 text"), "{stderr}");
    assert!(stdout.contains("failed     1\n"), "{stdout}");
}

#[test]
fn what_is_marked_is_told_by_its_number() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    let marked = |how: &str| {
        let told = done(at, &["reduce", "a.laz", "-o", "o.laz", "--keep", "1000", "--mark", how]);
        assert!(told.starts_with("points     3,000 in, 3,000 out (100.0 %)\n"), "{told}");
        assert!(!told.contains("→ 1,000"), "nothing is gone: {told}");
        assert!(told.contains(" of them stay by their marks ("), "{told}");
        let lines = told.lines().filter(|line| line.starts_with("marked  "));
        lines.map(|line| line["marked     ".len()..].to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(marked("key-point"), ["2,000 as no key-points by median", "1,000 as key-points"]);
    assert_eq!(marked("withheld"), ["2,000 as withheld by median"]);
    assert_eq!(marked("18"), ["2,000 as class 18 by median"]);
}

#[test]
fn the_summary_says_units_and_what_was_not_measured() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    let plain = done(at, &["reduce", "a.laz", "-o", "o.laz", "--keep", "500", "--measure", "cone"]);
    assert!(plain.contains("\nangle      ") && plain.contains(" rad at most: what normals of"));
    let has_unit = |line: &str| line.split([' ', ',']).any(|word| word == "m");
    let lengths = |told: &str| {
        let heads = ["deviation", "baseline", "plane RMS"];
        let is_length = |line: &&str| heads.iter().any(|head| line.starts_with(head));
        told.lines().filter(is_length).map(str::to_owned).collect::<Vec<String>>()
    };
    assert_eq!(lengths(&plain).len(), 3, "{plain}");
    assert!(!lengths(&plain).iter().any(|line| has_unit(line)), "no unit is known: {plain}");
    // A scan in metres.
    done(at, &["convert", "a.laz", "-o", "a.ply", "--encoding", "ascii"]);
    let text = fs::read_to_string(at.join("a.ply")).unwrap();
    let text = text.replacen("comment", "comment crs: EPSG:32632\ncomment", 1);
    fs::write(at.join("m.ply"), text).unwrap();
    let (_, told, chosen) = pointmill(at, &["reduce", "m.ply", "-o", "o.ply", "--side", "spread"]);
    assert!(lengths(&told).iter().all(|line| has_unit(line)), "{told}");
    assert!(chosen.contains("side ") && chosen.contains(" m, min spacing "), "{chosen}");
    let most = done(at, &["reduce", "a.laz", "-o", "o.laz", "--keep", "2900", "--measure", "cone"]);
    assert!(most.contains("\nbaseline   not measured: a voxel grid of so many"), "{most}");
}

#[test]
fn a_scan_without_points_and_a_number_above_all_are_told() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    let all = ["reduce", "a.laz", "-o", "o.laz", "--keep", "1e9"];
    let (_, _, told) = pointmill(at, &all);
    let warning =
        "warning: `--keep` asks for 1,000,000,000 records, and the scan has 3,000 positions";
    assert!(told.contains(warning), "{told}");
    let (_, _, told) = pointmill(at, &[&all[..], &["--measure", "cone"]].concat());
    let warning =
        "warning: `--keep` asks for 1000000000 records, and 3000 stay however small the angle";
    assert!(told.contains(warning), "{told}");
    pointmill(at, &["convert", "a.laz", "-o", "none.laz", "--keep-classes", "200"]);
    for command in ["reduce", "convert"] {
        let (code, _, told) = pointmill(at, &[command, "none.laz", "-o", "o.laz"]);
        assert_eq!(code, 0, "{told}");
        assert!(told.contains("warning: the inputs have no points"), "{told}");
    }
    let (_, _, plan) = pointmill(at, &["reduce", "a.laz", "-o", "o.laz", "-v", "--side", "spread"]);
    assert!(plan.contains(", up to 20 nearest neighbours"), "{plan}");
    let (_, _, plan) = pointmill(at, &["reduce", "a.laz", "-o", "o.laz", "-v", "--neighbors", "9"]);
    assert!(plan.contains(", 9 nearest neighbours"), "{plan}");
}

#[test]
fn points_without_a_normal_are_counted_and_a_better_grid_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let head = "ply\nformat ascii 1.0\nelement vertex 40\nproperty double x\nproperty double y\n\
                property double z\nend_header\n";
    let line: String = (0..40).map(|i| format!("{i} 0 0\n")).collect();
    fs::write(at.join("line.ply"), format!("{head}{line}")).unwrap();
    let told = done(at, &["reduce", "line.ply", "-o", "o.ply", "--side", "spread"]);
    assert!(told.contains("40 in, 40 out"), "{told}");
    assert!(
        told.contains("\ncells      0, and 40 points in none: they have no normal, since"),
        "{told}"
    );
    // Each pass looks at them again.
    let told = done(at, &["reduce", "line.ply", "-o", "o.ply", "--passes", "3"]);
    assert!(told.contains("40 in, 40 out") && !told.contains("120 points"), "{told}");
    // Leaves, of which no plane tells anything.
    done(at, &["synth", "als", "-n", "30k", "--noise", "3", "-o", "leaves.laz"]);
    let told =
        done(at, &["reduce", "leaves.laz", "-o", "o.laz", "--keep", "2%", "--measure", "cone"]);
    let baseline = told.lines().find(|line| line.starts_with("baseline ")).unwrap();
    let rms = |line: &str| -> f64 {
        line.split("RMS ").nth(1).unwrap().split([' ', ',']).next().unwrap().parse().unwrap()
    };
    let deviation = told.lines().find(|line| line.starts_with("deviation ")).unwrap();
    let is_worse = rms(deviation) > 1.02 * rms(baseline);
    assert!(is_worse, "the scene is to be one where a grid is better: {told}");
    assert!(baseline.ends_with(", which loses less here"), "{told}");
}

#[test]
fn a_name_too_long_for_its_file_system_is_told_before_the_work() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    let long = "n".repeat(300);
    let named = [format!("{long}.laz"), format!("{long}.json")];
    let pipeline = format!(
        "[[stage]]\nkind = 'read'\npath = 'a.laz'\n[[stage]]\nkind = 'write'\npath = '{}'\n",
        named[0]
    );
    fs::write(at.join("p.toml"), pipeline).unwrap();
    for arguments in [
        &["reduce", "a.laz", "-o", &named[0]][..],
        &["reduce", "a.laz", "-o", "o.laz", "--report", &named[1]],
        &["convert", "a.laz", "-o", &named[0]],
        &["check", "p.toml"],
        &["plan", "p.toml"],
    ] {
        let (code, _, told) = pointmill(at, arguments);
        assert_ne!(code, 0, "{arguments:?}: {told}");
        assert!(told.contains("the name is too long for its file system"), "{told}");
        assert!(!at.join("o.laz").exists(), "{arguments:?}");
    }
}

#[test]
fn one_report_for_several_outputs_is_told_with_what_to_do() {
    let at = scans(&["a.laz", "b.laz"]);
    let several = ["convert", "a.laz", "b.laz", "-o", "out/", "--report", "r.json"];
    assert_eq!(
        told(at.path(), &several, 2),
        "error: --report: is for one output, and this makes several\n   | r.json\n   | ^^^^^^\n   = \
         leave --report out, or convert the files one by one; --summary tells of all\n"
    );
}

#[test]
fn arguments_that_are_no_text_are_told_alike_and_their_folder_works() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    let name = std::ffi::OsStr::from_bytes(b"b\xff.laz");
    fs::copy(at.join("a.laz"), at.join(name)).unwrap();
    for before in [&["reduce", "-o", "o.laz"][..], &["convert", "-o", "o.laz"], &["info"], &["run"]]
    {
        let output = command(at, before).arg(name).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{before:?}");
        let told = String::from_utf8(output.stderr).unwrap();
        assert!(told.starts_with("error: the argument `b\\xff.laz` is not UTF-8 text\n"), "{told}");
        assert!(told.contains("help: rename the file: pipelines and reports"), "{told}");
    }
    // A name that a pattern or a folder leads to is refused alike.
    for found in [&["info", "b*.laz"][..], &["convert", ".", "-o", "out.laz"]] {
        assert!(told(at, found, 2).contains("b\\xff.laz: the name is not UTF-8 text"));
    }
}

#[test]
fn what_a_terminal_would_obey_is_never_printed() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    let odd = "\u{1b}]0;owned\u{7}\u{202e}x\nerror: y.laz";
    fs::copy(at.join("a.laz"), at.join(odd)).unwrap();
    let plain = |text: &str, what: &str| {
        let obeyed = |c: char| {
            c.is_control() && c != '\n'
                || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
        };
        assert!(!text.contains(obeyed), "{what}: {text:?}");
        // A line of a name's own would be taken for one of the program's.
        assert!(!text.lines().any(|line| line.starts_with("error: y.laz")), "{what}: {text}");
    };
    let shown = "\\u{1b}]0;owned\\u{7}\\u{202e}x\\nerror: y.laz";
    let info = done(at, &["info", odd]);
    plain(&info, "info");
    assert!(info.starts_with(shown), "{info}");
    let json = done(at, &["info", "--json", odd]);
    plain(&json, "info --json");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json[0]["points"], 3_000);
    let output = format!("{odd}.las");
    let table = done(at, &["reduce", odd, "-o", &output]);
    plain(&table, "reduce");
    assert!(table.contains(&format!("output     {shown}.las, ")), "{table}");
    for arguments in [
        &["reduce", odd, "-o", odd][..],
        &["reduce", odd, "-o", "o.laz", "--method", odd],
        &["reduce", odd, "-o", "o.laz", "--max-side", odd],
        &["reduce", odd, "-o", "o.laz", "--progress", odd],
        &["convert", "a.laz", "-o", "no/", "--to", odd],
        &["convert", odd, "-o", &format!("{odd}/o.laz")],
        &["run", &format!("{odd}.toml")],
    ] {
        let (code, stdout, stderr) = pointmill(at, arguments);
        assert!(code > 0 && stdout.is_empty(), "{arguments:?}");
        plain(&stderr, &format!("{arguments:?}"));
    }
    let (_, _, events) = pointmill(at, &["reduce", odd, "-o", "o.laz", "--progress", "json"]);
    plain(&events, "events");
    for line in events.lines() {
        serde_json::from_str::<serde_json::Value>(line).unwrap();
    }
    fs::write(at.join("p.toml"), "[[stage]]\nkind = \"re\u{202e}ad\"\n").unwrap();
    let (_, _, mistakes) = pointmill(at, &["check", "p.toml"]);
    plain(&mistakes, "a pipeline's text");
    assert!(mistakes.contains("there is no stage `re\\u{202e}ad`"), "{mistakes}");
}

#[test]
fn completions_and_manual_pages_know_every_command_and_flag() {
    let at = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let text = done(at.path(), &["completions", shell]);
        for word in ["reduce", "max-angle", "completions"] {
            assert!(text.contains(word), "{shell}: {word}");
        }
    }
    let page = done(at.path(), &["man"]);
    assert!(page.contains(".TH pointmill 1") && page.contains("Exit codes"), "{page}");
    assert_eq!(done(at.path(), &["man", "new/man1"]), "");
    let reduce = fs::read_to_string(at.path().join("new/man1/pointmill-reduce.1")).unwrap();
    for word in ["\\-\\-max\\-angle", "Examples", "HOW MUCH TO KEEP"] {
        assert!(reduce.contains(word), "{word}: {reduce}");
    }
    let pages = fs::read_dir(at.path().join("new/man1")).unwrap().count();
    assert!(pages >= 11, "{pages} pages");
}

#[test]
fn a_reference_is_never_ignored() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    let reduce = ["reduce", "a.laz", "-o", "o.laz", "--reference", "z"];
    let wrong = told(at, &reduce, 2);
    assert!(wrong.contains("--reference: needs `--measure axis`"), "{wrong}");
    assert!(wrong.contains("add `--measure axis`, or leave `--reference` out"), "{wrong}");
    done(at, &[&reduce[..], &["--measure", "axis"]].concat());
    done(at, &[&reduce[..], &["--preset", "paper"]].concat());
}

#[test]
fn a_scan_without_gps_time_is_told_nothing_of_it() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    case(at, "50-rgb8.ply");
    done(at, &["convert", "50-rgb8.ply", "-o", "x.las", "--scale", "0.001"]);
    let ply = |time: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty double y\n\
             property double z\nproperty double {time}\nend_header\n1 2 3 4\n"
        )
    };
    fs::write(at.join("timed.ply"), ply("gps_time")).unwrap();
    let convert = ["convert", "timed.ply", "-o", "x.las", "--scale", "0.001"];
    let (code, _, stderr) = pointmill(at, &convert);
    assert!(code == 0 && stderr.contains("the input does not say what it counts"), "{stderr}");
    done(at, &[&convert[..], &["--drop", "GpsTime"]].concat());
}

#[test]
fn classes_that_no_record_has_are_told_in_every_command() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    case(at, "98-noclass.ply");
    for command in ["reduce", "convert"] {
        let drop = [command, "98-noclass.ply", "-o", "o.ply", "--drop-classes", "7"];
        let (code, _, stderr) = pointmill(at, &drop);
        assert_eq!(code, 0, "{stderr}");
        let warning = "warning: the input has no classes: `--drop-classes` leaves no point out";
        assert!(stderr.contains(warning), "{stderr}");
        told(at, &[command, "98-noclass.ply", "-o", "o.ply", "--keep-classes", "2"], 2);
    }
}

#[test]
fn a_scan_of_which_no_point_fits_is_refused_before_the_work() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    case(at, "108-float-utm.ply");
    let reduce = ["reduce", "108-float-utm.ply", "-o", "x.las", "--scale", "0.001"];
    let refused = told(at, &reduce, 1);
    assert!(refused.contains("help: ") && refused.contains("--offset"), "{refused}");
    assert!(!refused.contains("if such a point is kept"), "{refused}");
    assert!(!refused.contains("chosen"), "it is told after the decode: {refused}");
}

#[test]
fn classes_that_no_point_is_of_are_told_by_their_flags() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    let warned = |arguments: &[&str]| {
        let (code, _, stderr) = pointmill(at, arguments);
        assert_eq!(code, 0, "{stderr}");
        stderr
    };
    let none = "warning: no point is of class 77 or 78: `--drop-classes` leaves no point out\n";
    for command in ["reduce", "convert"] {
        let arguments = [command, "a.laz", "-o", "o.laz"];
        let dropped = warned(&[&arguments[..], &["--drop-classes", "77-78"]].concat());
        assert_eq!(dropped.matches(none).count(), 1, "{dropped}");
        // One of several is enough, as it is for `--classes`.
        let dropped = warned(&[&arguments[..], &["--drop-classes", "0-77"]].concat());
        assert!(!dropped.contains("leaves no point out"), "{dropped}");
        let kept = warned(&[&arguments[..], &["--keep-classes", "77"]].concat());
        assert!(kept.contains(" removed (`--keep-classes`)\n"), "{kept}");
        assert!(kept.contains("warning: no point is left of "), "{kept}");
        let both = ["--keep-classes", "77", "--drop-classes", "2"];
        let both = warned(&[&arguments[..], &both].concat());
        assert!(both.contains(" removed (`--keep-classes` and `--drop-classes`)\n"), "{both}");
    }
    let text = "[[stage]]\nkind = 'read'\npath = 'a.laz'\n[[stage]]\nkind = 'filter'\n\
                drop_classes = [77]\ndrop_flags = ['withheld']\n[[stage]]\nkind = 'write'\n\
                path = 'o.laz'\n";
    fs::write(at.join("p.toml"), text).unwrap();
    let warned = warned(&["run", "p.toml"]);
    for key in ["of class 77: `filter.drop_classes`", "with the flag withheld: `filter.drop_flags`"]
    {
        assert!(warned.contains(&format!("no point is {key} leaves no point out\n")), "{warned}");
    }
}

#[test]
fn files_of_unclear_format_are_told_what_helps_the_command() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    case(at, "160-las-named.ply");
    fs::write(at.join("a.bin"), b"what it is").unwrap();
    let las = told(at, &["convert", "160-las-named.ply", "-o", "o.laz"], 1);
    assert!(las.ends_with("help: name it .las or .laz, or give `--from las`\n"), "{las}");
    let bin = told(at, &["convert", "a.bin", "-o", "o.laz"], 2);
    let names = ".las, .laz, .copc.laz, .ply, .pcd, .e57, .obj, .off, .stl, .ptx, .pts, .xyz, \
                 .txt, .csv or .asc";
    assert!(bin.ends_with(&format!("= name it {names}, or give `--from`\n")), "{bin}");
    // No pipeline draws a picture.
    let las = told(at, &["picture", "160-las-named.ply", "-o", "o.png"], 1);
    assert!(las.ends_with("\nhelp: name it .las or .laz\n"), "{las}");
    let bin = told(at, &["picture", "a.bin", "-o", "o.png"], 2);
    assert!(bin.ends_with(&format!("\nhelp: name it {names}\n")), "{bin}");
}
