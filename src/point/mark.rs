//! What a stage writes into a record instead of removing it.

use std::borrow::Cow;

use schemars::{JsonSchema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, de};

use super::names;
use super::{Dimension, Schema, Value};

/// How a stage marks its decision in the records, instead of removing any.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Mark {
    /// The key-point flag: set on what is kept, cleared on what would be removed.
    KeyPoint,
    /// The withheld flag: set on what would be removed.
    Withheld,
    /// This class for what would be removed: 7 (low noise) or 18 (high noise).
    Class(u8),
}

impl Mark {
    /// The dimension that it writes.
    pub fn dimension(self) -> &'static str {
        match self {
            Mark::KeyPoint => names::KEY_POINT,
            Mark::Withheld => names::WITHHELD,
            Mark::Class(_) => names::CLASSIFICATION,
        }
    }

    /// What it does to a record: None if it leaves it as it is.
    pub fn edit(self, kept: bool) -> Option<Edit> {
        match (self, kept) {
            (Mark::KeyPoint, true) => Some(Edit::SetKeyPoint),
            (Mark::KeyPoint, false) => Some(Edit::ClearKeyPoint),
            (Mark::Withheld, false) => Some(Edit::SetWithheld),
            (Mark::Class(7), false) => Some(Edit::LowNoise),
            (Mark::Class(_), false) => Some(Edit::HighNoise),
            (Mark::Withheld | Mark::Class(_), true) => None,
        }
    }
}

impl Serialize for Mark {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Mark::KeyPoint => to.serialize_str("key-point"),
            Mark::Withheld => to.serialize_str("withheld"),
            Mark::Class(class) => to.serialize_u8(*class),
        }
    }
}

impl<'de> Deserialize<'de> for Mark {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Marks;
        impl de::Visitor<'_> for Marks {
            type Value = Mark;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("\"key-point\", \"withheld\", or the class 7 or 18")
            }

            fn visit_str<E: de::Error>(self, word: &str) -> Result<Mark, E> {
                match word {
                    "key-point" => Ok(Mark::KeyPoint),
                    "withheld" => Ok(Mark::Withheld),
                    _ => Err(E::invalid_value(de::Unexpected::Str(word), &self)),
                }
            }

            fn visit_u64<E: de::Error>(self, class: u64) -> Result<Mark, E> {
                match class {
                    7 => Ok(Mark::Class(7)),
                    18 => Ok(Mark::Class(18)),
                    _ => Err(E::invalid_value(de::Unexpected::Unsigned(class), &self)),
                }
            }

            fn visit_i64<E: de::Error>(self, class: i64) -> Result<Mark, E> {
                match u64::try_from(class) {
                    Ok(class) => self.visit_u64(class),
                    Err(_) => Err(E::invalid_value(de::Unexpected::Signed(class), &self)),
                }
            }
        }
        from.deserialize_any(Marks)
    }
}

impl JsonSchema for Mark {
    fn schema_name() -> Cow<'static, str> {
        "Mark".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> schemars::Schema {
        json_schema!({ "enum": ["key-point", "withheld", 7, 18] })
    }
}

/// A change of one field of a record; a bit each in a set of edits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
#[expect(missing_docs, reason = "the names say what they change")]
#[non_exhaustive]
pub enum Edit {
    SetKeyPoint = 1,
    ClearKeyPoint = 2,
    SetWithheld = 4,
    LowNoise = 8,
    HighNoise = 16,
}

impl Edit {
    const ALL: [Edit; 5] = [
        Edit::SetKeyPoint,
        Edit::ClearKeyPoint,
        Edit::SetWithheld,
        Edit::LowNoise,
        Edit::HighNoise,
    ];

    /// The set `edits` and this one, which takes the place of another of the same field.
    #[must_use]
    pub fn added_to(self, edits: u8) -> u8 {
        let same_field = |other: &&Edit| other.dimension() == self.dimension();
        let replaced = Edit::ALL.iter().filter(same_field).fold(0, |all, edit| all | *edit as u8);
        edits & !replaced | self as u8
    }

    /// The edits of a set.
    pub fn of(edits: u8) -> impl Iterator<Item = Edit> {
        Edit::ALL.into_iter().filter(move |edit| edits & *edit as u8 != 0)
    }

    /// The dimension that it writes.
    pub fn dimension(self) -> &'static str {
        match self {
            Edit::SetKeyPoint | Edit::ClearKeyPoint => names::KEY_POINT,
            Edit::SetWithheld => names::WITHHELD,
            Edit::LowNoise | Edit::HighNoise => names::CLASSIFICATION,
        }
    }

    /// Writes it into `field` of `record`; false if the field cannot hold it.
    #[must_use]
    pub fn write(self, field: &Dimension, schema: &Schema, record: &mut [u8]) -> bool {
        let value = match self {
            Edit::SetKeyPoint | Edit::SetWithheld => 1,
            Edit::ClearKeyPoint => 0,
            Edit::LowNoise => 7,
            Edit::HighNoise => 18,
        };
        field.put(record, schema.endian, Value::Unsigned(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point::{Endian, Layout, Scalar};

    fn schema() -> Schema {
        let dimensions = vec![
            Dimension::new(names::CLASSIFICATION, Scalar::U8, 0),
            Dimension::new(names::WITHHELD, Scalar::U8, 1).bits(2, 1),
            Dimension::new(names::KEY_POINT, Scalar::U8, 1).bits(1, 1),
        ];
        Schema { layout: Layout::plain("made"), endian: Endian::Little, stride: 2, dimensions }
    }

    #[test]
    fn edits_change_their_field_and_no_other_bit() {
        let schema = schema();
        let edited = |edit: Edit, mut record: [u8; 2]| {
            let field = schema.find(edit.dimension()).unwrap();
            assert!(edit.write(field, &schema, &mut record));
            record
        };
        assert_eq!(edited(Edit::SetKeyPoint, [2, 0b1100]), [2, 0b1110]);
        assert_eq!(edited(Edit::ClearKeyPoint, [2, 0b1111]), [2, 0b1101]);
        assert_eq!(edited(Edit::SetWithheld, [2, 0b0010]), [2, 0b0110]);
        assert_eq!(edited(Edit::LowNoise, [2, 1]), [7, 1]);
        assert_eq!(edited(Edit::HighNoise, [2, 1]), [18, 1]);
    }

    #[test]
    fn an_edit_takes_the_place_of_another_of_its_field_alone() {
        let all = |edits: &[Edit]| edits.iter().fold(0, |set, edit| edit.added_to(set));
        let set = all(&[Edit::SetKeyPoint, Edit::LowNoise, Edit::SetWithheld, Edit::HighNoise]);
        let edits: Vec<Edit> = Edit::of(set).collect();
        assert_eq!(edits, [Edit::SetKeyPoint, Edit::SetWithheld, Edit::HighNoise]);
        assert!(Edit::of(all(&[Edit::SetKeyPoint, Edit::ClearKeyPoint])).eq([Edit::ClearKeyPoint]));
        assert_eq!(Edit::of(0).count(), 0);
    }
}
