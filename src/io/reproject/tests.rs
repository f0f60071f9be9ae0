use super::form::{AskedSteps, ReprojectedForm};
use crate::point::{Dimension, Endian, Layout, Scalar, Schema};
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

fn form(own: &Schema, asked: AskedSteps, metres: [f64; 2], place: [[f64; 3]; 2]) -> Schema {
    ReprojectedForm::of(own, asked, metres, Some(place), true).unwrap().schema
}

#[test]
fn steps_are_no_longer_on_the_ground_and_reach_the_scan() {
    let own = records(Scalar::I32, true, 0.01);
    let place = [[244_000.0, 5_337_000.0, 0.0], [245_000.0, 5_338_000.0, 10.0]];
    let of = |metres, place, asked| {
        let axes = form(&own, asked, metres, place);
        [1, 2, 3].map(|i: usize| (axes.dimensions[i].scale, axes.dimensions[i].origin))
    };
    let none = AskedSteps::default();
    let metres = of([1.0, 1.0], place, none);
    assert_eq!(metres, [(0.01, 0.0), (0.01, 0.0), (0.01, 0.0)]);
    // A foot is 0.3048 m: a hundredth of it is longer than a millimetre.
    assert_eq!(of([0.3048, 1.0], place, none)[0], (1e-3, 0.0));
    let degrees = of([1.0, 111_319.5], [[11.0, 48.0, 0.0], [11.1, 48.1, 1.0]], none);
    assert_eq!((degrees[0], degrees[1]), ((1e-8, 11.0), (1e-8, 48.0)));
    // The whole world takes longer steps than a scan.
    let world = of([1.0, 111_319.5], [[-180.0, -90.0, 0.0], [180.0, 90.0, 1.0]], none);
    assert_eq!(world[0], (1e-7, 0.0));
    let asked = AskedSteps { scale: Some(Setting::Given([1e-4; 3])), offset: None };
    let given = of([1.0, 1.0], place, asked);
    assert_eq!((given[0].0, given[1].0), (1e-4, 1e-4));
    assert!((given[1].1 - 5_337_500.0).abs() < 1000.0, "{given:?}");
}

#[test]
fn other_coordinates_become_doubles_between_fields_that_stay() {
    for (scalar, steps) in [(Scalar::F32, false), (Scalar::I32, false), (Scalar::F64, false)] {
        let own = records(scalar, steps, 1.0);
        let made = form(&own, AskedSteps::default(), [1.0; 2], [[0.0; 3], [1.0; 3]]);
        let places: Vec<usize> = made.dimensions.iter().map(|d| d.offset).collect();
        assert_eq!((places, made.stride), (vec![0, 1, 9, 17, 25], 26), "{scalar:?}");
        assert!(made.dimensions[1..4].iter().all(|axis| axis.scalar == Scalar::F64));
    }
}
