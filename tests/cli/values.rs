//! Flags that say what becomes of values that a format or the lattice cannot hold.

use crate::support::case_file;
use std::path::Path;

use assert_cmd::Command;

fn pointmill(arguments: &[&str], input: &str, output: &Path) -> assert_cmd::assert::Assert {
    let mut command = Command::cargo_bin("pointmill").unwrap();
    let [first, others @ ..] = arguments else { panic!("no command") };
    command.arg(first).arg(case_file(input)).arg("-o").arg(output).args(others).assert()
}

#[test]
fn convert_drops_points_that_are_not_finite_if_asked() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.las");
    let convert = ["convert", "--scale", "0.001"];
    let refused = pointmill(&convert, "37d-nan-inf.ply", &output).failure();
    let told = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
    assert!(told.contains("nonfinite") && !output.exists(), "{told}");
    let drop = [&convert[..], &["--nonfinite", "drop"]].concat();
    let done = pointmill(&drop, "37d-nan-inf.ply", &output).success();
    let told = String::from_utf8(done.get_output().stdout.clone()).unwrap();
    assert!(told.contains("4 in, 1 out"), "{told}");
}

#[test]
fn reduce_takes_a_lattice() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.ply");
    let refused = pointmill(&["reduce"], "94-ecef-mm.ply", &output).failure();
    let told = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
    assert!(told.contains("lattice"), "{told}");
    pointmill(&["reduce", "--lattice", "1e-6"], "94-ecef-mm.ply", &output).success();
    let done = pointmill(&["reduce"], "93-nano.ply", &output).success();
    let told = String::from_utf8(done.get_output().stderr.clone()).unwrap();
    assert!(told.contains("points of unequal coordinates"), "{told}");
}

#[test]
fn colors_have_as_many_bits_as_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.ply");
    for (bits, kind) in [("auto", "uchar"), ("8bit", "uchar"), ("16bit", "ushort")] {
        let convert = ["convert", "--encoding", "ascii", "--colors", bits];
        pointmill(&convert, "50e-las-rgb16.las", &output).success();
        let text = std::fs::read_to_string(&output).unwrap();
        assert!(text.contains(&format!("property {kind} red")), "{bits}: {text}");
    }
    pointmill(&["convert", "--colors", "9bit"], "50e-las-rgb16.las", &output).failure();
}

#[test]
fn what_has_no_limit_by_default_takes_none_and_lengths_take_every_foot() {
    let folder = tempfile::tempdir().unwrap();
    let output = |name: &str| folder.path().join(name);
    let reduce = |flags: &[&str], name: &str| {
        let command = [&["reduce"], flags].concat();
        pointmill(&command, "100e-geokey.las", &output(name)).success();
        std::fs::read(output(name)).unwrap()
    };
    let plain = reduce(&["--side", "spread"], "plain.las");
    assert_eq!(reduce(&["--max-side", "none"], "none.las"), plain);
    // The header tells what was typed; the records are the same.
    let records = |file: Vec<u8>| {
        let start = u32::from_le_bytes(file[96..100].try_into().unwrap()) as usize;
        file[start..].to_vec()
    };
    let side = records(reduce(&["--side", "1us-ft"], "feet.las"));
    assert!(!side.is_empty());
    assert_eq!(records(reduce(&["--side", "304.8006096mm"], "metres.las")), side);
}

#[test]
fn figures_have_as_many_digits_as_were_measured() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.las");
    let refused = pointmill(&["reduce"], "15c-geokeys-epsg-only-2277-5703.las", &output).failure();
    let told = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
    assert!(told.contains("measures with z times 3.280833333, or"), "{told}");
}

#[test]
fn lengths_that_no_scan_has_are_refused_and_the_longest_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.las");
    let case = "100e-geokey.las";
    for flag in ["--side", "--max-side", "--min-spacing"] {
        for (length, shown) in [("1e308", "1e308"), ("4.7e16", "4.7e16"), ("9e300km", "9e303")] {
            let command = ["reduce", flag, length];
            let refused = pointmill(&command, case, &output).code(2);
            let told = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
            let expected = format!(
                "error: `{flag} {shown}` is longer than any scan in steps of 0.01\n\
                 help: give 4.59e16 or less\n"
            );
            assert_eq!(told, expected);
        }
    }
    pointmill(&["reduce", "--side", "4.59e16"], case, &output).success();
}

#[test]
fn scales_that_no_offset_helps_are_told_to_be_larger() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.las");
    let help = |scale: &str| {
        let refused = pointmill(&["convert", "--scale", scale], "108-float-utm.ply", &output);
        let told = String::from_utf8(refused.failure().get_output().stderr.clone()).unwrap();
        told.lines().find(|line| line.starts_with("help: ")).unwrap().to_owned()
    };
    let near = help("1e-6");
    assert!(near.starts_with("help: give an offset near the points, `--offset "), "{near}");
    // It helps.
    let offset = near.split(['`', ' ']).find(|word| word.contains(',') && word.len() > 9).unwrap();
    pointmill(&["convert", "--scale", "1e-6", "--offset", offset], "108-float-utm.ply", &output)
        .success();
    // What is in reach of a finer scale is no thousand.
    let near = help("1e-8");
    assert!(near.contains("`--offset 350000.0,5600000.0,100.0`"), "{near}");
    let larger = "help: give a larger `--scale`: with this one coordinates reach ";
    assert_eq!(help("1e-12"), format!("{larger}0.00215 from the offset, and no farther"));
}
