//! Which records a stage is limited to, by class and flags, and what a stage writes into a record
//! instead of removing it.

use serde::{Deserialize, Deserializer, Serialize, de};

use super::names;
use super::{Dimension, Schema, Value};

/// One of the flags that LAS has for every record (LAS 1.4 R15, tables 8 and 16).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Flag {
    /// Not to be used in processing.
    Withheld,
    /// Within the overlap of two or more swaths.
    Overlap,
    /// Made by another technique than the scan.
    Synthetic,
    /// One of the points that describe the surface and are to be kept when thinning.
    KeyPoint,
}

impl Flag {
    /// The dimension that holds it.
    pub fn dimension(self) -> &'static str {
        match self {
            Flag::Withheld => names::WITHHELD,
            Flag::Overlap => names::OVERLAP,
            Flag::Synthetic => names::SYNTHETIC,
            Flag::KeyPoint => names::KEY_POINT,
        }
    }
}

/// Records by class and flags; by default all of them.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Selection {
    /// Classes of the records; none: whatever their class.
    pub classes: Vec<u8>,
    /// Flags that must be set.
    pub with: Vec<Flag>,
    /// Flags that must not be set.
    pub without: Vec<Flag>,
}

impl Selection {
    /// True if it leaves no record out.
    pub fn is_all(&self) -> bool {
        self.classes.is_empty() && self.with.is_empty() && self.without.is_empty()
    }

    /// Dimensions that it reads.
    pub fn reads(&self) -> Vec<&'static str> {
        let flags = self.with.iter().chain(&self.without).map(|flag| flag.dimension());
        let class = (!self.classes.is_empty()).then_some(names::CLASSIFICATION);
        class.into_iter().chain(flags).collect()
    }

    /// Whether it holds `record`; a dimension that the records do not have counts as 0.
    pub fn holds(&self, schema: &Schema, record: &[u8]) -> bool {
        let value = |name| match schema.find(name).map(|d| d.get(record, schema.endian)) {
            Some(Value::Unsigned(value)) => value,
            Some(Value::Signed(value)) => u64::try_from(value).unwrap_or(u64::MAX),
            Some(other) => other.as_f64() as u64,
            None => 0,
        };
        let is_set = |flag: &Flag| value(flag.dimension()) != 0;
        (self.classes.is_empty()
            || self.classes.iter().any(|&class| value(names::CLASSIFICATION) == u64::from(class)))
            && self.with.iter().all(is_set)
            && !self.without.iter().any(is_set)
    }
}

/// How a stage marks its decision in the records, instead of removing any.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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

/// A change of one field of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
#[allow(missing_docs, reason = "the names say what they change")]
pub enum Edit {
    SetKeyPoint = 1,
    ClearKeyPoint = 2,
    SetWithheld = 3,
    LowNoise = 4,
    HighNoise = 5,
}

impl Edit {
    /// The edit with this number; None for 0, which changes nothing, and numbers that are none.
    pub fn of(code: u8) -> Option<Edit> {
        use Edit::*;
        [SetKeyPoint, ClearKeyPoint, SetWithheld, LowNoise, HighNoise]
            .into_iter()
            .find(|edit| *edit as u8 == code)
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
        Schema { layout: Layout::Ply, endian: Endian::Little, stride: 2, dimensions }
    }

    #[test]
    fn a_selection_holds_what_its_classes_and_flags_say() {
        let classes = Selection { classes: vec![2, 6], ..Selection::default() };
        assert!(classes.holds(&schema(), &[2, 0]) && classes.holds(&schema(), &[6, 255]));
        assert!(!classes.holds(&schema(), &[5, 0]));
        let with = Selection { with: vec![Flag::KeyPoint], ..Selection::default() };
        assert!(with.holds(&schema(), &[0, 2]) && !with.holds(&schema(), &[0, 4]));
        let without = Selection { without: vec![Flag::Withheld], ..Selection::default() };
        assert!(without.holds(&schema(), &[0, 2]) && !without.holds(&schema(), &[0, 4]));
        // What the records do not have is not set.
        let overlap = Selection { without: vec![Flag::Overlap], ..Selection::default() };
        assert!(overlap.holds(&schema(), &[0, 0]));
        assert!(Selection::default().is_all() && !overlap.is_all());
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
        for code in 0..=255 {
            assert_eq!(
                Edit::of(code).map_or(0, |edit| edit as u8),
                if code < 6 { code } else { 0 }
            );
        }
    }
}
