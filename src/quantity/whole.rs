//! Whole numbers within bounds.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserializer, Error, Unexpected, Visitor};
use serde::{Deserialize, Serialize, Serializer};

use super::parse_count;

/// A whole number from `LEAST` to `MOST`, also read from a float that is whole and from a text such
/// as `"1e1"`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Whole<const LEAST: u64, const MOST: u64>(u64);

impl<const LEAST: u64, const MOST: u64> Whole<LEAST, MOST> {
    /// This number, which is one of them; a constant that is not does not compile.
    pub(crate) const fn of(number: u64) -> Self {
        assert!(LEAST <= number && number <= MOST, "a number out of bounds");
        Whole(number)
    }

    /// The number.
    pub fn get(self) -> u64 {
        self.0
    }
}

impl<const LEAST: u64, const MOST: u64> Serialize for Whole<LEAST, MOST> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u64(self.0)
    }
}

impl<'de, const LEAST: u64, const MOST: u64> Deserialize<'de> for Whole<LEAST, MOST> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(WholeVisitor)
    }
}

impl<const LEAST: u64, const MOST: u64> JsonSchema for Whole<LEAST, MOST> {
    fn schema_name() -> Cow<'static, str> {
        format!("Whole_{LEAST}_{MOST}").into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "integer", "format": "uint64", "minimum": LEAST, "maximum": MOST })
    }
}

struct WholeVisitor<const LEAST: u64, const MOST: u64>;

impl<const LEAST: u64, const MOST: u64> Visitor<'_> for WholeVisitor<LEAST, MOST> {
    type Value = Whole<LEAST, MOST>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a whole number from {LEAST} to {MOST}")
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<Self::Value, E> {
        match (LEAST..=MOST).contains(&number) {
            true => Ok(Whole(number)),
            false => Err(E::invalid_value(Unexpected::Unsigned(number), &self)),
        }
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Self::Value, E> {
        match u64::try_from(number) {
            Ok(number) => self.visit_u64(number),
            Err(_) => Err(E::invalid_value(Unexpected::Signed(number), &self)),
        }
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Self::Value, E> {
        // Floats hold whole numbers below 2^53 apart.
        match number.fract() == 0.0 && number.abs() < (1u64 << 53) as f64 {
            true => self.visit_i64(number as i64),
            false => Err(E::invalid_value(Unexpected::Float(number), &self)),
        }
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        match parse_count(text) {
            Ok(number) => self.visit_u64(number),
            // A number that is too large for any type is told as it was written.
            Err(_) if text.parse::<f64>().is_ok() => {
                Err(E::invalid_value(Unexpected::Other(text), &self))
            }
            Err(_) => Err(E::invalid_value(Unexpected::Str(text), &self)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Whole;

    fn read(value: &str) -> Result<u64, String> {
        let read: Result<Whole<3, 2_000>, _> = serde_json::from_str(value);
        read.map(Whole::get).map_err(|e| e.to_string())
    }

    #[test]
    fn whole_numbers_are_read_however_they_are_written_and_refused_with_their_bounds() {
        for (text, number) in
            [("3", 3), ("2000", 2_000), ("1e1", 10), ("\"1e1\"", 10), ("\"2k\"", 2_000)]
        {
            assert_eq!(read(text), Ok(number), "{text}");
        }
        for wrong in ["2", "2001", "-3", "3.5", "1e30", "\"ten\"", "\"3k\"", "true", "[3]"] {
            assert!(read(wrong).unwrap_err().contains("a whole number from 3 to 2000"), "{wrong}");
        }
    }
}
