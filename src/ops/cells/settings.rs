//! What a pipeline file may say about cells.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserializer, Error, SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Serialize};

use crate::geom::angle::direction;
use crate::quantity::{Length, has_schema};

/// Side of the initial cells.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Side {
    /// The smallest power of two of lattice steps for which occupied cubes hold 32 positions on
    /// average.
    Auto,
    /// With a number to keep, 1.25 sides of a grid that keeps as many; else as `Auto`.
    Spread,
    /// Rounded to whole lattice steps.
    Length(Length),
}

/// Most sites of a division among several.
pub(super) const MOST_SEEDS: usize = 64;

/// How a cell is divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    /// Between the position with the smallest angle and that with the largest: each position goes
    /// with the nearer one, with the former if equally far (the paper's Algorithm 2).
    Voronoi,
    /// Among several sites at once, the positions at the quantiles of the angles, as many as
    /// `seeds`: each position goes with the nearest, of equally near ones with that of the smallest
    /// angle (the other reading of the paper's "Voronoi regions of points"). Two seeds are
    /// `"voronoi"` with `measure = "axis"`.
    Dirichlet,
    /// The cube in eight, down to one lattice position.
    Octant,
}

/// What the positions of a cell have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub enum By {
    /// Their class: no cell has positions of two, so that a reduction leaves points of each.
    Classification,
}

/// What the range of angles of a cell is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Measure {
    /// θ_max − θ_min of the angles to N (the paper's; blind to rotations about N). The sites of
    /// `split = "voronoi"` are the positions with θ_min and with θ_max.
    Axis,
    /// Twice the largest angle θ to the cell's own dominant axis. The sites are the position with
    /// the largest θ, and the one whose normal is farthest in angle from that position's (of equal
    /// ones the first in Morton order); an equally far position goes with the latter.
    Cone,
}

/// Direction N that angles are measured from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reference {
    /// (1, 0, 0).
    X,
    /// (0, 1, 0).
    Y,
    /// (0, 0, 1).
    Z,
    /// Any other, of any length above 0.
    Vector([f64; 3]),
}

impl Reference {
    /// The direction at length 1; none if there is none.
    pub(super) fn direction(self) -> Option<[f64; 3]> {
        match self {
            Reference::X => Some([1.0, 0.0, 0.0]),
            Reference::Y => Some([0.0, 1.0, 0.0]),
            Reference::Z => Some([0.0, 0.0, 1.0]),
            Reference::Vector(v) => direction(v),
        }
    }
}

impl Serialize for Reference {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Reference::X => serializer.serialize_str("x"),
            Reference::Y => serializer.serialize_str("y"),
            Reference::Z => serializer.serialize_str("z"),
            Reference::Vector(v) => v.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Reference {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ReferenceVisitor)
    }
}

has_schema!(Reference, "Reference", {
    "anyOf": [
        { "enum": ["x", "y", "z"] },
        { "type": "array", "items": { "type": "number" }, "minItems": 3, "maxItems": 3 },
    ],
});

struct ReferenceVisitor;

impl<'de> Visitor<'de> for ReferenceVisitor {
    type Value = Reference;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("\"x\", \"y\", \"z\", or a vector [x, y, z] that is not 0")
    }

    fn visit_str<E: Error>(self, word: &str) -> Result<Reference, E> {
        match word {
            "x" => Ok(Reference::X),
            "y" => Ok(Reference::Y),
            "z" => Ok(Reference::Z),
            _ => Err(E::invalid_value(Unexpected::Str(word), &self)),
        }
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut numbers: A) -> Result<Reference, A::Error> {
        let mut vector = [0.0; 3];
        let mut count = 0;
        while let Some(number) = numbers.next_element::<f64>()? {
            if let Some(component) = vector.get_mut(count) {
                *component = number;
            }
            count += 1;
        }
        if count != 3 {
            return Err(A::Error::invalid_length(count, &self));
        }
        match direction(vector) {
            Some(_) => Ok(Reference::Vector(vector)),
            None => {
                Err(A::Error::custom("a vector [x, y, z] is of finite numbers, one of them not 0"))
            }
        }
    }
}

impl Serialize for Side {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Side::Auto => serializer.serialize_str("auto"),
            Side::Spread => serializer.serialize_str("spread"),
            Side::Length(length) => length.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Side {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(SideVisitor)
    }
}

impl JsonSchema for Side {
    fn schema_name() -> Cow<'static, str> {
        "Side".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let length = generator.subschema_for::<Length>();
        json_schema!({ "anyOf": [length, { "enum": ["auto", "spread"] }] })
    }
}

struct SideVisitor;

impl Visitor<'_> for SideVisitor {
    type Value = Side;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a length above 0 in the scan's unit, \"auto\" or \"spread\"")
    }

    fn visit_f64<E: Error>(self, length: f64) -> Result<Side, E> {
        let read = Length::of(length).map(Side::Length);
        read.ok_or_else(|| E::invalid_value(Unexpected::Float(length), &self))
    }

    fn visit_i64<E: Error>(self, length: i64) -> Result<Side, E> {
        self.visit_f64(length as f64)
    }

    fn visit_u64<E: Error>(self, length: u64) -> Result<Side, E> {
        self.visit_f64(length as f64)
    }

    fn visit_str<E: Error>(self, word: &str) -> Result<Side, E> {
        match word {
            "auto" => Ok(Side::Auto),
            "spread" => Ok(Side::Spread),
            _ => Length::read(word)
                .map(Side::Length)
                .ok_or_else(|| E::invalid_value(Unexpected::Str(word), &self)),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::ops::Cells;
    use crate::quantity::Setting;

    fn refusal(text: &str) -> String {
        toml::from_str::<Cells>(text).expect_err(text).to_string()
    }

    #[test]
    fn an_empty_stage_has_the_documented_defaults() {
        let cells: Cells = toml::from_str("").unwrap();
        assert_eq!((cells.side, cells.max_angle()), (Side::Auto, 0.1));
        assert_eq!((cells.keep, cells.max_side, cells.min_spacing), (None, None, None));
        assert_eq!((cells.min_points.get(), cells.split), (1, Split::Voronoi));
        assert_eq!((cells.measure, cells.reference), (Measure::Axis, None));
    }

    #[test]
    fn angles_are_radians_or_have_a_unit() {
        for (text, radians) in [
            ("0.25", 0.25),
            ("1", 1.0),
            ("'180deg'", PI),
            ("'6°'", 6.0 / 180.0 * PI),
            ("'6 deg'", 6.0 / 180.0 * PI),
            ("'0.1rad'", 0.1),
        ] {
            let cells: Cells = toml::from_str(&format!("max_angle = {text}")).unwrap();
            let angle = cells.max_angle.unwrap().given().unwrap();
            assert_eq!(angle.in_radians(), radians, "{text}");
        }
        assert!(refusal("max_angle = 6").contains("write \"6deg\""));
        for wrong in ["-0.1", "nan", "inf", "1000", "'6'", "'deg'", "'181deg'", "'-1rad'", "true"] {
            assert!(refusal(&format!("max_angle = {wrong}")).contains("0 to pi"), "{wrong}");
        }
    }

    #[test]
    fn sides_are_lengths_or_auto() {
        let side = |text: &str| toml::from_str::<Cells>(&format!("side = {text}")).unwrap().side;
        assert_eq!(side("2"), Side::Length(Length::of(2.0).unwrap()));
        assert_eq!(side("0.25"), Side::Length(Length::of(0.25).unwrap()));
        assert_eq!(side("'5 cm'"), Side::Length(Length::read("5cm").unwrap()));
        assert_eq!((side("'auto'"), side("'spread'")), (Side::Auto, Side::Spread));
        for wrong in ["0", "-1.0", "nan", "inf", "'big'", "[1]"] {
            assert!(refusal(&format!("side = {wrong}")).contains("\"auto\""), "{wrong}");
        }
    }

    #[test]
    fn bounds_are_lengths() {
        let cells: Cells = toml::from_str("max_side = 2\nmin_spacing = 0.25").unwrap();
        assert_eq!(cells.max_side, Length::of(2.0));
        assert_eq!(cells.min_spacing, Length::of(0.25).map(Setting::Given));
        let spacing = |text: &str| {
            toml::from_str::<Cells>(&format!("min_spacing = {text}")).unwrap().min_spacing
        };
        assert_eq!((spacing("'auto'"), spacing("'none'")), (Some(Setting::Auto), None));
        assert_eq!(toml::from_str::<Cells>("max_side = 'none'").unwrap().max_side, None);
        assert_eq!(
            toml::from_str::<Cells>("max_side = '2 us-ft'").unwrap().max_side,
            Length::read("2us-ft")
        );
        for wrong in ["0", "-1.0", "nan", "inf", "'2 miles'", "'0m'", "'m'", "true"] {
            assert!(refusal(&format!("max_side = {wrong}")).contains("above 0"), "{wrong}");
            assert!(refusal(&format!("min_spacing = {wrong}")).contains("above 0"), "{wrong}");
        }
    }

    #[test]
    fn references_are_axes_or_vectors_of_any_length() {
        let direction = |text: &str| {
            let cells: Cells = toml::from_str(&format!("reference = {text}")).unwrap();
            cells.reference.unwrap().direction().unwrap()
        };
        assert_eq!(direction("'y'"), [0.0, 1.0, 0.0]);
        assert_eq!(direction("[0, 0, -7]"), [0.0, 0.0, -1.0]);
        assert_eq!(direction("[3.0, 0, 4]"), [0.6, 0.0, 0.8]);
        assert_eq!(direction("[1e-310, 0, 0]"), [1.0, 0.0, 0.0]);
        assert_eq!(direction("[1e308, 1e308, 0]"), direction("[1, 1, 0]"));
        let wrong =
            ["'w'", "[0, 0, 0]", "[1, 2]", "[1, 2, 3, 4]", "[nan, 0, 1]", "[inf, 0, 1]", "1"];
        for wrong in wrong {
            assert!(refusal(&format!("reference = {wrong}")).contains("[x, y, z]"), "{wrong}");
        }
    }

    #[test]
    fn a_reference_that_the_measure_does_not_use_is_refused() {
        let check = |text: &str| toml::from_str::<Cells>(text).unwrap().check();
        for used in ["reference = 'z'", "reference = 'x'\nmeasure = 'axis'", "measure = 'cone'"] {
            assert!(check(used).is_ok(), "{used}");
        }
        for unused in ["'x'", "'z'", "[1, 2, 3]"] {
            let (key, error) =
                check(&format!("reference = {unused}\nmeasure = 'cone'")).unwrap_err();
            assert_eq!(key, "reference");
            assert!(error.to_string().contains("needs `cells.measure = \"axis\"`"), "{error}");
        }
    }

    #[test]
    fn what_cells_do_not_know_is_refused() {
        assert!(refusal("measure = 'sphere'").contains("cone"));
        assert!(refusal("split = 'kd'").contains("octant"));
        assert!(refusal("min_points = 0").contains("nonzero"));
        assert!(refusal("max_angel = 0.1").contains("max_angle"));
    }
}
