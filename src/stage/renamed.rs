//! Dimensions that have another name, or another type, in an output.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use crate::point::Scalar;

/// A dimension and the name that it has in an output; as text `Amplitude=Intensity`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Renamed {
    /// Its name in the records.
    pub from: String,
    /// Its name in the output.
    pub to: String,
}

/// A dimension of an output and its type there; as text `Intensity=f32`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Retyped {
    /// Its name in the output.
    pub name: String,
    /// The type.
    pub scalar: Scalar,
}

/// The words for types.
const SCALARS: [(&str, Scalar); 10] = [
    ("u8", Scalar::U8),
    ("i8", Scalar::I8),
    ("u16", Scalar::U16),
    ("i16", Scalar::I16),
    ("u32", Scalar::U32),
    ("i32", Scalar::I32),
    ("u64", Scalar::U64),
    ("i64", Scalar::I64),
    ("f32", Scalar::F32),
    ("f64", Scalar::F64),
];

/// Both sides of the last `=`: a name may have one.
fn sides(text: &str) -> Option<(&str, &str)> {
    let (left, right) = text.rsplit_once('=')?;
    let (left, right) = (left.trim(), right.trim());
    (!left.is_empty() && !right.is_empty()).then_some((left, right))
}

impl FromStr for Renamed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (from, to) = sides(text).ok_or_else(|| {
            format!("`{text}` is not a name, `=` and a new name, such as `Amplitude=Intensity`")
        })?;
        Ok(Renamed { from: from.to_owned(), to: to.to_owned() })
    }
}

impl FromStr for Retyped {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, word) = sides(text).ok_or_else(|| {
            format!("`{text}` is not a name, `=` and a type, such as `Intensity=f32`")
        })?;
        let found = SCALARS.iter().find(|(known, _)| *known == word);
        let (_, scalar) = found.ok_or_else(|| {
            let known: Vec<&str> = SCALARS.iter().map(|(word, _)| *word).collect();
            format!("`{word}` is no type: types are {}", known.join(", "))
        })?;
        Ok(Retyped { name: name.to_owned(), scalar: *scalar })
    }
}

impl fmt::Display for Renamed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.from, self.to)
    }
}

impl fmt::Display for Retyped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = SCALARS.iter().find(|(_, scalar)| *scalar == self.scalar);
        write!(f, "{}={}", self.name, word.map_or("", |(word, _)| word))
    }
}

macro_rules! as_text {
    ($of:ty) => {
        impl Serialize for $of {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.collect_str(self)
            }
        }

        impl<'de> Deserialize<'de> for $of {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
            }
        }

        impl JsonSchema for $of {
            fn schema_name() -> Cow<'static, str> {
                stringify!($of).into()
            }

            fn inline_schema() -> bool {
                true
            }

            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({ "type": "string" })
            }
        }
    };
}

as_text!(Renamed);
as_text!(Retyped);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_types_are_read_as_they_are_written() {
        for text in ["Amplitude=Intensity", "a b=c", "a=b=c"] {
            assert_eq!(text.parse::<Renamed>().map(|renamed| renamed.to_string()), Ok(text.into()));
        }
        for (word, _) in SCALARS {
            let text = format!("X={word}");
            assert_eq!(text.parse::<Retyped>().map(|retyped| retyped.to_string()), Ok(text));
        }
        for text in ["", "a", "=b", "a=", " = "] {
            assert!(text.parse::<Renamed>().unwrap_err().contains("Amplitude=Intensity"), "{text}");
            assert!(text.parse::<Retyped>().unwrap_err().contains("Intensity=f32"), "{text}");
        }
        assert!("X=double".parse::<Retyped>().unwrap_err().contains("types are u8,"));
    }
}
