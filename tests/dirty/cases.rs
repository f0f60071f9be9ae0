//! Small files from public reports of other programs, each with what is right for it. The others of
//! `tests/cases` are in the tests of what they are about.

use std::path::Path;

use crate::support::case_file;
use crate::support::command::{done, fails, pointmill};

/// A copy of the case in the folder; its name.
fn case<'a>(at: &Path, name: &'a str) -> &'a str {
    std::fs::copy(case_file(name), at.join(name)).unwrap();
    name
}

/// The lines of points that the case becomes as a text, and what is told.
fn rows(at: &Path, name: &str) -> (Vec<String>, String) {
    let arguments = ["convert", case(at, name), "-o", "rows.csv"];
    let (code, _, told) = pointmill(at, &arguments);
    assert_eq!(code, 0, "{name}: {told}");
    let text = std::fs::read_to_string(at.join("rows.csv")).unwrap();
    (text.lines().skip(1).map(str::to_owned).collect(), told)
}

#[test]
fn noise_of_both_classes_can_be_left_out() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    assert_eq!(rows(at, "105-noise.las").0.len(), 410);
    let drop = ["convert", "105-noise.las", "-o", "b.las", "--quiet", "--drop-classes", "7,18"];
    done(at, &drop);
    assert_eq!(rows_of(at, "b.las"), 400);
}

/// How many points a file has.
fn rows_of(at: &Path, name: &str) -> u64 {
    let told = done(at, &["info", "--json", name]);
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    told[0]["points"].as_u64().unwrap()
}

#[test]
fn a_count_beyond_all_bounds_is_refused_at_once() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let huge = ["convert", case(at, "117-count-huge.ply"), "-o", "b.las", "--scale", "1"];
    fails(at, &huge, 1, &["at byte 151", "claims 9999999999999 vertices", "ends after 2"]);
}

#[test]
fn copies_in_two_files_are_kept_once() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    std::fs::copy(case_file("131a.las"), at.join("131b.las")).unwrap();
    let both = ["reduce", case(at, "131a.las"), "131b.las", "-o", "c.las", "--keep", "100"];
    assert_eq!(pointmill(at, &[&both[..], &["--quiet"]].concat()).0, 0);
    assert_eq!(rows_of(at, "c.las"), 100);
}

#[test]
fn numbers_that_are_none_are_named() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let comma = ["convert", case(at, "36-decimal-comma.ply"), "-o", "b.csv"];
    fails(at, &comma, 1, &["line 8", "`0,5` is no float for property `x`"]);
    let half = ["convert", case(at, "43-half.ply"), "-o", "b.csv"];
    fails(at, &half, 1, &["no property has the type `half`", "float32"]);
}

#[test]
fn points_behind_a_header_of_cr_begin_at_once() {
    let at = tempfile::tempdir().unwrap();
    // The first byte of the first number is that of a line end.
    let (rows, _) = rows(at.path(), "41c-cr-binary-startLF.ply");
    assert_eq!(rows, ["1.4e-44,1,2", "3,4,5"]);
}

#[test]
fn a_plane_along_an_axis_has_exact_normals() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    std::fs::write(
        at.join("normals.toml"),
        format!(
            "stage = [{{kind = 'read', path = '{}'}}, {{kind = 'normals'}}, {{kind = 'write', \
             path = 'b.ply', dimensions = ['NormalX', 'NormalY', 'NormalZ'], encoding = 'ascii'}}]",
            case(at, "72-flat-y.las")
        ),
    )
    .unwrap();
    let (code, _, told) = pointmill(at, &["run", "normals.toml", "--quiet"]);
    assert_eq!(code, 0, "{told}");
    let text = std::fs::read_to_string(at.join("b.ply")).unwrap();
    let body = text.split_once("end_header\n").unwrap().1;
    assert_eq!(body.lines().count(), 100);
    for line in body.lines() {
        let numbers: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
        let [.., x, y, z] = numbers[..] else { panic!("{line}") };
        assert!(x == 0.0 && z == 0.0 && y.abs() == 1.0, "{line}");
    }
}

#[test]
fn laz_whose_table_of_chunks_is_of_no_use_is_read_in_a_row() {
    let at = tempfile::tempdir().unwrap();
    for (name, part) in [
        ("80a-offset-minus1.laz", "no chunk table where it says"),
        ("80e-table-version.laz", "of an unknown version"),
    ] {
        let (rows, told) = rows(at.path(), name);
        assert_eq!(rows.len(), 1200, "{name}");
        assert!(told.contains(part), "{name}: {told}");
    }
}

#[test]
fn withheld_points_that_a_reduction_leaves_out_are_told() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let reduce = ["reduce", case(at, "96-withheld.las"), "-o", "b.las", "--keep", "50%"];
    let (code, table, told) = pointmill(at, &reduce);
    assert_eq!(code, 0, "{told}");
    assert!(table.contains("left out   50 withheld (read)"), "{table}");
    assert!(told.contains("50 of them; `--withheld keep` keeps them"), "{told}");
    assert_eq!(rows_of(at, "b.las"), 25);
}

#[test]
fn scale_and_offset_of_single_precision_are_found() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let to = ["-o", "b.las", "--scale", "auto"];
    // Every coordinate is the same number of single precision again: nothing is rounded.
    done(at, &[&["convert", case(at, "108-float-utm.ply"), "--quiet"], &to[..]].concat());
    let fractions = ["convert", case(at, "51c-floatint-frac.ply"), "--quiet"];
    fails(at, &[&fractions[..], &to].concat(), 1, &["Intensity = 0.5", "--intensity unit"]);
    done(at, &[&fractions[..], &to, &["--intensity", "unit"]].concat());
}
