use super::*;
use crate::point::{Dimension, Layout};

#[test]
fn scales_of_one_decimal_step_are_whole_multiples() {
    let lattice = decimal([0.01, 0.01, 0.001], [500_000.0, 4_100_000.0, 0.0], 1.0).unwrap();
    assert_eq!(lattice.step, 0.001);
    let Placement::Integer { times, plus } = lattice.placement else { panic!() };
    assert_eq!((times, plus), ([10, 10, 1], [500_000_000, 4_100_000_000, 0]));
}

#[test]
fn steps_that_are_proposed_do() {
    for far in [6.3e9, 4.2e12, 1e300] {
        let step = Lattice::reaching(far);
        assert!(float_position([far, 0.0, 0.0], 1.0 / step).is_ok(), "{far} {step}");
    }
    let lattice = Lattice::binary(1.0 / BINARY, BINARY, 1.0);
    let bounds = |far: i64| Bounds { lo: [-far; 3], hi: [0; 3] };
    assert_eq!(lattice.finer(&bounds(5), 1e-11), Some(1e-12));
    let far = 1 << 55;
    let step = lattice.finer(&bounds(far), 1e-30).unwrap();
    assert!(step < lattice.step && far as f64 * lattice.step / step < FARTHEST, "{step}");
    assert_eq!(lattice.finer(&bounds(1 << 61), 1e-30), None);
    assert_eq!(lattice.rounded(0.15), None);
    let coarse = Lattice::binary(0.1, 10.0, 1.0);
    assert_eq!((coarse.rounded(0.17), coarse.rounded(0.3)), (Some(0.2), None));
}

#[test]
fn equal_scales_need_not_be_decimal() {
    assert_eq!(decimal([1.0 / 3.0; 3], [0.0; 3], 1.0).unwrap().step, 1.0 / 3.0);
    assert!(decimal([1.0 / 3.0, 0.5, 0.5], [0.0; 3], 1.0).is_none());
}

#[test]
fn decimal_positions_are_decimal_in_the_world() {
    let lattice = decimal([0.001; 3], [0.0; 3], 1.0).unwrap();
    assert_eq!(lattice.world([5_600_037_884, -31_351, 7]), [5_600_037.884, -31.351, 0.007]);
    assert_ne!(5_600_037_884.0 * 0.001, 5_600_037.884, "a product rounds otherwise");
    let lattice = decimal([1e-5; 3], [0.0; 3], 1.0).unwrap();
    assert_eq!(lattice.world([-3_135_136, 1, 0]), [-31.35136, 1e-5, 0.0]);
    let lattice = decimal([2.5; 3], [0.0; 3], 1.0).unwrap();
    assert_eq!(lattice.world([3, -1, 0]), [7.5, -2.5, 0.0]);
}

#[test]
fn zero_negative_and_nan_scales_have_no_decimal_lattice() {
    for scale in [0.0, -0.01, f64::NAN, f64::INFINITY, 1e-12] {
        assert!(decimal([scale; 3], [0.0; 3], 1.0).is_none(), "{scale}");
    }
}

#[test]
fn floats_round_half_to_even_and_far_ones_are_told() {
    assert_eq!(float_position([0.5, 1.5, -0.5], 1.0), Ok([0, 2, 0]));
    assert_eq!(float_position([f64::NAN, 0.0, 0.0], 1.0), Err(Misplaced::NotFinite));
    assert_eq!(float_position([5e9, 0.0, 0.0], BINARY), Err(Misplaced::TooFar));
    assert_eq!(float_position([0.0, -f64::MAX, 0.0], BINARY), Err(Misplaced::TooFar));
    assert_eq!(float_position([0.0, f64::INFINITY, 0.0], BINARY), Err(Misplaced::NotFinite));
}

#[test]
fn a_finite_point_is_never_taken_for_one_that_is_not() {
    // With `nonfinite = "drop"` such a point would vanish.
    assert_eq!(float_position([1e305, 0.0, 0.0], BINARY), Err(Misplaced::TooFar));
    assert_eq!(float_position([0.0, 0.0, 0.0], f64::INFINITY), Err(Misplaced::TooFar));
    assert_eq!(
        float_position([-4294967295.0, 0.0, 0.0], BINARY).unwrap()[0],
        -0x3fff_ffff_c000_0000
    );
}

fn las(scale: f64, origin: f64) -> Schema {
    let axis = |name: &str, at| Dimension::new(name, Scalar::I32, at).scaled(scale, origin);
    Schema {
        layout: Layout { steps: true, ..Layout::plain("made") },
        endian: Endian::Little,
        stride: 12,
        dimensions: vec![axis("X", 0), axis("Y", 4), axis("Z", 8)],
    }
}

fn placed(lattice: &Lattice, schema: &Schema, stored: [i32; 3]) -> Position {
    let record: Vec<u8> = stored.iter().flat_map(|v| v.to_le_bytes()).collect();
    let mut position = None;
    lattice.place(schema, &record, |_, p| position = Some(p), |_, why| panic!("{why:?}"));
    position.unwrap()
}

#[test]
fn feet_over_metres_are_stretched_exactly() {
    let schema = las(0.01, 100.0);
    let lattice = Lattice::stretched(&schema, None, 0.3048).unwrap();
    assert_eq!((lattice.step, lattice.rounds()), (1e-6, false));
    let p = placed(&lattice, &schema, [1, -1, 10_000]);
    assert_eq!(p, [100_010_000, 99_990_000, 60_960_000], "200 ft are 60.96 m");
    let world = lattice.world(p);
    assert_eq!(world[..2], [100.01, 99.99]);
    assert!((world[2] - 200.0).abs() < 1e-12, "{world:?}");
}

#[test]
fn a_factor_without_a_decimal_step_rounds_half_to_even() {
    let schema = las(0.01, 0.0);
    let foot = 1200.0 / 3937.0;
    let lattice = Lattice::stretched(&schema, None, foot).unwrap();
    assert!(lattice.rounds());
    let p = placed(&lattice, &schema, [100, 0, 12_345]);
    assert_eq!(p[0], 1 << 30);
    assert_eq!(p[2], (12_345.0 * 0.01 * foot * BINARY).round_ties_even() as i64);
    assert!((lattice.world(p)[2] - 123.45).abs() < 1e-8);
}

#[test]
fn no_factor_changes_nothing() {
    for schema in [las(0.001, 5.25), las(1.0 / 3.0, 0.1)] {
        let (plain, one) = (Lattice::of(&schema, None), Lattice::stretched(&schema, None, 1.0));
        assert_eq!(plain.unwrap(), one.unwrap());
    }
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(Lattice::stretched(&las(0.01, 0.0), None, wrong).is_err());
    }
}

#[test]
fn a_height_that_overflows_by_the_factor_is_too_far_and_not_infinite() {
    let far = stretched(1e300, 1e10);
    assert_eq!(float_position([0.0, 0.0, far], BINARY), Err(Misplaced::TooFar));
    let none = stretched(f64::INFINITY, 0.5);
    assert_eq!(float_position([0.0, 0.0, none], BINARY), Err(Misplaced::NotFinite));
}

#[test]
fn an_offset_beside_the_steps_comes_back_in_the_unit_of_z() {
    let schema = las(0.01, 0.005);
    let lattice = Lattice::stretched(&schema, None, 10.0).unwrap();
    let world = lattice.world(placed(&lattice, &schema, [3, 4, 5]));
    for (axis, stored) in [3.0, 4.0, 5.0].into_iter().enumerate() {
        assert!((world[axis] - (stored * 0.01 + 0.005)).abs() < 1e-12, "{world:?}");
    }
}
