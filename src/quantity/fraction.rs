//! Parts of a whole: numbers up to 1, or percentages.

use std::fmt;

use serde::de::{Deserializer, Error, Unexpected, Visitor};
use serde::{Deserialize, Serialize, Serializer};

/// A part of a whole, above 0 and at most 1, that is shown as it was given: as a number or as a
/// percentage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fraction {
    value: f64,
    percent: Option<f64>,
}

impl Fraction {
    /// A part as a number; none if it is not above 0 and at most 1.
    pub fn of(value: f64) -> Option<Fraction> {
        (value > 0.0 && value <= 1.0).then_some(Fraction { value, percent: None })
    }

    /// The part as a number.
    pub fn value(self) -> f64 {
        self.value
    }

    /// Reads a percentage: `10%`, `2.5 %`.
    fn read(text: &str) -> Option<Fraction> {
        let percent: f64 = text.strip_suffix('%')?.trim().parse().ok()?;
        let fraction = Fraction::of(percent / 100.0)?;
        Some(Fraction { percent: Some(percent), ..fraction })
    }
}

impl fmt::Display for Fraction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.percent {
            Some(percent) => write!(f, "\"{percent}%\""),
            None => write!(f, "{}", self.value),
        }
    }
}

/// A number, or text with a percentage, as it was given.
impl Serialize for Fraction {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.percent {
            Some(percent) => serializer.collect_str(&format_args!("{percent}%")),
            None => serializer.serialize_f64(self.value),
        }
    }
}

impl<'de> Deserialize<'de> for Fraction {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(FractionVisitor)
    }
}

struct FractionVisitor;

impl Visitor<'_> for FractionVisitor {
    type Value = Fraction;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a part above 0 and at most 1, such as 0.1, or text such as \"10%\"")
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Fraction, E> {
        Fraction::of(value).ok_or_else(|| E::invalid_value(Unexpected::Float(value), &self))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Fraction, E> {
        self.visit_f64(value as f64)
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Fraction, E> {
        self.visit_f64(value as f64)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Fraction, E> {
        Fraction::read(text).ok_or_else(|| E::invalid_value(Unexpected::Str(text), &self))
    }
}

super::has_schema!(Fraction, "Fraction", {
    "title": "a part (up to 1, or such as `\"10%\"`)",
    "anyOf": [
        { "type": "number", "exclusiveMinimum": 0, "maximum": 1 },
        { "type": "string", "pattern": r"^[-+.0-9eE]+\s*%$" },
    ],
});

#[cfg(test)]
mod tests {
    use super::*;

    fn read(value: &str) -> Option<Fraction> {
        serde_json::from_str(value).ok()
    }

    #[test]
    fn parts_are_numbers_or_percentages_and_shown_as_they_were_given() {
        for (text, value) in [("0.1", 0.1), ("1", 1.0), ("\"10%\"", 0.1), ("\"2.5 %\"", 0.025)] {
            let fraction = read(text).unwrap();
            assert_eq!(fraction.value(), value, "{text}");
            assert_eq!(fraction.to_string(), text.replace(" %", "%"));
            let written = serde_json::to_string(&fraction).unwrap();
            assert_eq!(read(&written), Some(fraction), "{written}");
        }
        for wrong in ["0", "-0.1", "1.5", "10", "\"0%\"", "\"101%\"", "\"10\"", "\"nan%\"", "true"]
        {
            assert_eq!(read(wrong), None, "{wrong}");
        }
    }
}
