//! Inputs that differ, brought to one form in the run that reads them.

use std::path::Path;

use crate::support::case_file;
use crate::support::command::{done, fails, info, pointmill};

/// Copies of these files of `tests/cases` in a folder.
fn inputs(names: &[&str]) -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    for name in names {
        std::fs::copy(case_file(name), at.path().join(name)).unwrap();
    }
    at
}

/// The scan as a text.
fn text(at: &Path, scan: &str) -> String {
    done(at, &["convert", scan, "-o", "told.csv", "--quiet"]);
    std::fs::read_to_string(at.join("told.csv")).unwrap()
}

/// The points of both as texts, whose columns are the same, in the order of the inputs.
fn both(at: &Path, first: &str, second: &str) -> String {
    let (one, two) = (text(at, first), text(at, second));
    let (head, points) = two.split_once('\n').unwrap();
    assert_eq!(one.lines().next(), Some(head));
    one + points
}

#[test]
fn scales_and_offsets_become_one_and_lose_nothing_where_it_is_fine_enough() {
    for other in ["23c.las", "23e.las"] {
        let at = inputs(&["23a.las", other]);
        let at = at.path();
        let told = if other == "23c.las" { "--offset 0.0,0.0,0.0" } else { "--scale 0.001" };
        fails(at, &["convert", "23a.las", other, "-o", "out.las"], 1, &["23a.las", other, told]);
        let run = ["convert", "23a.las", other, "-o", "out.las", "--scale", "0.001", "--quiet"];
        done(at, &run);
        let all = info(at, "out.las");
        assert_eq!(all["scale"], serde_json::json!([0.001, 0.001, 0.001]));
        let numbers = |text: &str| -> Vec<Vec<f64>> {
            let rows = text.lines().skip(1);
            rows.map(|row| row.split(',').map(|v| v.parse().unwrap()).collect()).collect()
        };
        let (merged, apart) = (numbers(&text(at, "out.las")), numbers(&both(at, "23a.las", other)));
        assert_eq!(merged.len(), 10);
        let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-9;
        for (merged, apart) in merged.iter().zip(&apart) {
            assert!(merged.iter().zip(apart).all(near), "{merged:?} {apart:?}");
        }
    }
}

#[test]
fn coordinates_that_one_scale_rounds_are_told_and_the_order_of_inputs_changes_no_point() {
    let at = inputs(&["23a.las", "23c.las"]);
    let at = at.path();
    let run = |first, second, out| {
        let all = ["reduce", first, second, "-o", out, "--keep", "100%", "--no-provenance"];
        let offset = ["--offset", "0,0,0"];
        let (code, _, told) = pointmill(at, &[&all[..], &offset[..]].concat());
        assert_eq!(code, 0, "{told}");
        assert!(told.contains("23c.las: coordinates were rounded"), "{told}");
        std::fs::read(at.join(out)).unwrap()
    };
    assert!(run("23a.las", "23c.las", "a.las") == run("23c.las", "23a.las", "b.las"));
}

#[test]
fn point_formats_become_one_that_has_the_fields_of_both() {
    let at = inputs(&["23a.las", "23f.las"]);
    let at = at.path();
    let names = ["23a.las", "23f.las"];
    fails(at, &[&["convert"], &names[..], &["-o", "o.laz"]].concat(), 1, &["--point-format 3"]);
    let one = |arguments: &[&'static str]| [&["convert"], &names[..], arguments].concat();
    done(at, &one(&["-o", "o.laz", "--point-format", "3", "--quiet"]));
    let all = info(at, "o.laz");
    assert_eq!((all["point_format"].as_u64(), all["points"].as_u64()), (Some(3), Some(10)));
    let parts = ["convert", "23a.las", "-o", "a.las", "--point-format", "3", "--quiet"];
    done(at, &parts);
    assert_eq!(text(at, "o.laz"), both(at, "a.las", "23f.las"));
    fails(at, &one(&["-o", "o.laz", "--point-format", "1"]), 2, &["23f.las", "cannot hold"]);
    // In a folder each input has its own file, in the form of all.
    std::fs::write(
        at.join("p.toml"),
        "[[stage]]\nkind = 'read'\npath = ['23a.las', '23f.las']\npoint_format = 3\n\
         [[stage]]\nkind = 'write'\nfolder = 'each'\n",
    )
    .unwrap();
    done(at, &["run", "p.toml", "--quiet"]);
    assert_eq!(text(at, "each/23a.las"), text(at, "a.las"));
    assert_eq!(text(at, "each/23f.las"), text(at, "23f.las"));
}

#[test]
fn what_inputs_share_is_left_as_it_is() {
    let at = inputs(&["23a.las"]);
    let at = at.path();
    std::fs::copy(at.join("23a.las"), at.join("b.las")).unwrap();
    std::fs::write(
        at.join("p.toml"),
        "[[stage]]\nkind = 'read'\npath = ['23a.las', 'b.las']\nscale = 0.5\npoint_format = 8\n\
         [[stage]]\nkind = 'write'\npath = 'out.las'\n",
    )
    .unwrap();
    done(at, &["run", "p.toml", "--quiet"]);
    let (one, all) = (info(at, "23a.las"), info(at, "out.las"));
    assert_eq!((&one["scale"], &one["point_format"]), (&all["scale"], &all["point_format"]));
}

#[test]
fn a_missing_system_is_assumed_and_a_wrong_one_replaced() {
    let [none, wkt, keys] = ["100a-nocrs.las", "100b-wkt.las", "100e-geokey.las"];
    let at = inputs(&[none, wkt, keys]);
    let at = at.path();
    fails(at, &["convert", none, wkt, "-o", "o.las"], 1, &["none", "--assume crs", "--crs"]);
    let run = |inputs: &[&str], more: &[&str]| {
        let out = ["-o", "o.las", "--quiet", "--no-provenance"];
        done(at, &[&["convert"], inputs, &out[..], more].concat());
        info(at, "o.las")["crs"].as_str().unwrap().to_owned()
    };
    let named = info(at, wkt)["crs"].as_str().unwrap().to_owned();
    for order in [[none, wkt, keys], [keys, none, wkt], [wkt, keys, none]] {
        assert_eq!(run(&order, &["--assume", "crs"]), named, "{order:?}");
    }
    // Point format 6 names its system by WKT.
    let code = |text: &str| format!("AUTHORITY[\"EPSG\",\"{text}\"]]");
    assert!(run(&[none, keys], &["--assume", "crs"]).ends_with(&code("25832")));
    assert!(run(&[none, wkt, keys], &["--crs", "epsg:2154"]).ends_with(&code("2154")));
    assert_eq!(run(&[wkt], &["--crs", &named]), named);
    let wrong = ["convert", wkt, "-o", "o.las", "--crs", "UTM32"];
    fails(at, &wrong, 2, &["--crs: ", "EPSG:25832+7837", "| UTM32"]);
    fails(
        at,
        &["convert", wkt, "-o", "o.las", "--assume", "all"],
        2,
        &["--assume: cannot be `all`", "valid: crs"],
    );
    // It is what a text of coordinates is said to be in, too.
    done(at, &["convert", none, "-o", "o.xyz", "--quiet"]);
    done(at, &["convert", "o.xyz", "-o", "o.ply", "--crs", "EPSG:25832+7837", "--quiet"]);
    assert!({
        let bytes = std::fs::read(at.join("o.ply")).unwrap();
        String::from_utf8_lossy(&bytes).contains("crs: EPSG:25832+7837")
    });
    done(at, &["convert", "o.ply", "-o", "p.laz", "--scale", "0.01", "--quiet"]);
    let both = info(at, "p.laz")["crs"].as_str().unwrap().to_owned();
    assert!(both.contains(&code("25832")) && both.contains(&code("7837")), "{both}");
}

#[test]
fn ply_files_of_other_types_encodings_and_orders_are_one() {
    let at = inputs(&["152a.ply", "152b.ply"]);
    let at = at.path();
    done(at, &["convert", "152a.ply", "152b.ply", "-o", "o.ply", "--quiet"]);
    let (merged, one) = (text(at, "o.ply"), text(at, "152a.ply"));
    assert_eq!(merged.lines().count(), one.lines().count() + 2);
    assert!(merged.starts_with(&one) && info(at, "o.ply")["encoding"] == "ascii");
    let write = |name: &str, kind: &str, properties: &str, body: &[u8]| {
        let head = format!("ply\nformat {kind} 1.0\nelement vertex 1\n{properties}end_header\n");
        std::fs::write(at.join(name), [head.as_bytes(), body].concat()).unwrap();
    };
    let floats = "property float x\nproperty float y\nproperty float z\n";
    let text_of = format!("{floats}property uchar tag\n");
    write("a.ply", "ascii", &text_of, b"0.1 0.2 0.3 200\n");
    let mut body = 40_000u16.to_be_bytes().to_vec();
    [1.5f64, -2.5, 3.25].iter().for_each(|v| body.extend(v.to_be_bytes()));
    let doubles = floats.replace("float", "double");
    write("b.ply", "binary_big_endian", &format!("property ushort tag\n{doubles}"), &body);
    done(at, &["convert", "a.ply", "b.ply", "-o", "ab.ply", "--quiet", "--no-provenance"]);
    let all = text(at, "ab.ply");
    let points: Vec<&str> = all.lines().skip(1).collect();
    let float = f64::from(0.1f32);
    assert!(points[0].starts_with("0.1,0.2,0.3,200") || points[0].starts_with(&float.to_string()));
    assert_eq!(points[1], "1.5,-2.5,3.25,40000");
    assert_eq!(info(at, "ab.ply")["encoding"], "binary_little_endian");
    // Of numbers that no type holds together none is changed.
    write("c.ply", "ascii", &text_of.replace("uchar", "int64"), b"0 0 0 9007199254740993\n");
    write("d.ply", "ascii", &text_of.replace("uchar", "float"), b"0 0 0 0.5\n");
    fails(at, &["convert", "c.ply", "d.ply", "-o", "o.ply"], 1, &["no type holds", "`tag`"]);
    write("e.ply", "ascii", &format!("{text_of}property uchar more\n"), b"0 0 0 1 1\n");
    fails(at, &["convert", "a.ply", "e.ply", "-o", "o.ply"], 1, &["vertex properties"]);
}

#[test]
fn las_1_5_is_read_and_its_outputs_are_las_1_4_of_the_same_meaning() {
    let at = inputs(&["103-las15.las"]);
    let at = at.path();
    done(at, &["convert", "103-las15.las", "-o", "o.las", "--quiet", "--no-provenance"]);
    let (old, new) = (info(at, "103-las15.las"), info(at, "o.las"));
    assert_eq!((&old["version"], &new["version"]), (&"1.5".into(), &"1.4".into()));
    for key in ["points", "point_format", "gps_time", "scale", "min", "max"] {
        assert_eq!(old[key], new[key], "{key}");
    }
    assert_eq!(new["gps_time"], "adjusted standard GPS time");
    let whole = std::fs::read(at.join("103-las15.las")).unwrap();
    let written = std::fs::read(at.join("o.las")).unwrap();
    let points = 100 * 30;
    assert!(written[written.len() - points..] == whole[whole.len() - points..]);
    assert_eq!(u16::from_le_bytes([written[94], written[95]]), 375);
    assert_eq!(u16::from_le_bytes([written[6], written[7]]) & 0b100_0001, 1);
    // Twice the same is one scan; another offset of times has no meaning in LAS 1.4.
    std::fs::copy(at.join("103-las15.las"), at.join("b.las")).unwrap();
    done(at, &["convert", "103-las15.las", "b.las", "-o", "two.laz", "--quiet"]);
    assert_eq!(info(at, "two.laz")["points"], 200);
    let mut other = whole;
    other[391..393].copy_from_slice(&1_400u16.to_le_bytes());
    std::fs::write(at.join("c.las"), &other).unwrap();
    fails(at, &["convert", "c.las", "-o", "o.las"], 1, &["byte 391", "1400 million seconds"]);
    other.truncate(380);
    std::fs::write(at.join("c.las"), &other).unwrap();
    fails(at, &["convert", "c.las", "-o", "o.las"], 1, &["c.las", "header"]);
}

/// What a record of the formats with waveforms says of its own.
const WAVES: &str = "WavePacketDescriptorIndex,WavePacketByteOffset,WavePacketSize,\
                     WaveReturnPoint,WaveXt,WaveYt,WaveZt";

#[test]
fn gps_times_of_two_kinds_are_told_apart_and_go_together_without_times() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    for (format, timeless, drop) in [
        ("1", "0", "GpsTime".to_owned()),
        ("3", "2", "GpsTime".to_owned()),
        ("4", "0", format!("GpsTime,{WAVES}")),
        ("5", "2", format!("GpsTime,{WAVES}")),
        ("6", "0", "Overlap,ScannerChannel,GpsTime".to_owned()),
        ("7", "2", "Overlap,ScannerChannel,GpsTime".to_owned()),
        ("8", "2", "Overlap,ScannerChannel,GpsTime,Nir".to_owned()),
        ("9", "0", format!("Overlap,ScannerChannel,GpsTime,{WAVES}")),
        ("10", "2", format!("Overlap,ScannerChannel,GpsTime,Nir,{WAVES}")),
    ] {
        let colors = if timeless == "2" { [",Red,Green,Blue", ",1,2,3"] } else { [""; 2] };
        for (name, x) in [("week.las", 1), ("standard.las", 2)] {
            let [head, values] = colors;
            let csv = format!("X,Y,Z,GpsTime{head}\n{x},2,3,100{values}\n");
            std::fs::write(at.join("t.csv"), csv).unwrap();
            let more = ["--scale", "0.01", "--point-format", format, "--quiet"];
            done(at, &[&["convert", "t.csv", "-o", name], &more[..]].concat());
        }
        let mut bytes = std::fs::read(at.join("standard.las")).unwrap();
        bytes[6] |= 1; // The bit of the global encoding that says of which kind times are.
        std::fs::write(at.join("standard.las"), bytes).unwrap();
        let remedy = format!("--point-format {timeless}");
        let told = [
            "week.las has GPS week time, seconds since Sunday",
            "standard.las has adjusted standard GPS time, seconds since 1980 less 1e9",
            &remedy,
            &format!("--drop {drop}"),
        ];
        let merge = ["convert", "week.las", "standard.las", "-o", "o.las"];
        fails(at, &merge, 1, &told);
        let (_, _, told) = pointmill(at, &merge);
        assert_eq!(told.contains("classes above 31"), format.len() > 1 || format > "5", "{told}");
        // As it says.
        for name in ["week", "standard"] {
            let (from, to) = (format!("{name}.las"), format!("{name}-0.las"));
            let more = ["--point-format", timeless, "--drop", &drop, "--quiet"];
            done(at, &[&["convert", &from, "-o", &to], &more[..]].concat());
        }
        done(at, &["convert", "week-0.las", "standard-0.las", "-o", "o.las", "--quiet"]);
        let all = text(at, "o.las");
        let mut lines = all.lines();
        assert!(!lines.next().unwrap().contains("GpsTime"), "{all}");
        for begins in ["1.00,2.00,3.00,", "2.00,2.00,3.00,"] {
            assert!(lines.next().unwrap().starts_with(begins), "{all}");
        }
    }
}

#[test]
fn values_that_no_format_without_times_holds_go_together_by_way_of_ply() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    for (format, drop) in [
        ("6", "GpsTime".to_owned()),
        ("7", "GpsTime".to_owned()),
        ("8", "GpsTime".to_owned()),
        ("9", format!("GpsTime,{WAVES}")),
        ("10", format!("GpsTime,{WAVES}")),
    ] {
        let has_nir = matches!(format, "8" | "10");
        let [head, value] = if has_nir { [",Nir", ",40000"] } else { ["", ""] };
        for (name, x) in [("week.las", 1), ("standard.las", 2)] {
            let csv = format!(
                "X,Y,Z,GpsTime,Classification,ReturnNumber,ScanAngle{head}\n\
                 {x},2,3,100,64,9,12.498{value}\n"
            );
            std::fs::write(at.join("t.csv"), csv).unwrap();
            let more = ["--scale", "0.01", "--point-format", format, "--quiet"];
            done(at, &[&["convert", "t.csv", "-o", name], &more[..]].concat());
        }
        let mut bytes = std::fs::read(at.join("standard.las")).unwrap();
        bytes[6] |= 1;
        std::fs::write(at.join("standard.las"), bytes).unwrap();
        let told = ["convert each file to PLY", &format!("--drop {drop}`, and these PLY files")];
        fails(at, &["convert", "week.las", "standard.las", "-o", "o.las"], 1, &told);
        for name in ["week", "standard"] {
            let (from, to) = (format!("{name}.las"), format!("{name}.ply"));
            done(at, &["convert", &from, "-o", &to, "--drop", &drop, "--quiet"]);
        }
        let merge = ["convert", "week.ply", "standard.ply", "-o", "o.las", "--scale", "0.01"];
        done(at, &[&merge[..], &["--quiet"]].concat());
        let of = |scan: &str| text(at, scan).lines().map(str::to_owned).collect::<Vec<_>>();
        let all = of("o.las");
        let names: Vec<&str> = all[0].split(',').collect();
        for (line, x) in all[1..].iter().zip(["1.00", "2.00"]) {
            let values: Vec<&str> = line.split(',').collect();
            let value = |name: &str| values[names.iter().position(|n| *n == name).unwrap()];
            let found = ["X", "Classification", "ReturnNumber", "ScanAngle"].map(value);
            assert_eq!(found, [x, "64", "9", "12.498"], "{format}");
            assert!(!has_nir || value("Nir") == "40000", "{format}");
        }
        assert_eq!(all.len(), 3);
    }
}

#[test]
fn inputs_that_differ_become_one_that_is_not_las_or_has_less() {
    let at = inputs(&["23a.las", "23f.las"]);
    let at = at.path();
    let run = |out: &str, more: &[&str]| {
        done(at, &[&["convert", "23a.las", "23f.las", "-o", out, "--quiet"], more].concat());
        text(at, out)
    };
    let ply = run("o.ply", &["--point-format", "3"]);
    assert_eq!(ply.lines().count(), 11);
    // A reduction takes them, too.
    let reduced = |out: &str| {
        let run = ["reduce", "23a.las", "23f.las", "-o", out, "--keep", "100%", "--quiet"];
        done(at, &[&run[..], &["--point-format", "3"]].concat());
        text(at, out).lines().count()
    };
    assert_eq!(reduced("r.ply"), reduced("r.las"));
    // What the smaller format lacks is dropped from what has the fields of both.
    let less = run("o.las", &["--point-format", "0", "--drop", "GpsTime,Red,Green,Blue"]);
    assert_eq!((less.lines().count(), less.contains("GpsTime")), (11, false));
    assert_eq!(info(at, "o.las")["point_format"], 0);
}
