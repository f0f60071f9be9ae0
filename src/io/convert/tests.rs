use super::*;
use crate::point::{Bits, Layout};

const SCALARS: [Scalar; 10] = [
    Scalar::U8,
    Scalar::I8,
    Scalar::U16,
    Scalar::I16,
    Scalar::U32,
    Scalar::I32,
    Scalar::U64,
    Scalar::I64,
    Scalar::F32,
    Scalar::F64,
];

/// Numbers from everywhere: small ones, odd ones, the ends of types, all bits.
fn numbers(mut seed: u64) -> impl FnMut() -> [u8; 8] {
    move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let high = seed >> 33;
        let few = (high >> 3) as i64 % 200 - 100;
        match high % 8 {
            0 => few.to_le_bytes(),
            1 => (few as f64).to_le_bytes(),
            2 => (few as f64 / 4.0).to_le_bytes(),
            3 => (u64::from((few as f32 * 0.5).to_bits())).to_le_bytes(),
            4 => [0, 1, 0x7f, 0x80, 0xff][high as usize % 5..][..1].repeat(8).try_into().unwrap(),
            5 => (few as f64 * 1e300 * few as f64).to_be_bytes(),
            6 => (few as f64).to_be_bytes(),
            _ => seed.wrapping_mul(seed | 1).to_le_bytes(),
        }
    }
}

/// One field called `name`, behind a byte that belongs to no field.
fn one_field(name: &str, field: Dimension, endian: Endian) -> Schema {
    let stride = 1 + field.scalar.size();
    let field = Dimension { name: name.to_owned(), offset: 1, ..field };
    Schema { layout: Layout::plain("made"), endian, stride, dimensions: vec![field] }
}

/// All roads of one pair of fields agree, block for block; returns how many blocks went field by
/// field.
fn agree(from: &Schema, to: &Schema, seed: u64) -> usize {
    let projection = Projection::new(from, to, &[]).unwrap();
    let mut next = numbers(seed);
    let mut by_field = 0;
    for len in [1, 1, 1, 2, 3, BLOCK] {
        let records: Vec<u8> =
            (0..len).flat_map(|_| [&[7], &next()[..from.stride - 1]].concat()).collect();
        let (mut one, mut two) = (vec![9; len * to.stride], vec![8; len * to.stride]);
        let (mut rounded, mut slowly) = (vec![0.0; len], vec![0.0; len]);
        let slow = projection.one_by_one(0, &records, &mut one, &mut slowly);
        if projection.block(&records, &mut two, &mut rounded) {
            assert!(slow.is_ok(), "{from:?} to {to:?}: {slow:?}");
            assert_eq!((&one, &slowly), (&two, &rounded), "{from:?} to {to:?}");
            by_field += 1;
        }
        let whole = projection.project_into(&records, &mut two);
        assert_eq!(slow.is_ok(), whole.is_ok());
        assert!(slow.is_err() || one == two);
    }
    by_field
}

#[test]
fn field_by_field_gives_what_record_by_record_gives() {
    let mut by_field = 0;
    let scaled = [
        (1.0, 0.0, 1.0, 0.0),
        (0.01, 5.0, 1.0, 0.0),
        (1.0, 0.0, 0.5, -3.0),
        (0.25, 0.0, 0.006, 1e7),
    ];
    for (i, from) in SCALARS.into_iter().enumerate() {
        for (j, to) in SCALARS.into_iter().enumerate() {
            for (k, (scale, origin, to_scale, to_origin)) in scaled.into_iter().enumerate() {
                for (name, order) in [("X", Endian::Little), ("Other", Endian::Big)] {
                    let source = Dimension::new("", from, 0).scaled(scale, origin);
                    let target = Dimension::new("", to, 0).scaled(to_scale, to_origin);
                    for other in [Endian::Little, Endian::Big] {
                        let (source, target) = (source.clone(), target.clone());
                        let (source, target) =
                            (one_field(name, source, order), one_field(name, target, other));
                        for round in 0..8 {
                            by_field += agree(
                                &source,
                                &target,
                                (i * 1000 + j * 100 + k * 10 + round) as u64,
                            );
                        }
                    }
                }
            }
        }
    }
    assert!(by_field > 10_000, "{by_field}");
}

#[test]
fn bits_of_bytes_agree_both_ways() {
    let mut by_field = 0;
    for (shift, width) in [(0, 3), (3, 3), (7, 1), (4, 2), (0, 8), (1, 7)] {
        let bits =
            Dimension { bits: Some(Bits { shift, width }), ..Dimension::new("", Scalar::U8, 0) };
        let other = Dimension { bits: Some(Bits { shift: 1, width: 5 }), ..bits.clone() };
        for scalar in SCALARS {
            let plain = one_field("a", Dimension::new("", scalar, 0), Endian::Little);
            let bits = one_field("a", bits.clone(), Endian::Little);
            let other = one_field("a", other.clone(), Endian::Little);
            for seed in 0..50 {
                by_field += agree(&plain, &bits, seed) + agree(&bits, &plain, seed);
                by_field += agree(&bits, &other, seed);
            }
        }
    }
    assert!(by_field > 1000, "{by_field}");
}
