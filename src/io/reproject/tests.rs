use std::sync::Arc;

use super::form::{AskedSteps, AxisMetres, ReprojectedForm};
use super::systems::HeightChange;
use crate::point::{Dimension, Endian, Layout, PointBatch, Scalar, Schema, Value};
use crate::quantity::Setting;

/// Records of a byte, three coordinates, and another byte.
fn records(scalar: Scalar, steps: bool, scale: f64) -> Schema {
    let size = scalar.size();
    let axis = |(i, name)| Dimension::new(name, scalar, 1 + i * size).scaled(scale, 0.0);
    let mut dimensions = vec![Dimension::new("Before", Scalar::U8, 0)];
    dimensions.extend(crate::point::names::XYZ.into_iter().enumerate().map(axis));
    dimensions.push(Dimension::new("Behind", Scalar::U8, 1 + 3 * size));
    let layout = Layout { steps, ..Layout::plain("TOY") };
    Schema { layout, endian: Endian::Little, stride: 2 + 3 * size, dimensions }
}

/// Place of a scan, of which nothing depends on heights.
const HERE: [[f64; 3]; 2] = [[244_000.0, 5_337_000.0, 0.0], [245_000.0, 5_338_000.0, 10.0]];

fn form(own: &Schema, asked: AskedSteps, metres: AxisMetres, keeps: bool) -> ReprojectedForm {
    ReprojectedForm::of(own, asked, metres, Some(HERE), heights(keeps)).unwrap()
}

fn heights(keeps: bool) -> HeightChange {
    if keeps { HeightChange::Times(1.0) } else { HeightChange::WithPlace }
}

/// Scale and offset of each axis.
fn steps(form: &ReprojectedForm) -> [(f64, f64); 3] {
    [1, 2, 3].map(|i: usize| (form.schema.dimensions[i].scale, form.schema.dimensions[i].origin))
}

#[test]
fn steps_are_no_longer_on_the_ground_and_reach_the_scan() {
    let own = records(Scalar::I32, true, 0.01);
    let none = AskedSteps::default();
    let plane = |was: f64, is: f64| [[was, was, 1.0], [is, is, 1.0]];
    let metres = form(&own, none, plane(1.0, 1.0), true);
    assert_eq!(steps(&metres), [(0.01, 0.0), (0.01, 0.0), (0.01, 0.0)]);
    assert!(metres.coarser.is_empty());
    // A hundredth of a foot is shorter than a hundredth of a metre.
    let feet = form(&own, none, plane(0.3048, 1.0), true);
    assert_eq!(steps(&feet).map(|(scale, _)| scale), [1e-3, 1e-3, 0.01]);
    // Degrees are long, and heights in feet become metres by a unit of their own.
    let degrees = [[111_319.5, 111_319.5, 0.3048], [1.0; 3]];
    assert_eq!(steps(&form(&own, none, degrees, false)).map(|(scale, _)| scale)[2], 1e-3);
    let to_degrees = form(&own, none, [[1.0; 3], [111_319.5, 111_319.5, 1.0]], false);
    assert_eq!(steps(&to_degrees).map(|(scale, _)| scale), [1e-6, 1e-6, 0.01]);
    // Shorter ones would not reach from end to end of so wide a box, which is told.
    assert_eq!(to_degrees.coarser.len(), 2, "{:?}", to_degrees.coarser);
}

#[test]
fn steps_that_are_asked_for_are_taken_and_told_where_they_are_longer() {
    let own = records(Scalar::I32, true, 0.01);
    let given = |scale: [f64; 3]| AskedSteps { scale: Some(Setting::Given(scale)), offset: None };
    let fine = form(&own, given([1e-4; 3]), [[1.0; 3]; 2], true);
    let [x, y, z] = steps(&fine);
    assert_eq!((x.0, y.0, z.0), (1e-4, 1e-4, 1e-4));
    assert!((y.1 - 5_337_500.0).abs() < 1000.0 && fine.coarser.is_empty(), "{y:?}");
    let degrees = [[1.0; 3], [111_319.5, 111_319.5, 1.0]];
    let coarse = form(&own, given([1e-3; 3]), degrees, true).coarser;
    assert_eq!(coarse.len(), 2, "{coarse:?}");
    assert!(coarse[0].contains("x is rounded to steps of 0.001, which are 111 m"), "{coarse:?}");
}

#[test]
fn steps_of_no_length_are_refused() {
    for scale in [1e-320, 1e308] {
        let own = records(Scalar::I32, true, scale);
        let metres = [[111_319.5; 3], [1e-3; 3]];
        let place = if scale < 1.0 { [metres[1], metres[0]] } else { metres };
        let made =
            ReprojectedForm::of(&own, AskedSteps::default(), place, Some(HERE), heights(false));
        assert!(made.unwrap_err().to_string().contains("no length"), "{scale}");
    }
}

#[test]
fn other_coordinates_become_doubles_between_fields_that_stay() {
    for (scalar, steps) in [(Scalar::F32, false), (Scalar::I32, false), (Scalar::F64, false)] {
        let own = records(scalar, steps, 1.0);
        let made = form(&own, AskedSteps::default(), [[1.0; 3]; 2], true).schema;
        let places: Vec<usize> = made.dimensions.iter().map(|d| d.offset).collect();
        assert_eq!((places, made.stride), (vec![0, 1, 9, 17, 25], 26), "{scalar:?}");
        assert!(made.dimensions[1..4].iter().all(|axis| axis.scalar == Scalar::F64));
    }
}

/// What stands in a record at these coordinates once it is filled.
fn filled(keeps: bool, at: [f64; 3]) -> [f64; 3] {
    let own = Arc::new(records(Scalar::F32, false, 1.0));
    let form = form(&own, AskedSteps::default(), [[1.0; 3]; 2], keeps);
    let mut batch = PointBatch::new(own.clone(), 1);
    batch.extend(&[7; 14]);
    for (axis, at) in own.coordinates().unwrap().into_iter().zip(at) {
        assert!(axis.put(batch.records_mut(), Endian::Little, Value::Single(at as f32)));
    }
    let mut record = vec![0; form.schema.stride];
    form.fill(&batch, &mut record, |at| Ok(at.map(|at| at + 100.0))).unwrap();
    assert_eq!((record[0], record[25]), (7, 7));
    form.schema.coordinates().unwrap().map(|axis| axis.world(&record, Endian::Little))
}

#[test]
fn a_point_that_lacks_a_coordinate_is_in_no_system_but_the_one_behind() {
    assert_eq!(filled(false, [1.0, 2.0, 3.0]), [101.0, 102.0, 103.0]);
    assert_eq!(filled(true, [1.0, 2.0, 3.0]), [101.0, 102.0, 3.0]);
    let [x, y, z] = filled(true, [1.0, 2.0, f64::NAN]);
    assert!((x, y) == (101.0, 102.0) && z.is_nan(), "{x} {y} {z}");
    let [x, y, z] = filled(true, [f64::NAN, 2.0, 3.0]);
    assert!(x.is_nan() && y.is_nan() && z == 3.0, "{x} {y} {z}");
    assert!(filled(false, [1.0, 2.0, f64::NAN]).iter().all(|at| at.is_nan()));
}
