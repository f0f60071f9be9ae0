//! What a key of a pipeline file takes, as JSON Schema: types that read texts say it themselves.
//!
//! The `title` of a schema is what it takes in words, as manual pages have it: code in backticks.

use std::borrow::Cow;
use std::marker::PhantomData;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

/// The texts that [`parse_count`](super::parse_count) reads, as a regular expression; its bounds
/// are left to it.
pub(crate) const COUNT_TEXT: &str = r"^\s*[0-9][0-9_]*(\.[0-9_]*)?\s*([kKMG]|[eE][0-9]+)?\s*$";

/// Gives a type that reads its value itself the schema of what it reads.
macro_rules! has_schema {
    ($type:ty, $name:literal, $schema:tt) => {
        impl schemars::JsonSchema for $type {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                $name.into()
            }

            fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
                schemars::json_schema!($schema)
            }
        }
    };
}

pub(crate) use has_schema;

/// What `or_none` reads: a `T`, or the word "none".
pub(crate) struct OrNone<T>(PhantomData<T>);

impl<T: JsonSchema> JsonSchema for OrNone<T> {
    fn schema_name() -> Cow<'static, str> {
        format!("OrNone_{}", T::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        or_word(generator.subschema_for::<T>(), "none")
    }
}

/// What `schema` takes, or a word.
pub(crate) fn or_word(schema: Schema, word: &str) -> Schema {
    json_schema!({ "anyOf": [schema, { "const": word }] })
}
