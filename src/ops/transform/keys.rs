//! What people write of a transformation: the rows of a matrix, an axis, factors.

use std::fmt;

use schemars::JsonSchema;
use serde::de::{Deserializer, Error, SeqAccess, Visitor};
use serde::{Deserialize, Serialize, Serializer};

use crate::quantity::{Turn, has_schema};

/// A 4 × 4 matrix by its rows: a list of 16 numbers, or of 4 lists of 4.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(transparent)]
pub struct MatrixRows(pub [[f64; 4]; 4]);

/// A turn about an axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    /// The axis: "x", "y" or "z", or the direction of another, `[x, y, z]`.
    pub axis: RotationAxis,
    /// By how much, counterclockwise if one looks against the axis: "30 deg", or radians.
    pub angle: Turn,
}

/// The direction of an axis, of any length above 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotationAxis(pub [f64; 3]);

/// By what x, y and z are multiplied: a number, or one for each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScaleFactors(pub [f64; 3]);

const AXES: [(&str, [f64; 3]); 3] =
    [("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])];

/// A number, or a list of them.
struct OneOrThree(Result<f64, Vec<f64>>);

impl<'de> Deserialize<'de> for OneOrThree {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumbersVisitor;

        impl<'de> Visitor<'de> for NumbersVisitor {
            type Value = OneOrThree;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number or a list of numbers")
            }

            fn visit_f64<E: Error>(self, number: f64) -> Result<OneOrThree, E> {
                Ok(OneOrThree(Ok(number)))
            }

            fn visit_i64<E: Error>(self, number: i64) -> Result<OneOrThree, E> {
                self.visit_f64(number as f64)
            }

            fn visit_u64<E: Error>(self, number: u64) -> Result<OneOrThree, E> {
                self.visit_f64(number as f64)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<OneOrThree, A::Error> {
                let mut numbers = Vec::new();
                while let Some(number) = list.next_element()? {
                    numbers.push(number);
                }
                Ok(OneOrThree(Err(numbers)))
            }
        }

        deserializer.deserialize_any(NumbersVisitor)
    }
}

/// All of `numbers` if they are `N` and finite.
fn finite<const N: usize>(numbers: &[f64], what: &str) -> Result<[f64; N], String> {
    if let Some(wrong) = numbers.iter().find(|number| !number.is_finite()) {
        return Err(format!("{what} has finite numbers, and {wrong} is not"));
    }
    <[f64; N]>::try_from(numbers)
        .map_err(|_| format!("{what} has {N} numbers, not {}", numbers.len()))
}

impl<'de> Deserialize<'de> for MatrixRows {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let list = Vec::<OneOrThree>::deserialize(deserializer)?;
        let rows = if list.iter().all(|entry| entry.0.is_ok()) {
            let all: Vec<f64> = list.into_iter().flat_map(|entry| entry.0).collect();
            finite::<16>(&all, "a matrix").map(|all| {
                std::array::from_fn(|row| std::array::from_fn(|column| all[4 * row + column]))
            })
        } else {
            let row = |entry: OneOrThree| match entry.0 {
                Err(row) => finite::<4>(&row, "a row of a matrix"),
                Ok(_) => Err("a matrix is 16 numbers, or 4 lists of 4".to_owned()),
            };
            let rows: Result<Vec<[f64; 4]>, String> = list.into_iter().map(row).collect();
            rows.and_then(|rows| {
                let told = |rows: Vec<_>| format!("a matrix has 4 rows, not {}", rows.len());
                <[[f64; 4]; 4]>::try_from(rows).map_err(told)
            })
        };
        rows.map(MatrixRows).map_err(D::Error::custom)
    }
}

impl Serialize for RotationAxis {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match AXES.iter().find(|(_, axis)| *axis == self.0) {
            Some((name, _)) => serializer.serialize_str(name),
            None => self.0.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for RotationAxis {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct AxisVisitor;

        impl<'de> Visitor<'de> for AxisVisitor {
            type Value = RotationAxis;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("\"x\", \"y\", \"z\" or a direction [x, y, z]")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<RotationAxis, E> {
                let found = AXES.iter().find(|(name, _)| *name == text);
                let wrong = || E::invalid_value(serde::de::Unexpected::Str(text), &self);
                found.map(|(_, axis)| RotationAxis(*axis)).ok_or_else(wrong)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<RotationAxis, A::Error> {
                let mut numbers = Vec::new();
                while let Some(number) = list.next_element()? {
                    numbers.push(number);
                }
                let axis = finite::<3>(&numbers, "an axis").map_err(A::Error::custom)?;
                match axis.iter().any(|number| *number != 0.0) {
                    true => Ok(RotationAxis(axis)),
                    false => Err(A::Error::custom("an axis of no length has no direction")),
                }
            }
        }

        deserializer.deserialize_any(AxisVisitor)
    }
}

impl Serialize for ScaleFactors {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            [x, y, z] if x == y && y == z => serializer.serialize_f64(x),
            all => all.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for ScaleFactors {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let factors = match OneOrThree::deserialize(deserializer)?.0 {
            Ok(factor) => finite::<3>(&[factor; 3], "a scale"),
            Err(factors) => finite::<3>(&factors, "a scale of three axes"),
        };
        let factors = factors.map_err(D::Error::custom)?;
        match factors.contains(&0.0) {
            true => Err(D::Error::custom("a scale of 0 puts all points into a plane")),
            false => Ok(ScaleFactors(factors)),
        }
    }
}

has_schema!(MatrixRows, "MatrixRows", {
    "title": "16 numbers, or 4 lists of 4",
    "anyOf": [
        { "type": "array", "items": { "type": "number" }, "minItems": 16, "maxItems": 16 },
        {
            "type": "array",
            "items": {
                "type": "array", "items": { "type": "number" }, "minItems": 4, "maxItems": 4
            },
            "minItems": 4,
            "maxItems": 4
        },
    ],
});

has_schema!(RotationAxis, "RotationAxis", {
    "anyOf": [
        { "enum": ["x", "y", "z"] },
        { "type": "array", "items": { "type": "number" }, "minItems": 3, "maxItems": 3 },
    ],
});

has_schema!(ScaleFactors, "ScaleFactors", {
    "title": "a number, or 3",
    "anyOf": [
        { "type": "number" },
        { "type": "array", "items": { "type": "number" }, "minItems": 3, "maxItems": 3 },
    ],
});

#[cfg(test)]
mod tests {
    use super::*;

    fn told<T: for<'de> Deserialize<'de> + Serialize>(text: &str) -> Result<String, String> {
        let read: T = serde_json::from_str(text).map_err(|error| error.to_string())?;
        Ok(serde_json::to_string(&read).unwrap())
    }

    #[test]
    fn what_is_written_of_a_transformation_is_read_and_shown() {
        let rows = "[[1.0,0.0,0.0,5.0],[0.0,1.0,0.0,6.0],[0.0,0.0,1.0,7.0],[0.0,0.0,0.0,1.0]]";
        let all = rows.replace("],[", ",").replace("[[", "[").replace("]]", "]");
        assert_eq!(told::<MatrixRows>(&all).unwrap(), rows);
        assert_eq!(told::<MatrixRows>(rows).unwrap(), rows);
        for (axis, shown) in
            [("\"y\"", "\"y\""), ("[0, 0, 1]", "\"z\""), ("[1,1,0]", "[1.0,1.0,0.0]")]
        {
            assert_eq!(told::<RotationAxis>(axis).unwrap(), shown);
        }
        assert_eq!(told::<ScaleFactors>("[2, 2, 2]").unwrap(), "2.0");
        assert_eq!(told::<ScaleFactors>("[1, 2, -3]").unwrap(), "[1.0,2.0,-3.0]");
    }

    #[test]
    fn what_is_no_transformation_is_told() {
        for (text, wrong) in [
            ("[1, 2, 3]", "a matrix has 16 numbers, not 3"),
            ("[[1, 2, 3, 4], 5]", "a matrix is 16 numbers, or 4 lists of 4"),
            ("[[1, 2, 3]]", "a row of a matrix has 4 numbers, not 3"),
            ("[[1, 2, 3, 4]]", "a matrix has 4 rows, not 1"),
        ] {
            assert!(told::<MatrixRows>(text).unwrap_err().contains(wrong), "{text}");
        }
        for (text, wrong) in [
            ("\"w\"", "\"x\", \"y\", \"z\" or a direction"),
            ("[0, 0, 0]", "no direction"),
            ("[0, 1]", "an axis has 3 numbers, not 2"),
        ] {
            assert!(told::<RotationAxis>(text).unwrap_err().contains(wrong), "{text}");
        }
        for (text, wrong) in
            [("0", "into a plane"), ("[1, 0, 1]", "into a plane"), ("[1, 2]", "has 3 numbers")]
        {
            assert!(told::<ScaleFactors>(text).unwrap_err().contains(wrong), "{text}");
        }
    }
}
