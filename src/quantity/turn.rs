//! Angles to turn by: of any size and either sign, in radians or in degrees.

use std::f64::consts::PI;
use std::fmt;

use serde::de::{Deserializer, Error, Unexpected, Visitor};
use serde::{Deserialize, Serialize, Serializer};

/// An angle to turn by, counterclockwise if it is above 0, that is shown as it was given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    value: f64,
    in_degrees: bool,
}

impl Turn {
    /// So many degrees; none if that is not finite.
    pub fn degrees(value: f64) -> Option<Turn> {
        value.is_finite().then_some(Turn { value, in_degrees: true })
    }

    /// So many radians; none if that is not finite.
    pub fn radians(value: f64) -> Option<Turn> {
        value.is_finite().then_some(Turn { value, in_degrees: false })
    }

    /// Sine and cosine; exactly 0, 1 or -1 where a whole number of quarter turns was given in
    /// degrees.
    pub fn sine_and_cosine(self) -> (f64, f64) {
        if !self.in_degrees {
            return libm::sincos(self.value);
        }
        let within = self.value.rem_euclid(360.0);
        match within / 90.0 {
            0.0 | 4.0 => (0.0, 1.0),
            1.0 => (1.0, 0.0),
            2.0 => (0.0, -1.0),
            3.0 => (-1.0, 0.0),
            _ => libm::sincos(within / 180.0 * PI),
        }
    }

    /// Reads an angle with a unit: `30deg`, `-90°`, `0.1 rad`.
    fn read(text: &str) -> Option<Turn> {
        let number = |text: &str| text.trim().parse::<f64>().ok();
        match text.strip_suffix("deg").or_else(|| text.strip_suffix('°')) {
            Some(text) => Turn::degrees(number(text)?),
            None => Turn::radians(number(text.strip_suffix("rad")?)?),
        }
    }
}

impl fmt::Display for Turn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.value, if self.in_degrees { "deg" } else { "" })
    }
}

/// A number of radians, or text with a unit, as it was given.
impl Serialize for Turn {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.in_degrees {
            true => serializer.collect_str(self),
            false => serializer.serialize_f64(self.value),
        }
    }
}

impl<'de> Deserialize<'de> for Turn {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(TurnVisitor)
    }
}

struct TurnVisitor;

impl Visitor<'_> for TurnVisitor {
    type Value = Turn;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an angle: text such as \"30 deg\", or radians such as 0.5")
    }

    fn visit_f64<E: Error>(self, radians: f64) -> Result<Turn, E> {
        Turn::radians(radians).ok_or_else(|| E::invalid_value(Unexpected::Float(radians), &self))
    }

    fn visit_i64<E: Error>(self, radians: i64) -> Result<Turn, E> {
        self.visit_f64(radians as f64)
    }

    fn visit_u64<E: Error>(self, radians: u64) -> Result<Turn, E> {
        self.visit_f64(radians as f64)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Turn, E> {
        Turn::read(text).ok_or_else(|| E::invalid_value(Unexpected::Str(text), &self))
    }
}

super::has_schema!(Turn, "Turn", {
    "title": "an angle (such as `\"30 deg\"`, or radians)",
    "anyOf": [
        { "type": "number" },
        { "type": "string", "pattern": r"^\s*[-+.0-9eE]+\s*(deg|°|rad)$" },
    ],
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_read_in_both_units_and_quarters_are_exact() {
        for (text, sine, cosine) in [
            ("\"90 deg\"", 1.0, 0.0),
            ("\"-90°\"", -1.0, 0.0),
            ("\"540deg\"", 0.0, -1.0),
            ("\"-720 deg\"", 0.0, 1.0),
            ("0", 0.0, 1.0),
            ("\"0rad\"", 0.0, 1.0),
        ] {
            let turn: Turn = serde_json::from_str(text).unwrap();
            assert_eq!(turn.sine_and_cosine(), (sine, cosine), "{text}");
            let written = serde_json::to_string(&turn).unwrap();
            assert_eq!(serde_json::from_str::<Turn>(&written).unwrap(), turn);
        }
        let near = |text: &str, sine: f64| {
            let turn: Turn = serde_json::from_str(text).unwrap();
            assert!((turn.sine_and_cosine().0 - sine).abs() < 1e-15, "{text}");
        };
        near("\"30 deg\"", 0.5);
        near("\"-330 deg\"", 0.5);
        near("\"0.5 rad\"", 0.5f64.sin());
        for wrong in ["\"30\"", "\"inf deg\"", "\"nan rad\"", "\"x deg\"", "true"] {
            assert!(serde_json::from_str::<Turn>(wrong).is_err(), "{wrong}");
        }
    }
}
