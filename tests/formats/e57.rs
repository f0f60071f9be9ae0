//! E57 of the crate's own making: poses, invalid points, several scans, limits of colours.

use std::path::Path;

use e57::{
    E57Writer, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform, Translation,
};

use super::{converted, points, warned};
use crate::support::command::{done, fails, pointmill};

const SINGLE: RecordDataType = RecordDataType::Single { min: None, max: None };
const DOUBLE: RecordDataType = RecordDataType::Double { min: None, max: None };

fn record(name: RecordName, data_type: RecordDataType) -> Record {
    Record { name, data_type }
}

fn cartesian(kind: &RecordDataType) -> Vec<Record> {
    let names = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ];
    names.into_iter().map(|name| record(name, kind.clone())).collect()
}

type Scan = (Vec<Record>, Vec<Vec<RecordValue>>, Option<Transform>);

fn file(path: &Path, scans: Vec<Scan>) {
    let mut writer = E57Writer::from_file(path, "{whole}").unwrap();
    for (n, (prototype, all, pose)) in scans.into_iter().enumerate() {
        let mut cloud = writer.add_pointcloud(&format!("{{{n}}}"), prototype).unwrap();
        cloud.set_transform(pose);
        all.into_iter().for_each(|values| cloud.add_point(values).unwrap());
        cloud.finalize().unwrap();
    }
    writer.finalize().unwrap();
}

fn singles(all: &[f32]) -> Vec<RecordValue> {
    all.iter().map(|v| RecordValue::Single(*v)).collect()
}

#[test]
fn scans_are_brought_together_by_their_poses_and_told_apart() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let mut colored = cartesian(&SINGLE);
    let byte = RecordDataType::Integer { min: 0, max: 255 };
    let colors = [RecordName::ColorRed, RecordName::ColorGreen, RecordName::ColorBlue];
    colored.extend(colors.into_iter().map(|name| record(name, byte.clone())));
    let values = |xyz: [f32; 3], rgb: [i64; 3]| {
        [singles(&xyz), rgb.map(RecordValue::Integer).to_vec()].concat()
    };
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let rotation = Quaternion { w: half, x: 0.0, y: 0.0, z: half };
    let translation = Translation { x: 100.0, y: 0.0, z: 0.0 };
    file(
        &at.join("a.e57"),
        vec![
            (colored, vec![values([1.0, 2.0, 3.0], [255, 0, 7])], None),
            (
                cartesian(&SINGLE),
                vec![singles(&[1.0, 2.0, 3.0])],
                Some(Transform { rotation, translation }),
            ),
        ],
    );
    let (lines, _) = converted(at, "a.e57", &["--decimals", "6"]);
    assert_eq!(
        lines,
        [
            "X,Y,Z,Red,Green,Blue,PointSourceId",
            "1.000000,2.000000,3.000000,255,0,7,1",
            "98.000000,1.000000,3.000000,0,0,0,2",
        ]
    );
    assert!(warned(at, "a.e57", &[]).contains("1 of 2 scans have no Red: it is 0 there"));
    let (lines, _) = converted(at, "a.e57", &["--scans", "1"]);
    assert_eq!(lines, ["X,Y,Z,Red,Green,Blue", "1,2,3,255,0,7"]);
    fails(at, &["convert", "a.e57", "-o", "o.las", "--scans", "3"], 2, &["names scan 3", "has 2"]);
    fails(at, &["convert", "a.e57", "-o", "o.las", "--scans", "0"], 2, &["--scans"]);
    let info = done(at, &["info", "a.e57"]);
    assert!(info.contains("ColorRed") && info.contains("yes"), "{info}");
}

#[test]
fn invalid_points_are_left_out_and_values_that_are_none_are_0() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let state = |max| RecordDataType::Integer { min: 0, max };
    let mut prototype = cartesian(&DOUBLE);
    prototype.push(record(RecordName::CartesianInvalidState, state(2)));
    prototype.push(record(RecordName::Intensity, SINGLE));
    prototype.push(record(RecordName::IsIntensityInvalid, state(1)));
    prototype.push(record(RecordName::RowIndex, RecordDataType::Integer { min: 0, max: 9 }));
    prototype.push(record(RecordName::ReturnIndex, RecordDataType::Integer { min: 0, max: 3 }));
    prototype.push(record(RecordName::ReturnCount, RecordDataType::Integer { min: 1, max: 4 }));
    let point = |x: f64, invalid, intensity, is_none| {
        vec![
            RecordValue::Double(x),
            RecordValue::Double(0.25),
            RecordValue::Double(-1.0),
            RecordValue::Integer(invalid),
            RecordValue::Single(intensity),
            RecordValue::Integer(is_none),
            RecordValue::Integer(5),
            RecordValue::Integer(1),
            RecordValue::Integer(2),
        ]
    };
    let all = vec![point(1.0, 0, 0.5, 0), point(2.0, 2, 0.5, 0), point(3.0, 0, 0.75, 1)];
    file(&at.join("a.e57"), vec![(prototype, all, None)]);
    let names = "X,Y,Z,Intensity,ReturnNumber,NumberOfReturns,Row";
    assert_eq!(points(at, "a.e57"), [names, "1,0.25,-1,0.5,2,2,5", "3,0.25,-1,0,2,2,5"]);
    assert!(warned(at, "a.e57", &[]).contains("1 of 3 points are said to have no coordinates"));
    // As written by us, too.
    done(at, &["convert", "a.e57", "-o", "b.e57", "--quiet"]);
    assert_eq!(points(at, "b.e57"), points(at, "a.e57"));
}

#[test]
fn a_point_may_have_neither_intensity_nor_colour() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let flag = RecordDataType::Integer { min: 0, max: 1 };
    let byte = RecordDataType::Integer { min: 0, max: 255 };
    let mut prototype = cartesian(&DOUBLE);
    prototype.push(record(RecordName::IsIntensityInvalid, flag.clone()));
    prototype.push(record(RecordName::Intensity, SINGLE));
    let colors = [RecordName::ColorRed, RecordName::ColorGreen, RecordName::ColorBlue];
    prototype.extend(colors.into_iter().map(|name| record(name, byte.clone())));
    prototype.push(record(RecordName::IsColorInvalid, flag));
    let point = |x: f64, none: [i64; 2]| {
        let mut values = [x, 0.0, 0.0].map(RecordValue::Double).to_vec();
        values.extend([RecordValue::Integer(none[0]), RecordValue::Single(0.5)]);
        values.extend([255, 0, 7].map(RecordValue::Integer));
        values.push(RecordValue::Integer(none[1]));
        values
    };
    let all = vec![point(1.0, [0, 0]), point(2.0, [1, 0]), point(3.0, [0, 1]), point(4.0, [1, 1])];
    file(&at.join("a.e57"), vec![(prototype, all, None)]);
    let (lines, _) = converted(at, "a.e57", &[]);
    let expected = ["1,0,0,0.5,255,0,7", "2,0,0,0,255,0,7", "3,0,0,0.5,0,0,0", "4,0,0,0,0,0,0"];
    assert_eq!(lines[1..], expected);
}

#[test]
fn spherical_coordinates_and_scaled_integers_are_read() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let names =
        [RecordName::SphericalRange, RecordName::SphericalAzimuth, RecordName::SphericalElevation];
    let spherical = names.into_iter().map(|name| record(name, DOUBLE)).collect();
    let quarter = std::f64::consts::FRAC_PI_2;
    let polar = [[2.0, 0.0, 0.0], [2.0, quarter, 0.0], [2.0, 0.0, quarter]];
    let polar = polar.map(|values| values.map(RecordValue::Double).to_vec()).to_vec();
    let scaled = RecordDataType::ScaledInteger { min: -1000, max: 1000, scale: 0.01, offset: 50.0 };
    let steps = vec![[100, -100, 57].map(RecordValue::ScaledInteger).to_vec()];
    file(&at.join("a.e57"), vec![(spherical, polar, None), (cartesian(&scaled), steps, None)]);
    let (lines, _) = converted(at, "a.e57", &["--decimals", "9"]);
    let expected = [
        "2.000000000,0.000000000,0.000000000,1",
        "0.000000000,2.000000000,0.000000000,1",
        "0.000000000,0.000000000,2.000000000,1",
        "51.000000000,49.000000000,50.570000000,2",
    ];
    assert_eq!(lines[1..], expected);
}

#[test]
fn steps_of_las_stay_steps_and_the_same_run_gives_the_same_bytes() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "als", "-n", "70000", "-o", "a.laz"]);
    for (name, threads) in [("a.e57", "1"), ("b.e57", "2")] {
        let plain = ["--threads", threads, "--no-provenance", "--quiet"];
        done(at, &[&["convert", "a.laz", "-o", name], &plain[..]].concat());
    }
    let bytes = |name: &str| std::fs::read(at.join(name)).unwrap();
    assert!(bytes("a.e57") == bytes("b.e57"));
    let reader = e57::E57Reader::from_file(at.join("a.e57")).unwrap();
    let cloud = &reader.pointclouds()[0];
    assert_eq!(cloud.records, 70_000);
    assert!(matches!(cloud.prototype[0].data_type, RecordDataType::ScaledInteger { .. }));
    done(at, &["convert", "a.laz", "-o", "c.e57", "--quiet"]);
    assert!(done(at, &["info", "c.e57"]).contains("a.laz"), "it says how it was made");
    assert!(done(at, &["reproduce", "c.e57"]).contains("same"), "and is made again");
    assert!(bytes("c.e57").len() < 3 * 70_000 * 20);
}

#[test]
fn damage_is_told_with_its_scan() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let many = (0..5000).map(|n| singles(&[n as f32, 0.0, 0.0])).collect();
    file(&at.join("a.e57"), vec![(cartesian(&SINGLE), many, None)]);
    let whole = std::fs::read(at.join("a.e57")).unwrap();
    let told = |bytes: &[u8], parts: &[&str]| {
        std::fs::write(at.join("d.e57"), bytes).unwrap();
        fails(at, &["convert", "d.e57", "-o", "o.ply"], 1, &[&["d.e57: "], parts].concat());
    };
    let mut broken = whole.clone();
    broken[20_000] ^= 1;
    told(&broken, &["scan 1: a point is not read", "checksum"]);
    told(&whole[..whole.len() - 100], &["its header is not read", "truncated"]);
    told(b"ASTM-E57", &["its header is not read"]);
    told(b"ASTM-E5", &["not an E57 file"]);
    let (code, _, told) = pointmill(at, &["convert", "a.e57", "-o", "a.stl"]);
    assert_eq!(code, 2, "{told}");
}

#[test]
fn points_beyond_the_bounds_that_a_scan_gives_are_a_fault() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let points = [[0.0, 0.0, 0.0], [9.0, 5.0, 1.0]].map(|point| singles(&point)).to_vec();
    let rotation = Quaternion { w: 1.0, x: 0.0, y: 0.0, z: 0.0 };
    let translation = Translation { x: 100.0, y: 0.0, z: 0.0 };
    // Bounds are in the coordinates of the scan, whatever its pose.
    let pose = Some(Transform { rotation, translation });
    file(&at.join("a.e57"), vec![(cartesian(&SINGLE), points, pose)]);
    assert!(done(at, &["validate", "a.e57"]).contains("a.e57: "));
    let mut bytes = std::fs::read(at.join("a.e57")).unwrap();
    let name = b"<xMaximum";
    let start = bytes.windows(name.len()).position(|some| some == name).unwrap();
    let digit = start + bytes[start..].iter().position(|&byte| byte == b'>').unwrap() + 1;
    assert_eq!(bytes[digit], b'9');
    bytes[digit] = b'4';
    for page in bytes.chunks_exact_mut(1024) {
        let sum = crc32c::crc32c(&page[..1020]);
        page[1020..].copy_from_slice(&sum.to_be_bytes());
    }
    std::fs::write(at.join("a.e57"), bytes).unwrap();
    let (code, told, _) = pointmill(at, &["validate", "a.e57"]);
    assert_eq!(code, 1);
    assert!(told.contains("(e57-bounds-hold)"), "{told}");
    assert!(
        told.contains("x of points from 0 to 9, and the bounds of scan 1 are 0 to 4"),
        "{told}"
    );
}
