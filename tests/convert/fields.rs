//! LAS records as PLY vertices and back: every field, bit for bit.

use pointmill::internals::las::{las_schema, records};
use pointmill::internals::ply::ply_schema;
use pointmill::io::Projection;
use pointmill::point::{Dimension, Endian, Layout, Scalar, Schema, Value};
use proptest::prelude::*;

/// The dimensions of a LAS point record (LAS 1.4 R15, tables 6 to 17), written down anew here as a
/// check on the names; extra bytes behind them.
fn las(format: u8, extra: &[(String, Scalar)], scale: [f64; 3], offset: [f64; 3]) -> Schema {
    let mut dimensions = Vec::new();
    for (axis, name) in ["X", "Y", "Z"].into_iter().enumerate() {
        let at = Dimension::new(name, Scalar::I32, 4 * axis);
        dimensions.push(at.scaled(scale[axis], offset[axis]));
    }
    let mut add =
        |name: &str, scalar, offset| dimensions.push(Dimension::new(name, scalar, offset));
    add("Intensity", Scalar::U16, 12);
    let extended = format >= 6;
    let core = if extended { 30 } else { 20 };
    if extended {
        add("Classification", Scalar::U8, 16);
        add("UserData", Scalar::U8, 17);
        add("PointSourceId", Scalar::U16, 20);
        add("GpsTime", Scalar::F64, 22);
    } else {
        add("ScanAngle", Scalar::I8, 16);
        add("UserData", Scalar::U8, 17);
        add("PointSourceId", Scalar::U16, 18);
    }
    let mut at = core;
    let mut next = |scalar: Scalar| {
        at += scalar.size();
        at - scalar.size()
    };
    if matches!(format, 1 | 3 | 4 | 5) {
        add("GpsTime", Scalar::F64, next(Scalar::F64));
    }
    if matches!(format, 2 | 3 | 5 | 7 | 8 | 10) {
        for name in ["Red", "Green", "Blue"] {
            add(name, Scalar::U16, next(Scalar::U16));
        }
    }
    if matches!(format, 8 | 10) {
        add("Nir", Scalar::U16, next(Scalar::U16));
    }
    if matches!(format, 4 | 5 | 9 | 10) {
        add("WavePacketDescriptorIndex", Scalar::U8, next(Scalar::U8));
        add("WavePacketByteOffset", Scalar::U64, next(Scalar::U64));
        add("WavePacketSize", Scalar::U32, next(Scalar::U32));
        for name in ["WaveReturnPoint", "WaveXt", "WaveYt", "WaveZt"] {
            add(name, Scalar::F32, next(Scalar::F32));
        }
    }
    for (name, scalar) in extra {
        add(name, *scalar, next(*scalar));
    }
    let bits: &[(&str, usize, u8, u8)] = if extended {
        dimensions.push(Dimension::new("ScanAngle", Scalar::I16, 18).scaled(0.006, 0.0));
        &[
            ("ReturnNumber", 14, 0, 4),
            ("NumberOfReturns", 14, 4, 4),
            ("Synthetic", 15, 0, 1),
            ("KeyPoint", 15, 1, 1),
            ("Withheld", 15, 2, 1),
            ("Overlap", 15, 3, 1),
            ("ScannerChannel", 15, 4, 2),
            ("ScanDirectionFlag", 15, 6, 1),
            ("EdgeOfFlightLine", 15, 7, 1),
        ]
    } else {
        &[
            ("ReturnNumber", 14, 0, 3),
            ("NumberOfReturns", 14, 3, 3),
            ("ScanDirectionFlag", 14, 6, 1),
            ("EdgeOfFlightLine", 14, 7, 1),
            ("Classification", 15, 0, 5),
            ("Synthetic", 15, 5, 1),
            ("KeyPoint", 15, 6, 1),
            ("Withheld", 15, 7, 1),
        ]
    };
    for &(name, offset, shift, width) in bits {
        dimensions.push(Dimension::new(name, Scalar::U8, offset).bits(shift, width));
    }
    let endian = Endian::Little;
    Schema { layout: records(format), endian, stride: at, dimensions }
}

fn extras() -> Vec<(String, Scalar)> {
    [
        ("Amplitude", Scalar::F32),
        ("Echo width", Scalar::F64),
        ("x", Scalar::I8),
        ("Deviation", Scalar::I16),
        ("count", Scalar::U32),
        ("NormalX", Scalar::F32),
    ]
    .map(|(name, scalar)| (name.to_owned(), scalar))
    .to_vec()
}

const SCALE: [f64; 3] = [0.01, 0.001, 0.000_25];
const OFFSET: [f64; 3] = [500_000.0, 4_100_000.5, -3.3];

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn las_to_ply_to_las_returns_every_field(
        format in 0..=10u8,
        with_extras in any::<bool>(),
        bytes in prop::collection::vec(any::<u8>(), 1000),
    ) {
        let extra = if with_extras { extras() } else { Vec::new() };
        let source = las(format, &extra, SCALE, OFFSET);
        let mut records = bytes[..bytes.len() / source.stride * source.stride].to_vec();
        for record in records.chunks_mut(source.stride) {
            if let Some(offset) = source.find("WavePacketByteOffset") {
                record[offset.offset + 6..offset.offset + 8].fill(0); // below 2^48, as in any file
            }
        }
        let vertex = ply_schema(&source);
        let there = Projection::new(&source, &vertex, &[]).unwrap();
        let mut vertices = Vec::new();
        let rounding = there.project(&records, &mut vertices).unwrap();
        prop_assert_eq!(rounding.points, 0);

        let (chosen, back_extra) = las_schema(&vertex, &[]).unwrap();
        prop_assert_eq!(chosen, format);
        let sorted = |mut list: Vec<(String, Scalar)>| {
            list.sort_by(|a, b| a.0.cmp(&b.0));
            list
        };
        prop_assert_eq!(sorted(back_extra), sorted(extra.clone()));
        let target = las(chosen, &extra, SCALE, OFFSET);
        let back = Projection::new(&vertex, &target, &[]).unwrap();
        let mut again = Vec::new();
        let rounding = back.project(&vertices, &mut again).unwrap();
        prop_assert_eq!(rounding.points, 0);
        prop_assert_eq!(again, records);
    }
}

#[test]
fn coordinates_are_stored_times_scale_plus_offset() {
    let source = las(0, &[], SCALE, OFFSET);
    let mut record = vec![0; source.stride];
    for (axis, raw) in [i32::MIN, 123_456_789, i32::MAX].into_iter().enumerate() {
        record[4 * axis..4 * axis + 4].copy_from_slice(&raw.to_le_bytes());
    }
    let vertex = ply_schema(&source);
    let mut out = Vec::new();
    Projection::new(&source, &vertex, &[]).unwrap().project(&record, &mut out).unwrap();
    for (axis, raw) in [i32::MIN, 123_456_789, i32::MAX].into_iter().enumerate() {
        let world = f64::from(raw) * SCALE[axis] + OFFSET[axis];
        assert_eq!(out[8 * axis..8 * axis + 8], world.to_le_bytes());
    }
}

fn vertex(dimensions: &[(&str, Scalar)]) -> Schema {
    let mut stride = 0;
    let dimensions = dimensions
        .iter()
        .map(|&(name, scalar)| {
            stride += scalar.size();
            Dimension::new(name, scalar, stride - scalar.size())
        })
        .collect();
    Schema { layout: Layout::plain("PLY"), endian: Endian::Big, stride, dimensions }
}

fn record(schema: &Schema, values: &[(&str, f64)]) -> Vec<u8> {
    let mut record = vec![0; schema.stride];
    for (name, value) in values {
        assert!(schema.find(name).unwrap().put(&mut record, schema.endian, Value::Double(*value)));
    }
    record
}

const DOUBLES: [(&str, Scalar); 3] = [("X", Scalar::F64), ("Y", Scalar::F64), ("Z", Scalar::F64)];

#[test]
fn doubles_round_to_the_even_step_and_it_is_told() {
    let source = vertex(&DOUBLES);
    let target = las(6, &[], [0.5; 3], [0.0; 3]);
    let projection = Projection::new(&source, &target, &[]).unwrap();
    let mut records = record(&source, &[("X", 0.25), ("Y", 0.75), ("Z", -1.75)]);
    records.extend(record(&source, &[("X", 1.5), ("Y", 2.0), ("Z", -7.0)]));
    records.extend(record(&source, &[("X", 1.6), ("Y", 2.0), ("Z", -7.0)]));
    let mut out = Vec::new();
    let rounding = projection.project(&records, &mut out).unwrap();
    assert_eq!((rounding.points, rounding.largest), (2, 0.25));
    let raw = |n: usize| i32::from_le_bytes(out[4 * n..4 * n + 4].try_into().unwrap());
    assert_eq!([raw(0), raw(1), raw(2)], [0, 2, -4]);
    assert!(out[12..target.stride].iter().all(|&b| b == 0));
}

#[test]
fn what_the_target_cannot_hold_is_named() {
    let mut kinds = DOUBLES.to_vec();
    kinds.extend([
        ("Intensity", Scalar::F64),
        ("ReturnNumber", Scalar::U8),
        ("ScanAngle", Scalar::F64),
        ("Blue", Scalar::I8),
    ]);
    let source = vertex(&kinds);
    let target = las(7, &[], [0.001; 3], [0.0; 3]);
    let projection = Projection::new(&source, &target, &[]).unwrap();
    let good = record(&source, &[("X", 1.0), ("Intensity", 3.0), ("ScanAngle", 12.0)]);
    projection.project(&good, &mut Vec::new()).unwrap();
    let cases = [
        ("X", 2_147_483.648, "X = 2147483.648"),
        ("Y", f64::NAN, "Y = NaN"),
        ("Z", f64::NEG_INFINITY, "Z = -inf"),
        ("Intensity", 0.8, "Intensity = 0.8"),
        ("Intensity", 65_536.0, "Intensity = 65536"),
        ("ReturnNumber", 16.0, "ReturnNumber = 16"),
        ("ScanAngle", 12.001, "ScanAngle = 12.001"),
        ("ScanAngle", 200.0, "ScanAngle = 200"),
        ("Blue", -1.0, "Blue = -1"),
    ];
    for (name, value, message) in cases {
        let mut records = good.repeat(2);
        records.extend(record(&source, &[("X", 1.0), (name, value)]));
        let error = projection.project(&records, &mut Vec::new()).unwrap_err();
        let told = error.to_string();
        assert!(told.contains(message) && told.contains("of the point at ("), "{told}");
        assert!(error.remedy().is_some());
    }
}

#[test]
fn a_dimension_is_lost_only_where_drop_names_it() {
    let source = las(8, &extras(), SCALE, OFFSET);
    let target = las(6, &[], SCALE, OFFSET);
    let error = Projection::new(&source, &target, &[]).unwrap_err();
    let told = error.to_string();
    for name in ["Red", "Nir", "Echo width", "NormalX"] {
        assert!(told.contains(&format!("`{name}`")), "{told}");
    }
    assert!(error.remedy().unwrap().contains("drop = ["), "{error:?}");
    let names = ["Red", "Green", "Blue", "Nir"].map(str::to_owned).to_vec();
    let all: Vec<String> =
        names.iter().cloned().chain(extras().into_iter().map(|(name, _)| name)).collect();
    assert!(Projection::new(&source, &target, &names).is_err());
    assert!(Projection::new(&source, &target, &all).is_ok());
    assert!(Projection::new(&source, &target, &["Y".to_owned()]).is_err());
    assert!(Projection::new(&source, &source, &["Nirr".to_owned()]).is_err());
    // A dropped dimension is 0 in a target that has it.
    let without = Projection::new(&source, &source, &["Intensity".to_owned()]).unwrap();
    let mut out = Vec::new();
    without.project(&vec![0xff; source.stride], &mut out).unwrap();
    assert_eq!(out[12..14], [0, 0]);
    assert_eq!(out[..12], [0xff; 12]);
}

#[test]
fn equal_schemas_copy_and_other_byte_orders_swap() {
    let source = las(3, &extras(), SCALE, OFFSET);
    assert!(
        Projection::new(&source, &source, &[]).is_ok_and(|p| p.project(&[], &mut vec![]).is_ok())
    );
    let big = vertex(&[("X", Scalar::F32), ("Y", Scalar::U16), ("Z", Scalar::I8)]);
    let little = Schema { endian: Endian::Little, ..big.clone() };
    let mut out = Vec::new();
    let rounding =
        Projection::new(&big, &little, &[]).unwrap().project(&[1, 2, 3, 4, 5, 6, 7], &mut out);
    assert_eq!(out, [4, 3, 2, 1, 6, 5, 7]);
    assert_eq!(rounding.unwrap().points, 0);
}

#[test]
fn the_smallest_point_format_that_holds_all_is_chosen() {
    let chosen = |names: &[(&str, Scalar)], drop: &[&str]| {
        let mut all = DOUBLES.to_vec();
        all.extend(names);
        let drop: Vec<String> = drop.iter().map(|s| (*s).to_owned()).collect();
        las_schema(&vertex(&all), &drop).unwrap().0
    };
    use Scalar::{F32, I8, U8, U16};
    assert_eq!(chosen(&[], &[]), 6);
    assert_eq!(chosen(&[("Red", U8)], &[]), 7);
    assert_eq!(chosen(&[("Red", U8)], &["Red"]), 6);
    assert_eq!(chosen(&[("Nir", U16)], &[]), 8);
    assert_eq!(chosen(&[("WaveXt", F32)], &[]), 9);
    assert_eq!(chosen(&[("WaveXt", F32), ("Nir", U16)], &[]), 10);
    assert_eq!(chosen(&[("ScanAngle", I8)], &[]), 0);
    assert_eq!(chosen(&[("ScanAngle", I8), ("Overlap", U8)], &[]), 6);
    let long = "a name of far more than thirty-two bytes";
    let mut all = DOUBLES.to_vec();
    all.extend([(long, F32), ("quality", U8)]);
    assert!(las_schema(&vertex(&all), &[]).unwrap_err().to_string().contains(long));
    let (format, extra) = las_schema(&vertex(&all), &[long.to_owned()]).unwrap();
    assert_eq!((format, extra), (6, vec![("quality".to_owned(), U8)]));
}
