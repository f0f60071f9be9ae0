//! Expressions against their meaning written out in Rust.

use std::sync::Arc;

use proptest::prelude::*;

use super::*;
use crate::point::{Column, Columns, Dimension, Endian, Layout, PointBatch, Scalar, Schema, names};

const LIFT: Column<[f32; 3]> = Column::new("Lift", &["LiftX", "LiftY", "LiftZ"]);

fn schema(endian: Endian) -> Arc<Schema> {
    let dimensions = vec![
        Dimension::new("X", Scalar::I32, 0).scaled(0.01, 100.0),
        Dimension::new("Y", Scalar::I32, 0).scaled(0.01, 0.0),
        Dimension::new("Z", Scalar::F64, 4),
        Dimension::new("Intensity", Scalar::U16, 12),
        Dimension::new("Classification", Scalar::U8, 14).bits(0, 5),
        Dimension::new(names::WITHHELD, Scalar::U8, 14).bits(7, 1),
        Dimension::new("Reflectance", Scalar::F32, 15),
        Dimension::new("Pulse width", Scalar::I16, 19),
    ];
    Arc::new(Schema { layout: Layout::plain("made"), endian, stride: 21, dimensions })
}

/// A record: X in steps, Z, intensity, class with flag, reflectance, pulse width.
type Made = (i32, f64, u16, u8, f32, i16);

fn batch(endian: Endian, records: &[Made]) -> PointBatch {
    let mut batch = PointBatch::new(schema(endian), records.len().max(1));
    for &(x, z, intensity, class, reflectance, width) in records {
        macro_rules! bytes {
            ($($v:expr),*) => {
                [$(match endian {
                    Endian::Little => $v.to_le_bytes().to_vec(),
                    Endian::Big => $v.to_be_bytes().to_vec(),
                }),*].concat()
            };
        }
        batch.extend(&bytes!(x, z, intensity, class, reflectance, width));
    }
    let lift: Vec<[f32; 3]> = (0..records.len()).map(|i| [i as f32, f32::NAN, 0.5]).collect();
    batch.columns = Columns::default();
    batch.columns.set(&LIFT, &lift);
    batch
}

fn held(text: &str, batch: &PointBatch) -> Vec<bool> {
    let mut held = Vec::new();
    Condition::parse(text).unwrap().holds(batch, &mut held).unwrap();
    held
}

type Meaning = fn(f64, &Made, usize) -> bool;

/// Conditions beside what they mean for the world's X, a record, and its number.
const MEANINGS: [(&str, Meaning); 14] = [
    ("Classification == 2", |_, r, _| r.3 & 31 == 2),
    ("Classification in [2, 6, 9..12]", |_, r, _| matches!(r.3 & 31, 2 | 6 | 9..=12)),
    ("Classification not in 2..6 and not Withheld", |_, r, _| {
        !(2..=6).contains(&(r.3 & 31)) && r.3 >> 7 == 0
    }),
    ("Withheld or Intensity > 40_000", |_, r, _| r.3 >> 7 == 1 || r.2 > 40_000),
    ("X >= 100.5", |x, _, _| x >= 100.5),
    ("99 <= X < 101.25", |x, _, _| (99.0..101.25).contains(&x)),
    ("Z is nan or Z > 1e3", |_, r, _| r.1.is_nan() || r.1 > 1e3),
    ("not (Z < 0)", |_, r, _| r.1.is_nan() || r.1 >= 0.0),
    ("abs(Z) / 2 - 1 > -Intensity % 7 * 2", |_, r, _| {
        r.1.abs() / 2.0 - 1.0 > -f64::from(r.2) % 7.0 * 2.0
    }),
    ("max(Z, Intensity) == min(Intensity, Z)", |_, r, _| r.1 == f64::from(r.2)),
    ("Reflectance == 0.1", |_, r, _| r.4 == 0.1),
    ("Reflectance in [0.1, 5..6]", |_, r, _| r.4 == 0.1 || (5.0..=6.0).contains(&r.4)),
    ("`Pulse width` < 0 and LiftX >= 3 and LiftZ == 0.5", |_, r, i| r.5 < 0 && i >= 3),
    ("LiftY is not nan or floor(Z) != Z and Z in Intensity..Intensity + 9", |_, r, _| {
        let low = f64::from(r.2);
        r.1.floor() != r.1 && r.1 >= low && r.1 <= low + 9.0
    }),
];

fn made() -> impl Strategy<Value = Vec<Made>> {
    let z = prop_oneof![Just(f64::NAN), -2e3..2e3f64, (0..200i32).prop_map(f64::from)];
    let reflectance = prop_oneof![Just(0.1f32), Just(f32::NAN), -8.0..8.0f32];
    let intensity = prop_oneof![any::<u16>(), 0..200u16];
    prop::collection::vec((-200..200i32, z, intensity, any::<u8>(), reflectance, -3..3i16), 0..700)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..Default::default() })]
    #[test]
    fn conditions_hold_for_what_they_mean(records in made(), big in any::<bool>()) {
        let batch = batch(if big { Endian::Big } else { Endian::Little }, &records);
        for (text, meaning) in MEANINGS {
            let meant: Vec<bool> = records
                .iter()
                .enumerate()
                .map(|(i, r)| meaning(f64::from(r.0) * 0.01 + 100.0, r, i))
                .collect();
            prop_assert_eq!(held(text, &batch), meant, "{}", text);
        }
    }
}

#[test]
fn assignments_round_to_what_the_dimension_holds_and_refuse_what_it_does_not() {
    let records = [(0, 1.5, 1000, 0x82, 0.5, -1), (0, 2.5, 65535, 3, 0.5, 4)];
    let after = |text: &str, name: &str| {
        let mut batch = batch(Endian::Little, &records);
        Assignment::parse(text).unwrap().apply(&mut batch).map(|()| {
            let field = batch.schema().find(name).unwrap().clone();
            batch.iter().map(|r| field.world(r, Endian::Little)).collect::<Vec<f64>>()
        })
    };
    assert_eq!(after("Classification = 7", "Classification").unwrap(), [7.0, 7.0]);
    assert_eq!(after("Classification = 7", "Withheld").unwrap(), [1.0, 0.0], "bits beside it");
    assert_eq!(after("Intensity = Intensity / 256", "Intensity").unwrap(), [4.0, 256.0]);
    assert_eq!(after("Intensity = Z", "Intensity").unwrap(), [2.0, 2.0], "ties to even");
    assert_eq!(after("Withheld = LiftX > 0", "Withheld").unwrap(), [0.0, 1.0]);
    assert_eq!(after("`Pulse width` = -`Pulse width`", "Pulse width").unwrap(), [1.0, -4.0]);
    assert_eq!(after("Reflectance = 0.1", "Reflectance").unwrap(), [f64::from(0.1f32); 2]);
    for (text, told) in [
        ("Intensity = Intensity * 2", "is 131070 for a point, which Intensity (whole, 0 to 65535)"),
        ("Classification = 32", "is 32 for a point, which Classification (whole, 0 to 31)"),
        ("Intensity = LiftY", "is not a number for a point"),
        ("Reflectance = 1e39", "cannot hold"),
    ] {
        let error = after(text, "Z").unwrap_err();
        assert!(error.to_string().contains(told), "{error}");
    }
}

#[test]
fn what_is_wrong_is_told_with_its_place() {
    let schema = schema(Endian::Little);
    let names = Names { schema: &schema, columns: &[LIFT.kind()] };
    let told = |text: &str| {
        let fault = match Condition::read(text) {
            Ok(condition) => condition.bind_names(names).unwrap_err(),
            Err(fault) => fault,
        };
        (text[fault.span].to_owned(), fault.told, fault.help)
    };
    for (text, at, what, help) in [
        ("", "", "empty", ""),
        ("Intensity", "Intensity", "is a number", "Intensity > 0"),
        ("Intensity + 1", "Intensity + 1", "this is a number", "compare"),
        ("Classification = 2", "=", "assigns", "write `==`"),
        ("Classification == 2 && Z > 1", "&&", "no sign", "write `and`"),
        ("!Withheld", "!", "no sign", "write `not`"),
        ("Clasification == 2", "Clasification", "no dimension", "did you mean `Classification`?"),
        ("Lift > 2", "Lift", "several numbers", "LiftX, LiftY, LiftZ"),
        ("LiftW > 2", "LiftW", "no dimension", "did you mean `LiftX`?"),
        ("Z > 5m", "5m", "no number", "no units"),
        ("Z > 'a'", "'", "no sign", "backticks"),
        ("(Z > 1", "(", "closes", ""),
        ("Z in 2", "2", "followed by a list or a range", "in [2, 6]"),
        ("Z in []", "[]", "list is empty", ""),
        ("Z in 6..2", "6..2", "ends before", ""),
        ("Z is 2", "2", "followed by `nan`", "=="),
        ("1 < Z > 0", ">", "one direction", "`and`"),
        ("1 == Z == 0", "==", "one direction", "`and`"),
        ("Z > 1 Withheld", "Withheld", "no sign before", "`and`"),
        ("Z > and", "and", "stands where", ""),
        ("Z >", "", "ends too early", ""),
        ("sqr(Z) > 1", "sqr", "no function", "did you mean `sqrt`?"),
        ("min(Z) > 1", "min(Z)", "takes 2 numbers, not 1", ""),
        ("(Z > 1) + 1 > 2", "Z > 1", "true or false, and a number", ""),
        ("`Pulse", "`", "does not end", ""),
        ("Z > 1e999", "1e999", "too large", ""),
    ] {
        let (place, found, helps) = told(text);
        assert_eq!(place, at, "{text}: {found}");
        assert!(found.contains(what), "{text}: {found}");
        assert!(helps.contains(help), "{text}: {helps}");
    }
    assert!(told("Zed > 1").2.contains("Classification (whole, 0 to 31)"), "{:?}", told("Zed > 1"));
    let wrong = |text: &str| Assignment::read(text).unwrap_err().told;
    assert!(wrong("X = 3").contains("coordinate"));
    assert!(wrong("Intensity == 3").contains("compares"));
    assert!(wrong("3 = Intensity").contains("assigned"));
}

#[test]
fn no_text_exhausts_the_stack() {
    for text in ["(", "not ", "-", "abs("] {
        assert!(Condition::read(&text.repeat(100_000)).is_err());
    }
    let sum = format!("{}1 > 0", "1 + ".repeat(100_000));
    assert!(Condition::read(&sum).unwrap_err().told.contains("64"));
    let list = format!("Z in [{}1]", "1, ".repeat(10_000));
    assert!(Condition::read(&list).is_ok());
}
