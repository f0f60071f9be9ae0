//! Lengths: numbers in the scan's own unit, or with a unit of their own.

use std::fmt;

use serde::de::{Deserializer, Unexpected, Visitor};
use serde::{Deserialize, Serialize, Serializer};

use super::Figure;
use crate::point::{Horizontal, Units};
use crate::{Error, Result};

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unit {
    /// `mm`
    Millimetre,
    /// `cm`
    Centimetre,
    /// `m`
    Metre,
    /// `km`
    Kilometre,
    /// `in`
    Inch,
    /// `ft`, the international foot
    Foot,
    /// `us-ft`, the US survey foot, which is longer by two millionths
    SurveyFoot,
}

impl Unit {
    const ALL: [(&str, Unit, f64); 7] = [
        ("mm", Unit::Millimetre, 0.001),
        ("cm", Unit::Centimetre, 0.01),
        ("km", Unit::Kilometre, 1000.0),
        ("in", Unit::Inch, 0.0254),
        ("ft", Unit::Foot, 0.3048),
        ("us-ft", Unit::SurveyFoot, 1200.0 / 3937.0),
        ("m", Unit::Metre, 1.0),
    ];

    fn metres(self) -> f64 {
        Unit::ALL.iter().find(|(_, unit, _)| *unit == self).map_or(1.0, |(.., metres)| *metres)
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Unit::ALL.iter().find(|(_, unit, _)| unit == self).map_or("", |(name, ..)| name);
        f.write_str(name)
    }
}

/// A length above 0: in the scan's unit, or in the unit that it was given in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Length {
    value: f64,
    unit: Option<Unit>,
}

impl Length {
    /// A length in the scan's unit; none if it is not a finite number above 0.
    pub fn of(value: f64) -> Option<Length> {
        (value.is_finite() && value > 0.0).then_some(Length { value, unit: None })
    }

    /// Reads a length with a unit: `2m`, `5 cm`; none of anything else.
    pub fn read(text: &str) -> Option<Length> {
        Unit::ALL.iter().find_map(|(name, unit, _)| {
            let number = text.strip_suffix(name)?.trim().parse().ok()?;
            Length::of(number).map(|length| Length { unit: Some(*unit), ..length })
        })
    }

    /// The length in the scan's unit. One that has a unit of its own must be converted first.
    pub fn value(self) -> f64 {
        self.value
    }

    /// In metres, if it has a unit of its own.
    pub(crate) fn metres(self) -> Option<f64> {
        self.unit.map(|unit| self.value * unit.metres())
    }

    /// True if it has a unit of its own.
    pub fn has_unit(self) -> bool {
        self.unit.is_some()
    }

    /// The length so many times, to two digits, in the same unit; none if that is no length.
    pub fn about_times(self, factor: f64) -> Option<Length> {
        let value = format!("{:.1e}", self.value * factor).parse().ok()?;
        Length::of(value).map(|length| Length { unit: self.unit, ..length })
    }

    /// True if it is known to be less than `other`: lengths compare in one unit.
    pub fn is_less_than(self, other: Length) -> bool {
        match (self.unit, other.unit) {
            (Some(one), Some(two)) => self.value * one.metres() < other.value * two.metres(),
            (None, None) => self.value < other.value,
            _ => false,
        }
    }

    /// The length in the unit of x and y, which `units` tell.
    ///
    /// # Errors
    /// Fails where the length has a unit and the scan's is not known or is an angle; `key` is who
    /// takes it, as `cells.max_side`.
    pub fn in_scan(self, units: &Units, key: &str) -> Result<Length> {
        let Some(unit) = self.unit else { return Ok(self) };
        let told = |why: &str, help: String| {
            let assignment = format!("`{key} = \"{self}\"`");
            Err(Error::pipeline(format!("{assignment} has a unit, and {why}")).help(help))
        };
        let metres = self.value * unit.metres();
        match units.horizontal {
            Some(Horizontal::Metres(metres_in_one)) => {
                Ok(Length { value: metres / metres_in_one, unit: None })
            }
            None => told(
                "the scan does not say what its coordinates are in",
                format!("if they are in metres, give `{key} = {}`", Figure(metres)),
            ),
            Some(Horizontal::Degrees) => told(
                "the scan's x and y are in degrees, in which it is no length",
                "bring the scan to a projected reference system first".to_owned(),
            ),
        }
    }
}

impl fmt::Display for Length {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.unit {
            Some(unit) => write!(f, "{}{unit}", self.value),
            None => write!(f, "{}", self.value),
        }
    }
}

/// A number in the scan's unit, or text with a unit, as it was given.
impl Serialize for Length {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.unit {
            Some(_) => serializer.collect_str(self),
            None => serializer.serialize_f64(self.value),
        }
    }
}

impl<'de> Deserialize<'de> for Length {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let read = deserializer.deserialize_any(LengthVisitor { none: false })?;
        read.ok_or_else(|| serde::de::Error::custom("there is no length"))
    }
}

impl Length {
    /// Reads a length that can also be taken back: `"none"` is as good as no key.
    ///
    /// # Errors
    /// All but that word and a length.
    pub fn or_none<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Self>, D::Error> {
        deserializer.deserialize_any(LengthVisitor { none: true })
    }
}

struct LengthVisitor {
    /// True if `"none"` is a word, too.
    none: bool,
}

impl Visitor<'_> for LengthVisitor {
    type Value = Option<Length>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(
            "a length above 0 in the scan's unit, or with a unit such as \"2m\" or \"5cm\" (mm, \
             cm, m, km, in, ft or us-ft)",
        )?;
        f.write_str(if self.none { ", or \"none\"" } else { "" })
    }

    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<Self::Value, E> {
        Length::of(value).map(Some).ok_or_else(|| E::invalid_value(Unexpected::Float(value), &self))
    }

    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<Self::Value, E> {
        self.visit_f64(value as f64)
    }

    fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<Self::Value, E> {
        self.visit_f64(value as f64)
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Self::Value, E> {
        match Length::read(text) {
            None if self.none && text == "none" => Ok(None),
            None => Err(E::invalid_value(Unexpected::Str(text), &self)),
            length => Ok(length),
        }
    }

    fn visit_unit<E: serde::de::Error>(self) -> Result<Self::Value, E> {
        match self.none {
            true => Ok(None),
            false => Err(E::invalid_type(Unexpected::Unit, &self)),
        }
    }
}

super::has_schema!(Length, "Length", {
    "title": "a length (a number in the scan's unit, or such as `\"2m\"`)",
    "anyOf": [
        { "type": "number", "exclusiveMinimum": 0 },
        { "type": "string", "pattern": r"^\s*[-+.0-9eE]+\s*(mm|cm|km|in|us-ft|ft|m)$" },
    ],
});

#[cfg(test)]
mod tests {
    use super::*;

    fn metres(text: &str) -> Option<f64> {
        let units = Units { horizontal: Some(Horizontal::Metres(1.0)), ..Units::default() };
        Some(Length::read(text)?.in_scan(&units, "cells.side").ok()?.value())
    }

    #[test]
    fn lengths_are_read_in_every_unit() {
        for (text, length) in [
            ("2m", 2.0),
            ("5 cm", 0.05),
            ("3mm", 0.003),
            ("1km", 1000.0),
            ("10in", 0.254),
            ("10ft", 3.048),
            ("3937 us-ft", 1200.0),
            ("3937us-ft", 1200.0),
        ] {
            let read = metres(text).unwrap();
            assert!((read - length).abs() < 1e-12 * length, "{text}: {read}");
        }
        for wrong in ["2", "us-ft", "2 us ft", "2-ft", "0us-ft", "-1us-ft", "2 miles"] {
            assert_eq!(metres(wrong), None, "{wrong}");
        }
        assert_eq!(Length::read("2.5 us-ft").unwrap().to_string(), "2.5us-ft");
    }

    #[test]
    fn feet_of_a_survey_are_longer_than_feet() {
        let read = |text: &str| Length::read(text).unwrap();
        assert!(read("1ft").is_less_than(read("1us-ft")));
        assert!(!read("1us-ft").is_less_than(read("1ft")));
    }
}
