//! How the values of keys of `read` and `write` are read.

use std::fmt;

use schemars::{Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, de};

use crate::io::systems;
use crate::io::text::check_columns;
use crate::quantity::{Setting, Whole, or_word};

pub(super) fn texts(_: &mut SchemaGenerator) -> Schema {
    let text = json_schema!({ "type": "string" });
    json_schema!({ "anyOf": [text, { "type": "array", "items": text }] })
}

/// WKT, or EPSG codes that are known.
pub(super) fn some_crs<'de, D: Deserializer<'de>>(from: D) -> Result<Option<String>, D::Error> {
    let given = String::deserialize(from)?;
    systems::checked(&given).map(Some).map_err(de::Error::custom)
}

/// EPSG codes that are known.
pub(super) fn some_code<'de, D: Deserializer<'de>>(from: D) -> Result<Option<String>, D::Error> {
    let given = String::deserialize(from)?;
    systems::checked_code(&given).map(Some).map_err(de::Error::custom)
}

/// Numbers of scans, at least one.
pub(super) fn some_scans<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<Vec<Whole<1, 65_535>>>, D::Error> {
    let scans: Vec<Whole<1, 65_535>> = Vec::deserialize(from)?;
    match scans.is_empty() {
        true => Err(de::Error::custom("names no scan")),
        false => Ok(Some(scans)),
    }
}

/// Names, as a list or in one text.
pub(super) fn some_columns<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<Vec<String>>, D::Error> {
    let given = one_or_more(from)?;
    let names = given.iter().flat_map(|text| text.split([',', ' ']));
    let names: Vec<String> = names.map(str::trim).map(str::to_owned).collect();
    let names: Vec<String> = names.into_iter().filter(|name| !name.is_empty()).collect();
    check_columns(&names).map_err(de::Error::custom)?;
    Ok(Some(names))
}

pub(super) fn one_or_three(_: &mut SchemaGenerator) -> Schema {
    let above_0 = json_schema!({ "type": "number", "exclusiveMinimum": 0 });
    let three = json_schema!({ "type": "array", "items": above_0, "minItems": 3, "maxItems": 3 });
    json_schema!({ "anyOf": [above_0, three, { "const": "auto" }] })
}

pub(super) fn three_or_auto(_: &mut SchemaGenerator) -> Schema {
    let number = json_schema!({ "type": "number" });
    let three = json_schema!({ "type": "array", "items": number, "minItems": 3, "maxItems": 3 });
    or_word(three, "auto")
}

pub(super) fn one_or_more<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<String>, D::Error> {
    struct Paths;
    impl<'de> de::Visitor<'de> for Paths {
        type Value = Vec<String>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a path or a list of paths")
        }

        fn visit_str<E: de::Error>(self, path: &str) -> Result<Self::Value, E> {
            Ok(vec![path.to_owned()])
        }

        fn visit_seq<A: de::SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
            let mut paths = Vec::new();
            while let Some(path) = list.next_element()? {
                paths.push(path);
            }
            Ok(paths)
        }
    }
    from.deserialize_any(Paths)
}

pub(super) fn some_scale<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<Setting<[f64; 3]>>, D::Error> {
    struct Scale;
    impl<'de> de::Visitor<'de> for Scale {
        type Value = Setting<[f64; 3]>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a number above 0 without a unit, three of them, or \"auto\"")
        }

        fn visit_str<E: de::Error>(self, text: &str) -> Result<Self::Value, E> {
            match text {
                "auto" => Ok(Setting::Auto),
                _ => Err(E::invalid_value(de::Unexpected::Str(text), &self)),
            }
        }

        fn visit_i64<E: de::Error>(self, scale: i64) -> Result<Self::Value, E> {
            self.visit_f64(scale as f64)
        }

        fn visit_f64<E: de::Error>(self, scale: f64) -> Result<Self::Value, E> {
            match scale.is_finite() && scale > 0.0 {
                true => Ok(Setting::Given([scale; 3])),
                false => Err(E::invalid_value(de::Unexpected::Float(scale), &self)),
            }
        }

        fn visit_seq<A: de::SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
            let mut scale = [0.0; 3];
            for (i, axis) in scale.iter_mut().enumerate() {
                let next: Option<Positive> = list.next_element()?;
                *axis = next.ok_or_else(|| de::Error::invalid_length(i, &Scale))?.0;
            }
            Ok(Setting::Given(scale))
        }
    }
    from.deserialize_any(Scale).map(Some)
}

pub(super) fn some_offset<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<[f64; 3]>, D::Error> {
    let offset = <[f64; 3]>::deserialize(from)?;
    match offset.iter().find(|v| !v.is_finite()) {
        Some(&v) => Err(de::Error::invalid_value(de::Unexpected::Float(v), &"finite numbers")),
        None => Ok(Some(offset)),
    }
}

pub(super) fn offset_or_auto<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<Setting<[f64; 3]>>, D::Error> {
    struct Offset;
    impl<'de> de::Visitor<'de> for Offset {
        type Value = Setting<[f64; 3]>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("three finite numbers, or \"auto\"")
        }

        fn visit_str<E: de::Error>(self, text: &str) -> Result<Self::Value, E> {
            match text {
                "auto" => Ok(Setting::Auto),
                _ => Err(E::invalid_value(de::Unexpected::Str(text), &self)),
            }
        }

        fn visit_seq<A: de::SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error> {
            let offset = <[f64; 3]>::deserialize(de::value::SeqAccessDeserializer::new(list))?;
            match offset.iter().find(|v| !v.is_finite()) {
                Some(&v) => Err(de::Error::invalid_value(de::Unexpected::Float(v), &self)),
                None => Ok(Setting::Given(offset)),
            }
        }
    }
    from.deserialize_any(Offset).map(Some)
}

/// A number above 0, refused at its own place.
struct Positive(f64);

/// A number above 0.
pub(super) fn some_positive<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    Positive::deserialize(from).map(|number| Some(number.0))
}

impl<'de> Deserialize<'de> for Positive {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let number = f64::deserialize(from)?;
        match number.is_finite() && number > 0.0 {
            true => Ok(Positive(number)),
            false => {
                let found = de::Unexpected::Float(number);
                Err(de::Error::invalid_value(found, &"a number above 0"))
            }
        }
    }
}

/// Names, each once.
pub(super) fn names_once<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<String>, D::Error> {
    let given: Vec<String> = Vec::deserialize(from)?;
    let twice = given.iter().enumerate().find(|(n, name)| given[..*n].contains(name));
    match twice {
        None => Ok(given),
        Some((_, name)) => Err(de::Error::custom(format!("has {name} twice"))),
    }
}
