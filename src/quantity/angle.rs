//! Angles: radians, or numbers with a unit.

use std::f64::consts::PI;
use std::fmt;

use serde::de::{Deserializer, Error, Unexpected, Visitor};
use serde::{Deserialize, Serialize, Serializer};

/// An angle from 0 to π that remembers whether it was given in degrees, so that it is shown as it
/// was typed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Angle {
    radians: f64,
    degrees: Option<f64>,
}

impl Angle {
    /// An angle in radians; none if it is not from 0 to π.
    pub fn radians(radians: f64) -> Option<Angle> {
        (0.0..=PI).contains(&radians).then_some(Angle { radians, degrees: None })
    }

    /// An angle in degrees; none if it is not from 0 to 180.
    pub fn degrees(degrees: f64) -> Option<Angle> {
        let angle = Angle { radians: degrees / 180.0 * PI, degrees: Some(degrees) };
        (0.0..=180.0).contains(&degrees).then_some(angle)
    }

    /// In radians.
    pub fn in_radians(self) -> f64 {
        self.radians
    }

    /// In degrees: as it was given, where it was in degrees.
    pub(crate) fn in_degrees(self) -> f64 {
        self.degrees.unwrap_or(self.radians / PI * 180.0)
    }

    /// A figure in radians for a sentence, in the unit that `other` was given in.
    pub(crate) fn told_like(radians: f64, other: Angle) -> String {
        match other.degrees {
            Some(_) => format!("{:.1}deg", radians / PI * 180.0),
            None => format!("{radians:.2} rad"),
        }
    }

    /// For a sentence, with its unit.
    pub(crate) fn told(self) -> String {
        match self.degrees {
            Some(_) => self.to_string(),
            None => format!("{self} rad"),
        }
    }

    /// Reads an angle with a unit: `6deg`, `6°`, `0.1rad`.
    pub(crate) fn read(text: &str) -> Option<Angle> {
        let number = |text: &str| text.trim().parse::<f64>().ok();
        let degrees = text.strip_suffix("deg").or_else(|| text.strip_suffix('°'));
        match degrees {
            Some(text) => Angle::degrees(number(text)?),
            None => Angle::radians(number(text.strip_suffix("rad")?)?),
        }
    }
}

impl fmt::Display for Angle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.degrees {
            Some(degrees) => write!(f, "{degrees}deg"),
            None => write!(f, "{}", self.radians),
        }
    }
}

/// A number of radians, or text with a unit, as it was given.
impl Serialize for Angle {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.degrees {
            Some(_) => serializer.collect_str(self),
            None => serializer.serialize_f64(self.radians),
        }
    }
}

impl<'de> Deserialize<'de> for Angle {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(AngleVisitor)
    }
}

struct AngleVisitor;

impl Visitor<'_> for AngleVisitor {
    type Value = Angle;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an angle from 0 to pi: radians such as 0.1, or text such as \"6deg\"")
    }

    fn visit_f64<E: Error>(self, radians: f64) -> Result<Angle, E> {
        let degrees = radians > PI && radians <= 180.0;
        match Angle::radians(radians) {
            Some(angle) => Ok(angle),
            None if degrees => Err(E::custom(format!(
                "an angle is in radians, at most pi, and {radians} is more: \
                 for degrees write \"{radians}deg\""
            ))),
            None => Err(E::invalid_value(Unexpected::Float(radians), &self)),
        }
    }

    fn visit_i64<E: Error>(self, radians: i64) -> Result<Angle, E> {
        self.visit_f64(radians as f64)
    }

    fn visit_u64<E: Error>(self, radians: u64) -> Result<Angle, E> {
        self.visit_f64(radians as f64)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Angle, E> {
        Angle::read(text).ok_or_else(|| E::invalid_value(Unexpected::Str(text), &self))
    }
}

super::has_schema!(Angle, "Angle", {
    "title": "an angle (radians, or such as `\"6deg\"`)",
    "anyOf": [
        { "type": "number", "minimum": 0, "maximum": PI },
        { "type": "string", "pattern": r"^\s*[-+.0-9eE]+\s*(deg|°|rad)$" },
    ],
});
