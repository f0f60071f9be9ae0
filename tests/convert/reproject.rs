//! Points that are brought to another reference system as they are read. What is right is what PROJ
//! says; `tests/interop/reproject.py` asks it for more.

use std::path::Path;

use serde_json::{Value, json};

use crate::support::command::{done, fails, info, pointmill};

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
    let far = ["in.las", "-o", "c.las", "--reproject", "EPSG:4258", "--scale", "1e-10,1e-10,0.01"];
    let far = [&["convert"], &far[..], &["--offset", "0,0,0"]].concat();
    fails(at, &far, 1, &["in.las", "too far from the offset", "--scale", "--offset"]);
    // One number is that of all axes, and each has an offset from which it reaches.
    let (scale, first) = run("e.las", &["--scale", "1e-7"]);
    assert_eq!(scale, json!([1e-7, 1e-7, 1e-7]));
    near(&first, &[DEGREES[0], DEGREES[1], 520.12], 1.1e-7);
    // A step of a map is none of degrees.
    let run = ["in.las", "-o", "d.las", "--reproject", "EPSG:4258", "--scale", "0.001"];
    let (code, _, told) = pointmill(at, &[&["convert"], &run[..]].concat());
    assert!(code == 0 && told.contains("steps of 0.001, which are 111 m on the ground"), "{told}");
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
    let unit = ["the unit of heights is", "EPSG:2277+6360"];
    fails(at, &run("EPSG:2277", "EPSG:26914"), 2, &unit);
    fails(at, &run("EPSG:2277+6360", "EPSG:26914+3855"), 2, &["a grid", "keeps those"]);
    fails(at, &run("EPSG:2277+6360", "EPSG:4979"), 2, &["a grid"]);
    fails(at, &run("EPSG:26914", "EPSG:26914+5703"), 2, &["do not say which heights"]);
    // A unit of heights without a system, as GeoTIFF keys have it, is no hindrance.
    let wkt = "PROJCS[\"a\",GEOGCS[\"NAD83\",DATUM[\"North_American_Datum_1983\",SPHEROID[\
               \"GRS 1980\",6378137,298.257222101]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",\
               0.0174532925199433],AUTHORITY[\"EPSG\",\"4269\"]],UNIT[\"metre\",1],AUTHORITY[\
               \"EPSG\",\"26914\"]]";
    let unit = |unit: &str| {
        let up = format!("VERT_CS[\"unknown\",VERT_DATUM[\"unknown\",2005],UNIT[{unit}]]");
        let crs = format!("COMPD_CS[\"b\",{wkt},{up}]");
        ["--crs", &crs, "--reproject", "EPSG:26915", "--quiet"].map(str::to_owned)
    };
    std::fs::write(at.join("u.xyz"), "600000 3400000 100\n").unwrap();
    let make = |unit: &[String]| {
        let unit: Vec<&str> = unit.iter().map(String::as_str).collect();
        pointmill(at, &[&["convert", "u.xyz", "-o", "u.csv"], &unit[..]].concat())
    };
    let (code, _, told) = make(&unit("\"metre\",1"));
    assert_eq!(code, 0, "{told}");
    let (code, _, told) = make(&unit("\"foot\",0.3048"));
    assert!(code == 2 && told.contains("the unit of heights is 0.3048 m"), "{told}");
    let ellipsoid = ["the unit of heights", "in metres, or in degrees"];
    std::fs::write(at.join("in.xyz"), "-98 30.5 100\n").unwrap();
    fails(at, &run("EPSG:4979", "EPSG:2277"), 2, &ellipsoid);
    // Nothing would say that heights are metres still.
    fails(at, &run("EPSG:26914", "EPSG:2277"), 2, &["the unit of heights is"]);
}

#[test]
fn heights_of_las_have_steps_of_their_own() {
    let at = folder([-98.0, 30.5, 1000.25]);
    let at = at.path();
    let las = |from: &str, to: &str| {
        let make = ["in.xyz", "-o", "in.las", "--scale", "1e-7,1e-7,0.01", "--crs", from];
        done(at, &[&["convert"], &make[..], &["--quiet"]].concat());
        done(at, &["convert", "in.las", "-o", "out.las", "--reproject", to, "--quiet"]);
        (info(at, "out.las")["scale"].clone(), rows(at, "out.las").remove(0))
    };
    let (scale, first) = las("EPSG:4269+6360", "EPSG:26914+5703");
    assert_eq!(scale, json!([0.01, 0.01, 0.001]));
    near(&first[2..3], &[1000.25 * 1200.0 / 3937.0], 5.01e-4);
    let (scale, first) = las("EPSG:4269+6360", "EPSG:26914");
    assert_eq!((scale, first[2]), (json!([0.01, 0.01, 0.01]), 1000.25));
    assert!(is_in(at, "out.las", &[26914, 6360]));
    let (scale, first) = las("EPSG:4979", "EPSG:4978");
    assert_eq!(scale, json!([0.01, 0.01, 0.01]));
    let far = first[..3].iter().map(|v| v * v).sum::<f64>().sqrt();
    assert!((6_370_000.0..6_380_000.0).contains(&far), "{first:?}");
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
    fails(at, &from("EPSG:4326", "EPSG:3857"), 1, &["in.xyz", "the point at 9, 95, 1"]);
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

#[test]
fn several_inputs_are_one_whatever_their_scales_and_their_order() {
    let at = folder(HERE);
    let at = at.path();
    let las = |out: &str, scale: &str, offset: &str| {
        let make = ["convert", "in.xyz", "-o", out, "--scale", scale, "--offset", offset];
        done(at, &[&make[..], &["--crs", "EPSG:25832", "--quiet"]].concat());
    };
    las("a.las", "0.001", "690000,5335000,0");
    las("b.las", "0.01", "691000.005,5335000,100");
    let run = |first: &str, second: &str| {
        let run = ["convert", first, second, "-o", "ab.laz", "--reproject", "EPSG:31468"];
        let (code, _, told) = pointmill(at, &[&run[..], &["--no-provenance"]].concat());
        assert!(code == 0 && told.contains("by `DHDN to ETRS89"), "{told}");
        let mut points = rows(at, "ab.laz");
        points.sort_by(|a, b| a.partial_cmp(b).unwrap());
        (info(at, "ab.laz")["scale"].clone(), points)
    };
    let both = run("a.las", "b.las");
    assert_eq!(both.0, json!([0.001, 0.001, 0.001]));
    assert_eq!((both.1.len(), &both), (200, &run("b.las", "a.las")));
    // Two stages that read in one way are one, others are refused.
    let merged = |second: &str| {
        let text = format!(
            "[[stage]]\nkind = 'read'\nname = 'a'\npath = 'a.las'\nreproject = 'EPSG:31468'\n\
             [[stage]]\nkind = 'read'\nname = 'b'\npath = 'b.las'\n{second}\n\
             [[stage]]\nkind = 'merge'\nfrom = ['a', 'b']\n\
             [[stage]]\nkind = 'write'\npath = 'm.laz'\n"
        );
        std::fs::write(at.join("m.toml"), text).unwrap();
    };
    merged("reproject = 'EPSG:31468'");
    done(at, &["run", "m.toml", "--quiet"]);
    assert_eq!(rows(at, "m.laz").len(), 200);
    merged("");
    fails(at, &["run", "m.toml"], 2, &["read in one way", "the same keys"]);
}

#[test]
fn a_box_that_is_wrong_misleads_nobody() {
    let at = folder(HERE);
    let at = at.path();
    let las = ["in.xyz", "-o", "in.las", "--scale", "0.001", "--offset", "690000,5335000,0"];
    done(at, &[&["convert"], &las[..], &["--crs", "EPSG:25832", "--quiet"]].concat());
    let mut bytes = std::fs::read(at.join("in.las")).unwrap();
    // The largest and the smallest x, y and z (LAS 1.4 R15, section 2.4).
    bytes[179..227].fill(0);
    std::fs::write(at.join("odd.las"), bytes).unwrap();
    for (scan, out) in [("in.las", "a.las"), ("odd.las", "b.las")] {
        let run = ["convert", scan, "-o", out, "--reproject", "EPSG:31468", "--no-provenance"];
        done(at, &[&run[..], &["--headers", "warn", "--quiet"]].concat());
    }
    assert_eq!(rows(at, "a.las"), rows(at, "b.las"));
    assert_eq!(info(at, "b.las")["scale"], json!([0.001, 0.001, 0.001]));
    // Beside a right one, in either order.
    let both = |first: &str, second: &str| {
        let run = ["convert", first, second, "-o", "ab.las", "--reproject", "EPSG:31468"];
        done(at, &[&run[..], &["--headers", "warn", "--quiet"]].concat());
        let mut points = rows(at, "ab.las");
        points.sort_by(|a, b| a.partial_cmp(b).unwrap());
        (info(at, "ab.las")["scale"].clone(), points)
    };
    let one = both("in.las", "odd.las");
    assert_eq!((&one.0, &one), (&json!([0.001, 0.001, 0.001]), &both("odd.las", "in.las")));
}

#[test]
fn a_reduction_and_copc_are_made_in_the_other_system() {
    let at = folder(HERE);
    let at = at.path();
    let las = ["in.xyz", "-o", "in.las", "--scale", "0.001", "--offset", "690000,5335000,0"];
    done(at, &[&["convert"], &las[..], &["--crs", "EPSG:25832", "--quiet"]].concat());
    let run = ["convert", "in.las", "-o", "o.copc.laz", "--reproject", "EPSG:25833", "--quiet"];
    done(at, &run);
    done(at, &["validate", "o.copc.laz"]);
    assert!(is_in(at, "o.copc.laz", &[25833]));
    let run = ["reduce", "in.las", "-o", "r.laz", "--keep", "50%", "--reproject", "EPSG:25833"];
    done(at, &[&run[..], &["--quiet"]].concat());
    assert_eq!(rows(at, "r.laz").len(), 50);
    near(&rows(at, "r.laz")[0], &ZONE_33, 110.0);
    done(at, &["reproduce", "r.laz", "--quiet"]);
    // A box is in the coordinates of the inputs.
    let run = ["in.las", "-o", "b.las", "--reproject", "EPSG:25833", "--quiet", "--box"];
    done(at, &[&["convert"], &run[..], &["691000,5335000,691010,5336000"]].concat());
    assert_eq!(rows(at, "b.las").len(), 10);
}
