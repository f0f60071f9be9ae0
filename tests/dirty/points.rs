//! Points that cannot be placed, scans of no point, one, or one place, and units that do not match.

use std::fs;

use crate::support::assert_holds;
use crate::support::case::{Case, REDUCE, execute};
use crate::support::las_file::{Beside, LasFile, STRIDES};
use crate::support::records::read;
use crate::support::setup::{Setup, reduce};
use pointmill::ErrorKind;
use pointmill::{Overrides, Quiet};
use serde_json::json;

const ODD: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

fn grid(points: u32) -> Vec<([f64; 3], u32)> {
    (0..points)
        .map(|i| ([f64::from(i % 20), f64::from(i / 20), f64::from(i % 3) / 10.0], i))
        .collect()
}

#[test]
fn points_that_are_not_finite_are_refused_or_dropped_and_counted() {
    for (n, odd) in ODD.into_iter().enumerate() {
        let case = Case::new();
        let mut points = grid(400);
        let mut wrong = [7.0, 8.0, 9.0];
        wrong[n] = odd;
        points.insert(123, (wrong, 7777));
        case.ply(&points);
        let error = case.run("", REDUCE, "").unwrap_err();
        assert_eq!((error.kind(), error.path()), (ErrorKind::Data, Some(&*case.path("in.ply"))));
        assert!(error.to_string().contains("is not finite"), "{error:?}");
        assert!(error.remedy().unwrap().contains("nonfinite = \"drop\""), "{error:?}");
        assert_eq!(case.left(), ["in.ply"]);
        for stages in [REDUCE, ""] {
            case.run("nonfinite = 'drop'", stages, "").unwrap();
            let ledger = &case.report()["result"]["ledger"];
            assert_eq!(ledger["read"], 401);
            let removed = ledger["removed"].as_array().unwrap();
            let dropped = removed.iter().find(|entry| entry["reason"] == "not finite").unwrap();
            assert_eq!(dropped["records"], 1);
            assert!(case.written().iter().all(|(_, tag)| *tag != 7777));
        }
        assert_eq!(case.written(), grid(400));
    }
}

#[test]
fn a_conversion_copies_what_is_not_finite_and_las_refuses_it() {
    let case = Case::new();
    let mut points = grid(10);
    points.push(([f64::NAN, 1.0, 2.0], 11));
    case.ply(&points);
    case.run("", "", "").unwrap();
    let copied = case.written();
    assert!(copied.len() == 11 && copied[10].0[0].is_nan(), "{copied:?}");
    fs::remove_file(case.path("out.ply")).unwrap();
    fs::remove_file(case.path("report.json")).unwrap();
    let text = case.text("", "", "scale = 0.001\ndrop = ['tag']").replace("out.ply", "out.las");
    let error = execute(&text, &Overrides::default(), &Quiet).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Data);
    assert_eq!(error.path(), Some(&*case.path("out.las")));
    assert!(error.to_string().contains("X = NaN of the point at (NaN, 1, 2)"), "{error}");
    assert!(error.remedy().unwrap().contains("nonfinite = \"drop\""), "{error:?}");
    assert_eq!(case.left(), ["in.ply"]);
    let text = text.replace("[run]\n", "[run]\nnonfinite = 'drop'\n");
    execute(&text, &Overrides::default(), &Quiet).unwrap();
    assert_eq!(read(&case.path("out.las")).1.len() % 10, 0);
}

#[test]
fn coordinates_beyond_the_lattice_or_the_scale_name_their_point() {
    let case = Case::new();
    let mut points = grid(100);
    points.push(([5e9, 1.0, 2.0], 100));
    case.ply(&points);
    let error = case.run("nonfinite = 'drop'", REDUCE, "").unwrap_err();
    assert_eq!(error.path(), Some(&*case.path("in.ply")));
    assert!(error.to_string().contains("[5000000000.0, 1.0, 2.0] lies beyond the lattice"));
    assert!(error.remedy().unwrap().contains("lattice"));
    assert_eq!(case.left(), ["in.ply"]);
    case.run("lattice = 0.001", REDUCE, "").unwrap();
    fs::remove_file(case.path("out.ply")).unwrap();
    fs::remove_file(case.path("report.json")).unwrap();
    for stages in ["", REDUCE] {
        let text = case.text("lattice = 0.001", stages, "scale = 0.001");
        let text = text.replace("out.ply", "out.las");
        let error = execute(&text, &Overrides::default(), &Quiet).unwrap_err();
        assert!(error.to_string().contains("X = 5000000000 of the point at (5000000000, 1, 2)"));
        assert!(error.remedy().unwrap().contains("offset = [5000000000.0, 0.0, 0.0]"));
        assert_eq!(case.left(), ["in.ply"]);
    }
}

#[test]
fn scans_of_no_point_one_or_one_place_reduce_in_every_format() {
    let place = |n: u32| (0..n).map(|_| ([1.5, -2.5, 3.0], 9)).collect::<Vec<_>>();
    for points in [place(0), place(1), place(1000)] {
        for output in ["out.ply", "out.las", "out.laz"] {
            let case = Case::new();
            case.ply(&points);
            let keys = if output == "out.ply" { "" } else { "scale = 0.5" };
            let text = case.text("", REDUCE, keys).replace("out.ply", output);
            let done = execute(&text, &Overrides::default(), &Quiet).unwrap();
            let ledger = &done.report.result.ledger;
            assert_eq!(ledger.read, points.len() as u64);
            assert_eq!(ledger.kept == 0, points.is_empty(), "{output}");
            let (schema, records) = read(&case.path(output));
            assert_eq!((records.len() / schema.stride) as u64, ledger.kept, "{output}");
        }
    }
}

const UTM: &str = "PROJCS[\"UTM\",GEOGCS[\"WGS84\",UNIT[\"degree\",0.0174]],UNIT[\"metre\",1]]";

/// A LAS scan of a slope in the system `wkt`: heights are as many hundredths as x is.
fn slope(wkt: &str) -> Vec<u8> {
    let mut payload = wkt.as_bytes().to_vec();
    payload.push(0);
    let vlrs = [Beside { user: "LASF_Projection", record: 2112, payload }];
    let mut records = Vec::new();
    for i in 0..900i32 {
        let mut record = vec![0u8; STRIDES[6]];
        let (x, y) = (i % 30 * 25, i / 30 * 25);
        for (axis, value) in [x, y, x].into_iter().enumerate() {
            record[4 * axis..4 * axis + 4].copy_from_slice(&value.to_le_bytes());
        }
        record[14] = 0x11;
        records.extend(record);
    }
    let (scale, offset) = ([0.01; 3], [500_000.0, 5_000_000.0, 0.0]);
    let las = LasFile {
        format: 6,
        stride: STRIDES[6],
        scale,
        offset,
        vlrs: &vlrs,
        evlrs: &[],
        records: &records,
    };
    las.bytes()
}

#[test]
fn heights_in_feet_over_metres_are_measured_in_metres_once_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let [input, output] = ["in.las", "out.las"].map(|name| folder.path().join(name));
    let feet = format!(
        "COMPD_CS[\"x\",{UTM},VERT_CS[\"ft\",VERT_DATUM[\"d\",2005],UNIT[\"foot\",0.3048]]]"
    );
    fs::write(&input, slope(&feet)).unwrap();
    let run = |sets: &[(&'static str, serde_json::Value)]| {
        reduce(std::slice::from_ref(&input), &output, &Setup::new(sets))
    };
    let error = run(&[]).unwrap_err();
    assert_eq!((error.kind(), error.path()), (ErrorKind::Data, Some(input.as_path())));
    assert!(error.to_string().contains("x and y are in metres and z in feet"), "{error}");
    assert!(error.remedy().unwrap().contains("z_scale"), "{error:?}");
    assert_holds(folder.path(), &["in.las"]);
    let normals = ("write.dimensions", json!(["NormalX", "NormalY", "NormalZ"]));
    let slopes = |sets: &[(&'static str, serde_json::Value)]| -> f64 {
        let sets = [sets, std::slice::from_ref(&normals)].concat();
        let done = run(&sets).unwrap();
        assert!(done.report.run.warnings.is_empty());
        let (schema, records) = read(&output);
        let at =
            |name: &str, record: &[u8]| schema.find(name).unwrap().world(record, schema.endian);
        let record = records.chunks_exact(schema.stride).next().unwrap();
        assert!((at("Z", record) + 500_000.0 - at("X", record)).abs() < 1e-6, "z stays in feet");
        (at("NormalX", record) / at("NormalZ", record)).abs()
    };
    assert!((slopes(&[("run.units", json!("ignore"))]) - 1.0).abs() < 1e-4);
    assert!((slopes(&[("run.z_scale", json!(1))]) - 1.0).abs() < 1e-4);
    assert!((slopes(&[("run.z_scale", json!("auto"))]) - 0.3048).abs() < 1e-4);
    assert!((slopes(&[("run.z_scale", json!(2.0))]) - 2.0).abs() < 1e-4);
}

#[test]
fn degrees_are_refused_by_stages_that_measure_and_converted_without_a_word() {
    let case = Case::new();
    case.ply(&grid(400));
    let bytes = fs::read(case.path("in.ply")).unwrap();
    let head = b"format binary_little_endian 1.0\n";
    let at = bytes.windows(head.len()).position(|w| w == head).unwrap() + head.len();
    let with = [&bytes[..at], b"comment crs: EPSG:4326\n", &bytes[at..]].concat();
    fs::write(case.path("in.ply"), with).unwrap();
    let error = case.run("z_scale = 'auto'", REDUCE, "").unwrap_err();
    assert!(error.to_string().contains("x and y are in degrees"), "{error}");
    assert!(error.remedy().unwrap().contains("project the scan"), "{error:?}");
    assert_eq!(case.left(), ["in.ply"]);
    case.run("", "", "").unwrap();
    case.run("", "", "order = 'canonical'").unwrap();
    case.run("z_scale = 9e-6", REDUCE, "").unwrap();
    case.run("units = 'ignore'", REDUCE, "").unwrap();
}
