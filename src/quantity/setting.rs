//! A value that is given, or found in the scan.

use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::value::{
    BoolDeserializer, F64Deserializer, I64Deserializer, StrDeserializer, U64Deserializer,
};
use serde::de::{Deserializer, Error, IntoDeserializer, Visitor};
use serde::{Deserialize, Serialize, Serializer};

use super::schema::or_word;

/// A value that is given, or `"auto"`: found in the scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Setting<T> {
    /// Found in the scan.
    Auto,
    /// Given.
    Given(T),
}

impl<T: Copy> Setting<T> {
    /// The value, if it is given.
    pub fn given(self) -> Option<T> {
        match self {
            Setting::Auto => None,
            Setting::Given(value) => Some(value),
        }
    }

    /// True if it is to be found.
    pub fn is_auto(self) -> bool {
        matches!(self, Setting::Auto)
    }
}

impl<T> From<T> for Setting<T> {
    fn from(value: T) -> Self {
        Setting::Given(value)
    }
}

impl<T: fmt::Display> fmt::Display for Setting<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Setting::Auto => f.write_str("auto"),
            Setting::Given(value) => value.fmt(f),
        }
    }
}

impl<T: Serialize> Serialize for Setting<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Setting::Auto => serializer.serialize_str("auto"),
            Setting::Given(value) => value.serialize(serializer),
        }
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Setting<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let read = deserializer.deserialize_any(SettingVisitor { none: false, of: PhantomData })?;
        read.ok_or_else(|| D::Error::custom("there is no value"))
    }
}

impl<T: JsonSchema> JsonSchema for Setting<T> {
    fn schema_name() -> Cow<'static, str> {
        format!("Setting_{}", T::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        or_word(generator.subschema_for::<T>(), "auto")
    }
}

impl<T> Setting<T> {
    /// Reads a setting that a file can also take back: `"none"` is as good as no key.
    ///
    /// # Errors
    /// Those of `T`, for anything but the two words.
    pub fn or_none<'de, D>(deserializer: D) -> Result<Option<Self>, D::Error>
    where
        D: Deserializer<'de>,
        T: Deserialize<'de>,
    {
        deserializer.deserialize_any(SettingVisitor { none: true, of: PhantomData })
    }
}

/// Reads the words itself and leaves all else to `T`.
struct SettingVisitor<T> {
    /// True if `"none"` is a word, too.
    none: bool,
    of: PhantomData<T>,
}

impl<'de, T: Deserialize<'de>> Visitor<'de> for SettingVisitor<T> {
    type Value = Option<Setting<T>>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.none { "a value, \"auto\" or \"none\"" } else { "a value or \"auto\"" })
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        let inner: StrDeserializer<'_, E> = text.into_deserializer();
        match text {
            "auto" => Ok(Some(Setting::Auto)),
            "none" if self.none => Ok(None),
            _ => T::deserialize(inner).map(|value| Some(Setting::Given(value))),
        }
    }

    /// For `T` to say what it takes.
    fn visit_bool<E: Error>(self, flag: bool) -> Result<Self::Value, E> {
        let inner: BoolDeserializer<E> = flag.into_deserializer();
        T::deserialize(inner).map(|value| Some(Setting::Given(value)))
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Self::Value, E> {
        let inner: F64Deserializer<E> = number.into_deserializer();
        T::deserialize(inner).map(|value| Some(Setting::Given(value)))
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Self::Value, E> {
        let inner: I64Deserializer<E> = number.into_deserializer();
        T::deserialize(inner).map(|value| Some(Setting::Given(value)))
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<Self::Value, E> {
        let inner: U64Deserializer<E> = number.into_deserializer();
        T::deserialize(inner).map(|value| Some(Setting::Given(value)))
    }
}
