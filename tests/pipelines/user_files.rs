//! Files that a command reads, or that its user wants to keep: it never writes over them, by
//! whatever name.

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;

use crate::support::assert_holds;
use crate::support::command::{done, fails, pointmill, scans};

/// `p.toml`, which converts `a.las` to `out.laz`.
fn pipeline(at: &Path, run: &str) {
    let text = format!(
        "{run}[[stage]]\nkind = 'read'\npath = 'a.las'\n[[stage]]\nkind = 'write'\npath = 'out.laz'\n"
    );
    fs::write(at.join("p.toml"), text).unwrap();
}

#[test]
fn a_conversion_into_a_folder_spares_inputs_of_the_others_behind_links() {
    for hard in [false, true] {
        let at = scans(&["a.las", "b.las"]);
        let at = at.path();
        for folder in ["in", "out"] {
            fs::create_dir(at.join(folder)).unwrap();
        }
        fs::rename(at.join("a.las"), at.join("in/a.las")).unwrap();
        // The second input is what the first one's output would replace.
        fs::rename(at.join("b.las"), at.join("out/a.las")).unwrap();
        match hard {
            true => fs::hard_link(at.join("out/a.las"), at.join("in/b.las")).unwrap(),
            false => symlink("../out/a.las", at.join("in/b.las")).unwrap(),
        }
        let before = fs::read(at.join("out/a.las")).unwrap();
        let told = "-o: out/a.las is the input in/b.las: it cannot be written over";
        fails(at, &["convert", "in", "-o", "out"], 2, &[told, "help: "]);
        fails(
            at,
            &["reduce", "in", "--outdir", "out"],
            2,
            &["out/a.las: this is the input in/b.las"],
        );
        assert!(fs::read(at.join("out/a.las")).unwrap() == before);
        assert_holds(&at.join("out"), &["a.las"]);
    }
}

#[test]
fn the_pipeline_is_not_replaced_by_what_it_writes() {
    let at = scans(&["a.las"]);
    let at = at.path();
    pipeline(at, "");
    symlink("p.toml", at.join("link.json")).unwrap();
    let before = fs::read(at.join("p.toml")).unwrap();
    let told = "is the pipeline that is run: it cannot be written over";
    for report in ["p.toml", "./p.toml", "link.json"] {
        fails(at, &["run", "p.toml", "--report", report], 2, &["--report: ", told]);
    }
    let output = ["run", "p.toml", "--set", "write.path=p.toml", "--set", "write.format=laz"];
    fails(at, &output, 2, &["p.toml ", told]);
    assert!(fs::read(at.join("p.toml")).unwrap() == before);
    assert_holds(at, &["a.las", "link.json", "p.toml"]);
    done(at, &["run", "p.toml", "--report", "r.json"]);
}

#[test]
fn without_clobbering_nothing_that_exists_is_replaced() {
    let at = scans(&["a.las", "b.las"]);
    let at = at.path();
    pipeline(at, "[run]\nexisting = 'refuse'\n");
    for name in ["out.laz", "r.json"] {
        fs::write(at.join(name), "precious").unwrap();
    }
    fs::create_dir(at.join("all")).unwrap();
    fs::write(at.join("all/b.las"), "precious").unwrap();
    let refused = |arguments: &[&str], told: &str| {
        fails(at, arguments, 1, &[&format!("error: {told}: this file exists"), "help: "]);
        for name in ["out.laz", "r.json", "all/b.las"] {
            assert_eq!(fs::read(at.join(name)).unwrap(), b"precious", "{arguments:?}");
        }
        // The first conversion has not begun.
        assert_holds(&at.join("all"), &["b.las"]);
        assert_holds(at, &["a.las", "all", "b.las", "out.laz", "p.toml", "r.json"]);
    };
    for command in ["convert", "reduce"] {
        refused(&[command, "a.las", "-o", "out.laz", "--no-clobber"], "out.laz");
        let report = ["--report", "r.json", "--no-clobber"];
        refused(&[&[command, "a.las", "-o", "new.laz"], &report[..]].concat(), "r.json");
    }
    refused(&["convert", "a.las", "b.las", "-o", "all", "--no-clobber"], "all/b.las");
    refused(&["reduce", "a.las", "b.las", "--outdir", "all", "--no-clobber"], "all/b.las");
    refused(&["synth", "part", "-n", "100", "-o", "out.laz", "--no-clobber"], "out.laz");
    refused(&["run", "p.toml"], "out.laz");
    refused(&["check", "p.toml"], "out.laz");
    // What is new appears, and a setting can be taken back.
    done(at, &["convert", "a.las", "-o", "new.laz", "--no-clobber", "--report", "n.json"]);
    done(at, &["run", "p.toml", "--set", "run.existing=replace"]);
    assert_holds(
        at,
        &["a.las", "all", "b.las", "n.json", "new.laz", "out.laz", "p.toml", "r.json"],
    );
}

#[test]
fn an_output_that_is_replaced_keeps_its_permissions() {
    let at = scans(&["a.las"]);
    let at = at.path();
    let mode = |name: &str| fs::metadata(at.join(name)).unwrap().permissions().mode() & 0o777;
    let usual = mode("a.las");
    done(at, &["convert", "a.las", "-o", "out.laz", "--report", "r.json"]);
    assert_eq!((mode("out.laz"), mode("r.json")), (usual, usual), "although scratch is private");
    for name in ["out.laz", "r.json"] {
        fs::set_permissions(at.join(name), fs::Permissions::from_mode(0o604)).unwrap();
    }
    done(at, &["convert", "a.las", "-o", "out.laz", "--report", "r.json"]);
    assert_eq!((mode("out.laz"), mode("r.json")), (0o604, 0o604));
}

#[test]
fn a_folder_as_output_of_one_file_is_told_with_what_to_type() {
    let at = scans(&["a.las"]);
    let at = at.path();
    fs::create_dir(at.join("there")).unwrap();
    for folder in ["there", "there/", "none/"] {
        let name = format!("`{}/out.laz`", folder.trim_end_matches('/'));
        let told = format!("-o: `{folder}` is a folder, not a file to write");
        let (code, _, stderr) = pointmill(at, &["reduce", "a.las", "-o", folder]);
        assert_eq!(code, 2, "{stderr}");
        assert!(stderr.contains(&told) && stderr.contains(&name), "{stderr}");
    }
    let help = "create it first, such as by `mkdir -p none/deep`";
    fails(
        at,
        &["reduce", "a.las", "-o", "none/deep/x.laz"],
        1,
        &["none/deep: the folder does", help],
    );
    assert_holds(at, &["a.las", "there"]);
}
