use super::*;
use crate::ops::transform::Transformation;
use crate::point::{Endian, Layout};

fn schema(scalar: Scalar, scale: [f64; 3], origin: [f64; 3]) -> Schema {
    let steps = scalar == Scalar::I32;
    let dimensions = names::XYZ.into_iter().enumerate().map(|(i, name)| {
        Dimension::new(name, scalar, scalar.size() * i).scaled(scale[i], origin[i])
    });
    let layout = Layout { steps, ..Layout::plain("TOY") };
    let (endian, stride) = (Endian::Little, 3 * scalar.size());
    Schema { layout, endian, stride, dimensions: dimensions.collect() }
}

/// LAS as it often is: steps of millimetres and, in z, of centimetres.
fn survey() -> Schema {
    schema(Scalar::I32, [0.001, 0.001, 0.01], [500_000.0, 4_100_000.0, 0.0])
}

fn map(text: &str, schema: &Schema) -> (AffineMap, StoredMap, Schema) {
    let world = toml::from_str::<Transformation>(text).unwrap().map().unwrap();
    let map = StoredMap::of(&world, schema).unwrap();
    let moved = map.schema(schema).unwrap_or_else(|| schema.clone());
    (world, map, moved)
}

fn record(stored: [i32; 3]) -> Vec<u8> {
    stored.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn world(record: &[u8], schema: &Schema) -> [f64; 3] {
    schema.coordinates().unwrap().map(|axis| axis.world(record, schema.endian))
}

const POINTS: [[i32; 3]; 5] = [
    [0, 0, 0],
    [1, -2, 3],
    [12_345_678, -7_654_321, 4_321],
    [-300_000_000, 299_999_999, -40_000],
    [123, 100_000_001, 77],
];

#[test]
fn moves_scales_and_quarter_turns_keep_the_stored_numbers() {
    for (text, signs, axes) in [
        ("translate = [0.0005, -100, 1e6]", [1, 1, 1], [0, 1, 2]),
        ("scale = 0.3048", [1, 1, 1], [0, 1, 2]),
        ("scale = [2, -1, 10]\ntranslate = [1, 2, 3]", [1, -1, 1], [0, 1, 2]),
        ("rotate = {axis = 'z', angle = '90 deg'}", [-1, 1, 1], [1, 0, 2]),
        ("rotate = {axis = 'x', angle = '-90 deg'}\ncenter = [1, 2, 3]", [1, 1, -1], [0, 2, 1]),
        ("rotate = {axis = [1, 1, 1], angle = '120 deg'}", [1, 1, 1], [2, 0, 1]),
        ("matrix = [0,0,1,0, 0,1,0,0.25, 1,0,0,0, 0,0,0,1]", [1, 1, 1], [2, 1, 0]),
    ] {
        let from = survey();
        let (to, map, moved) = map(text, &from);
        assert_eq!(map.rounding(), [Some(0.0); 3], "{text}");
        for stored in POINTS {
            let mut bytes = record(stored);
            map.apply(&mut bytes, &from).unwrap();
            // A negative scale factor turns the sign of the number, not that of the scale.
            let expected: [i32; 3] = std::array::from_fn(|row| signs[row] * stored[axes[row]]);
            assert_eq!(bytes, record(expected), "{text}");
            let (at, expected) = (world(&bytes, &moved), to.of(world(&record(stored), &from)));
            for axis in 0..3 {
                let off = (at[axis] - expected[axis]).abs();
                assert!(off < 1e-8, "{text}: {at:?} is not {expected:?}");
            }
        }
    }
}

#[test]
fn any_other_map_rounds_to_the_nearest_step_and_its_inverse_gives_points_back() {
    for (there, back) in [
        (
            "rotate = {axis = 'z', angle = '30 deg'}\ncenter = [500000, 4100000, 0]",
            "rotate = {axis = 'z', angle = '-30 deg'}\ncenter = [500000, 4100000, 0]",
        ),
        (
            "rotate = {axis = [1, 2, 3], angle = 1}\ntranslate = [10, 20, 30.5]\n\
             center = [500000, 4100000, 0]",
            "matrix = 'inverse'",
        ),
        ("rotate = {axis = 'z', angle = '1 deg'}", "rotate = {axis = 'z', angle = '-1 deg'}"),
    ] {
        let from = survey();
        let (to, forth, moved) = map(there, &from);
        let inverse = match back.starts_with("rotate") {
            true => StoredMap::of(&map(back, &moved).0, &moved).unwrap(),
            false => {
                let linear = to.linear.try_inverse().unwrap();
                let world = AffineMap { linear, translation: -(linear * to.translation) };
                StoredMap::of(&world, &moved).unwrap()
            }
        };
        let end = inverse.schema(&moved).unwrap();
        for axis in moved.coordinates().unwrap() {
            let thousands = axis.origin / (axis.scale * 1000.0);
            let is_plain = axis.name == "Z" || (thousands - thousands.round()).abs() < 1e-6;
            assert!(is_plain && [0.001, 0.01].contains(&axis.scale), "{axis:?}");
        }
        assert!(forth.rounding()[0] > Some(0.0));
        for stored in POINTS {
            let mut bytes = record(stored);
            let start = world(&bytes, &from);
            forth.apply(&mut bytes, &from).unwrap();
            let (at, expected) = (world(&bytes, &moved), to.of(start));
            for (n, axis) in moved.coordinates().unwrap().into_iter().enumerate() {
                // Half a step, and what the last digits of millions are.
                let off = (at[n] - expected[n]).abs();
                assert!(off <= axis.scale / 2.0 + 1e-8, "{at:?} is not {expected:?}");
            }
            inverse.apply(&mut bytes, &moved).unwrap();
            let at = world(&bytes, &end);
            for (n, axis) in from.coordinates().unwrap().into_iter().enumerate() {
                assert!(
                    (at[n] - start[n]).abs() <= axis.scale.max(0.001) * 1.01,
                    "{at:?} {start:?}"
                );
            }
        }
    }
}

#[test]
fn what_is_out_of_reach_is_an_error_with_the_point() {
    let from = survey();
    let (_, map, _) = map("rotate = {axis = 'z', angle = '45 deg'}", &from);
    let mut far = record([2_000_000_000, 2_000_000_000, 0]);
    let told = map.apply(&mut far, &from).unwrap_err().to_string();
    assert!(told.contains("moves the point [2500000.0, 6100000.0, 0.0] to ["), "{told}");
    assert!(told.contains("as Y in steps of 0.001 from"), "{told}");
}

#[test]
fn floating_point_coordinates_are_rounded_once() {
    for scalar in [Scalar::F32, Scalar::F64] {
        let from = schema(scalar, [1.0; 3], [0.0; 3]);
        let (to, map, moved) =
            map("rotate = {axis = 'z', angle = '30 deg'}\ntranslate = [0.1, 0.2, 0.3]", &from);
        assert_eq!((moved, map.rounding()), (from.clone(), [None; 3]));
        let mut bytes = vec![0; from.stride];
        for (axis, v) in from.coordinates().unwrap().into_iter().zip([1.5, -2.25, 8.0]) {
            assert!(axis.put(&mut bytes, from.endian, Value::Double(v)));
        }
        map.apply(&mut bytes, &from).unwrap();
        let expected = to.of([1.5, -2.25, 8.0]);
        let held = expected.map(|v| if scalar == Scalar::F32 { f64::from(v as f32) } else { v });
        assert_eq!(world(&bytes, &from), held);
    }
}
