//! Points that are brought to another reference system as they are read. What is right is what PROJ
//! says; `tests/interop/reproject.py` asks it for more.

use std::path::Path;

use serde_json::{Value, json};

use crate::support::command::{done, fails, pointmill};

/// A place in Munich in zone 32 of ETRS89, and by PROJ in zone 33 and in degrees.
const HERE: [f64; 3] = [691_000.25, 5_335_000.5, 520.125];
const ZONE_33: [f64; 2] = [244_659.243_023_474, 5_337_511.882_520_462];
const DEGREES: [f64; 2] = [11.567_504_810_571_803, 48.139_562_768_787_876];

/// A folder with a text of points near each other, from the place on.
fn folder(place: [f64; 3]) -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    let [x, y, z] = place;
    let apart = if x.abs() > 180.0 { 1.0 } else { 1e-5 };
    let rows = (0..100).map(|i| format!("{} {y} {z} {i}\n", x + f64::from(i) * apart));
    let text = format!("x y z intensity\n{}", rows.collect::<String>());
    std::fs::write(at.path().join("in.xyz"), text).unwrap();
    at
}

fn info(at: &Path, scan: &str) -> Value {
    let all: Value = serde_json::from_str(&done(at, &["info", "--json", scan])).unwrap();
    all[0].clone()
}

/// True if a LAS file says that it is in the systems of these EPSG codes.
fn is_in(at: &Path, scan: &str, codes: &[u32]) -> bool {
    let crs = info(at, scan)["crs"].as_str().unwrap().to_owned();
    codes.iter().all(|code| crs.contains(&format!("AUTHORITY[\"EPSG\",\"{code}\"]]")))
}

/// The numbers of the scan as a text has them.
fn rows(at: &Path, scan: &str) -> Vec<Vec<f64>> {
    done(at, &["convert", scan, "-o", "told.csv", "--quiet"]);
    let text = std::fs::read_to_string(at.join("told.csv")).unwrap();
    let number = |text: &str| text.parse().unwrap();
    text.lines().skip(1).map(|row| row.split(',').map(number).collect()).collect()
}

/// What stands before the points of a PLY file.
fn head(at: &Path, scan: &str) -> String {
    let bytes = std::fs::read(at.join(scan)).unwrap();
    String::from_utf8_lossy(&bytes).split("end_header").next().unwrap().to_owned()
}

fn near(row: &[f64], wanted: &[f64], off: f64) {
    let is_near = row.iter().zip(wanted).all(|(one, two)| (one - two).abs() <= off);
    assert!(is_near, "{row:?} for {wanted:?}");
}

#[test]
fn one_datum_loses_nothing_and_tells_nothing() {
    let at = folder(HERE);
    let at = at.path();
    let las = ["in.xyz", "-o", "in.laz", "--scale", "0.001", "--offset", "690000,5335000,0"];
    done(at, &[&["convert"], &las[..], &["--crs", "EPSG:25832+7837", "--quiet"]].concat());
    let run = ["in.laz", "-o", "out.laz", "--reproject", "EPSG:25833", "--report", "r.json"];
    let (code, _, told) = pointmill(at, &[&["convert"], &run[..]].concat());
    assert!(code == 0 && !told.contains("warning"), "{told}");
    let (all, first) = (info(at, "out.laz"), rows(at, "out.laz").remove(0));
    near(&first, &[ZONE_33[0], ZONE_33[1], HERE[2]], 5.01e-4);
    // Heights stay, and the file still says whose they are.
    assert!(is_in(at, "out.laz", &[25833, 7837]));
    assert_eq!(all["scale"], json!([0.001, 0.001, 0.001]));
    assert_eq!(all["offset"][2], json!(0.0));
    let report: Value = serde_json::from_slice(&std::fs::read(at.join("r.json")).unwrap()).unwrap();
    let how = &report["run"]["reprojection"];
    assert_eq!((&how["operation"], &how["accuracy"]), (&Value::Null, &json!(0.0)));
    assert_eq!((&how["from"], &how["to"]), (&json!("EPSG:25832+7837"), &json!("EPSG:25833+7837")));
    // Back, each point is within the steps of where it was.
    done(at, &["convert", "out.laz", "-o", "back.laz", "--reproject", "EPSG:25832", "--quiet"]);
    for (back, own) in rows(at, "back.laz").iter().zip(rows(at, "in.laz")) {
        near(back, &own, 1.51e-3);
    }
}

#[test]
fn degrees_have_steps_that_are_no_longer_on_the_ground() {
    let at = folder(HERE);
    let at = at.path();
    let las = ["in.xyz", "-o", "in.las", "--scale", "0.01", "--offset", "690000,5335000,0"];
    done(at, &[&["convert"], &las[..], &["--crs", "EPSG:25832", "--quiet"]].concat());
    let run = |out: &str, more: &[&str]| {
        let run = ["convert", "in.las", "-o", out, "--reproject", "EPSG:4258", "--quiet"];
        done(at, &[&run[..], more].concat());
        (info(at, out)["scale"].clone(), rows(at, out).remove(0))
    };
    let (scale, first) = run("a.las", &[]);
    assert_eq!(scale, json!([1e-8, 1e-8, 0.01]));
    near(&first, &DEGREES, 0.6e-8 + 1e-7);
    let (scale, first) = run("b.las", &["--scale", "1e-10,1e-10,0.01", "--offset", "11.5,48.1,0"]);
    assert_eq!(scale, json!([1e-10, 1e-10, 0.01]));
    // The place was rounded to hundredths of a metre before.
    near(&first, &DEGREES, 1e-7);
    // Too fine for the offset: before the run, as far as headers tell, or with the point.
    let far = ["in.las", "-o", "c.las", "--reproject", "EPSG:4258", "--scale", "1e-10,1e-10,0.01"];
    let far = [&["convert"], &far[..], &["--offset", "0,0,0"]].concat();
    fails(at, &far, 2, &["too far from the offset", "--scale", "--offset"]);
}

#[test]
fn floats_become_doubles_and_keep_their_neighbours() {
    let at = folder([691_000.0, 5_335_000.0, 520.0]);
    let at = at.path();
    let f32s = ["in.xyz", "-o", "in.ply", "--type", "X=f32,Y=f32,Z=f32", "--quiet"];
    done(at, &[&["convert"], &f32s[..], &["--crs", "EPSG:25832"]].concat());
    done(at, &["convert", "in.ply", "-o", "out.ply", "--reproject", "EPSG:25833", "--quiet"]);
    let (rows, own) = (rows(at, "out.ply"), rows(at, "in.ply"));
    let ply = head(at, "out.ply");
    assert_eq!(ply.matches("property double").count(), 3, "{ply}");
    assert!(ply.contains("EPSG:25833") && !ply.contains("EPSG:25832"), "{ply}");
    for (row, own) in rows.iter().zip(&own) {
        assert_eq!(row[2..], own[2..]);
    }
    near(&rows[0], &[ZONE_33[0] - 0.28, ZONE_33[1] - 0.485], 0.02);
}

#[test]
fn between_datums_the_operation_is_told_with_its_accuracy_and_a_better_one() {
    let at = folder([4_468_500.0, 5_333_500.0, 520.0]);
    let at = at.path();
    let run = ["in.xyz", "-o", "out.xyz", "--crs", "EPSG:31468", "--reproject", "EPSG:25832"];
    let (code, _, told) = pointmill(at, &[&["convert"], &run[..]].concat());
    assert_eq!(code, 0, "{told}");
    for part in ["`DHDN to ETRS89 (3)` (EPSG:1778), which is accurate to 1 m", "0.9 m by the grid"]
    {
        assert!(told.contains(part), "{told}");
    }
    near(&rows(at, "out.xyz")[0], &[691_584.447_346_607, 5_334_929.736_682_919, 520.0], 1e-6);
}

#[test]
fn heights_change_their_unit_and_nothing_else() {
    let at = folder([3_100_000.0, 10_070_000.0, 1000.0]);
    let at = at.path();
    let run = |from: &'static str, to: &'static str| {
        vec!["convert", "in.xyz", "-o", "out.csv", "--crs", from, "--reproject", to, "--quiet"]
    };
    done(at, &run("EPSG:2277+6360", "EPSG:26914+5703"));
    let wanted = [616_567.191_618_491, 3_348_982.452_381_561, 304.800_609_601_219];
    near(&rows(at, "out.csv")[0], &wanted, 1e-5);
    let unit = ["unit z is in", "EPSG:2277+6360"];
    fails(at, &run("EPSG:2277", "EPSG:26914"), 2, &unit);
    fails(at, &run("EPSG:2277+6360", "EPSG:26914+3855"), 2, &["a grid", "keeps those"]);
    fails(at, &run("EPSG:2277+6360", "EPSG:4979"), 2, &["a grid"]);
    fails(at, &run("EPSG:26914", "EPSG:26914+5703"), 2, &["do not say which heights"]);
}

#[test]
fn what_is_not_known_is_refused() {
    let at = folder([-100.0, 40.0, 0.0]);
    let at = at.path();
    let from = |crs: &'static str, to: &'static str| {
        vec!["convert", "in.xyz", "-o", "out.xyz", "--crs", crs, "--reproject", to]
    };
    fails(at, &from("EPSG:4267", "EPSG:4269"), 2, &["EPSG:4267 to EPSG:4269", "grid", "PROJ"]);
    // Two datums that are a metre apart at most are two.
    fails(at, &from("EPSG:4269", "EPSG:6318"), 2, &["no operation between their datums"]);
    fails(at, &from("EPSG:31467", "EPSG:25832"), 2, &["--crs"]);
    let none = ["convert", "in.xyz", "-o", "out.xyz", "--reproject", "EPSG:25832"];
    fails(at, &none, 2, &["they name none", "--crs EPSG:25832"]);
    for (to, why) in [("EPSG:1", "is known here"), ("PROJCS[\"a\"]", "by its EPSG code")] {
        fails(at, &from("EPSG:4326", to), 2, &["--reproject", why]);
    }
    assert!(!at.join("out.xyz").exists());
    // A point that is nowhere in the system of the inputs.
    std::fs::write(at.join("in.xyz"), "9 50 1\n9 50.1 1\n9 95 1\n").unwrap();
    fails(at, &from("EPSG:4326", "EPSG:3857"), 2, &["in.xyz", "the point at 9, 95, 1"]);
}

#[test]
fn normals_are_told_and_so_is_the_system_of_files_in_a_folder() {
    let at = folder(HERE);
    let at = at.path();
    let text = "x y z nx ny nz\n691000 5335000 520 0 0 1\n691001 5335000 520 0 0 1\n";
    std::fs::write(at.join("n.xyz"), text).unwrap();
    let las = ["n.xyz", "-o", "n.las", "--scale", "0.001", "--offset", "auto", "--quiet"];
    done(at, &[&["convert"], &las[..], &["--crs", "EPSG:25832"]].concat());
    let run = ["convert", "n.las", "-o", "n.laz", "--reproject", "EPSG:25833"];
    let (code, _, told) = pointmill(at, &run);
    assert!(code == 0 && told.contains("normals are kept as they are"), "{told}");
    assert!(told.contains("north turns by"), "{told}");
    let pipeline = "[[stage]]\nkind = 'read'\npath = ['n.las']\nreproject = 'EPSG:4258'\n\
                    [[stage]]\nkind = 'write'\nfolder = 'each'\n";
    std::fs::write(at.join("p.toml"), pipeline).unwrap();
    done(at, &["run", "p.toml", "--quiet"]);
    assert!(is_in(at, "each/n.las", &[4258]));
    assert_eq!(info(at, "each/n.las")["scale"], json!([1e-9, 1e-9, 0.001]));
}

#[test]
fn a_scan_without_points_is_one_in_the_other_system() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    std::fs::write(at.join("none.csv"), "x,y,z\n").unwrap();
    let run = ["none.csv", "-o", "none.ply", "--crs", "EPSG:31467", "--reproject", "EPSG:25832"];
    done(at, &[&["convert"], &run[..], &["--quiet"]].concat());
    assert!(head(at, "none.ply").contains("EPSG:25832"));
}
