//! The JSON Schema of pipeline files, from the types that they are read into. Knows no kind of
//! stage by name.

use std::sync::Arc;

use schemars::generate::SchemaSettings;
use schemars::transform::{Transform, transform_subschemas};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde_json::{Map, Value, json};

use super::parameter::ParameterType;
use crate::graph::{LimitKeys, RunSettings};
use crate::quantity::COUNT_TEXT;
use crate::report::AcceptTable;
use crate::stage::{Format, FormatName, Formats, RoleName};

/// What a name is made of.
const NAME: &str = r"^[\p{L}\p{N}_-]+$";

/// A kind of stage.
pub(crate) struct StageTable {
    pub name: &'static str,
    pub about: &'static str,
    pub role: RoleName,
    /// The schema of its own keys.
    pub schema: Map<String, Value>,
    /// The schema of the keys that limit it; empty if it takes none.
    pub limits: Map<String, Value>,
}

/// What makes schemas of types. Those of types stand where they are used: editors do not follow
/// references well.
pub(crate) fn generator() -> SchemaGenerator {
    let settings = SchemaSettings::draft2020_12().with(|settings| {
        settings.inline_subschemas = true;
        settings.meta_schema = None;
    });
    settings.into_generator()
}

/// The schema of a table from that of its type: in words for people who read no Rust, each key with
/// its default.
pub(crate) fn table(
    mut schema: Schema,
    defaults: Map<String, Value>,
    formats: &Formats,
) -> Map<String, Value> {
    for (key, default) in defaults {
        let properties = schema.get_mut("properties").and_then(Value::as_object_mut);
        let property = properties.and_then(|keys| keys.get_mut(&key)?.as_object_mut());
        if let Some(property) = property {
            property.insert("default".to_owned(), default);
        }
    }
    Plain { formats }.transform(&mut schema);
    schema.as_object().cloned().unwrap_or_default()
}

/// The schema of the keys that limit a stage of that role.
pub(crate) fn limits(
    generator: &mut SchemaGenerator,
    formats: &Formats,
    role: RoleName,
) -> Map<String, Value> {
    let mut limits = table(LimitKeys::json_schema(generator), Map::new(), formats);
    let properties = limits.get_mut("properties").and_then(Value::as_object_mut);
    if let (Some(keys), true) = (properties, role != RoleName::OnTiles) {
        keys.shift_remove(LimitKeys::SEES);
    }
    limits
}

/// The schema of the table `[run]`.
pub(crate) fn run(generator: &mut SchemaGenerator, formats: &Formats) -> Map<String, Value> {
    table(RunSettings::json_schema(generator), Map::new(), formats)
}

/// The schema of the table `[accept]`.
pub(crate) fn accept(generator: &mut SchemaGenerator, formats: &Formats) -> Map<String, Value> {
    table(AcceptTable::json_schema(generator), Map::new(), formats)
}

/// Makes a schema one of what a file may say: no key is null there, and formats are those that are
/// registered.
struct Plain<'a> {
    formats: &'a Formats,
}

impl Transform for Plain<'_> {
    fn transform(&mut self, schema: &mut Schema) {
        transform_subschemas(self, schema);
        let Some(object) = schema.as_object_mut() else { return };
        object.retain(|key, value| key != "default" || !value.is_null());
        for key in ["type", "enum", "anyOf"] {
            without_null(object, key);
        }
        if let Some(Value::String(docs)) = object.get_mut("description") {
            *docs = for_readers(docs);
        }
        let names_format = object.get("format").is_some_and(|format| format == FormatName::SCHEMA);
        if names_format && self.formats.iter().next().is_some() {
            object.retain(|key, _| key != "type" && key != "format");
            object.insert("oneOf".to_owned(), self.formats.iter().map(format_word).collect());
        }
    }
}

/// A format as a word of a key.
fn format_word(format: &Arc<dyn Format>) -> Value {
    json!({ "const": format.name(), "description": format.about() })
}

/// Leaves null out of a list of types, values or schemas; one schema that is left takes the place
/// of its list.
fn without_null(object: &mut Map<String, Value>, key: &str) {
    let Some(Value::Array(list)) = object.get_mut(key) else { return };
    let is_null = |value: &Value| {
        value.is_null() || value == "null" || value.get("type").is_some_and(|t| t == "null")
    };
    let before = list.len();
    list.retain(|value| !is_null(value));
    if let ([one], true) = (&list[..], list.len() < before) {
        let one = one.clone();
        match (key, one) {
            ("type", one) => {
                object.insert(key.to_owned(), one);
            }
            ("anyOf", Value::Object(one)) => {
                object.shift_remove(key);
                for (key, value) in one {
                    object.entry(key).or_insert(value);
                }
            }
            _ => {}
        }
    }
}

/// A doc comment for people who read no Rust: up to its first example, links as their text.
fn for_readers(docs: &str) -> String {
    let docs = docs.split_once("```").map_or(docs, |(before, _)| before).trim();
    let mut out = String::new();
    let mut rest = docs;
    while let Some((before, after)) = rest.split_once("[`") {
        let Some((code, behind)) = after.split_once("`]") else { break };
        out += &format!("{before}`{code}`");
        rest = match behind.strip_prefix('(').and_then(|link| link.split_once(')')) {
            Some((_, behind)) => behind,
            None => behind,
        };
    }
    out + rest
}

/// The schema of a whole file with these tables; `definitions` are what the others refer to.
pub(crate) fn pipeline(
    [run, accept]: [Map<String, Value>; 2],
    stages: Vec<StageTable>,
    mut definitions: Map<String, Value>,
) -> Value {
    definitions.insert(
        "parameter".to_owned(),
        json!({
            "description": "A text with a parameter in it, such as \"${side}\".",
            "type": "string",
            "pattern": r"\$\{[^}]+\}",
        }),
    );
    let stages: Vec<Value> = stages.into_iter().map(stage).collect();
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A pipeline of pointmill",
        "type": "object",
        "properties": {
            "$schema": { "description": "This schema, for editors.", "type": "string" },
            "run": written(run),
            "accept": written(accept),
            "params": parameters(),
            "stage": {
                "description": "The stages. Each takes from the one above it, or from those that \
                                its `from` names.",
                "type": "array",
                "minItems": 1,
                "items": { "type": "object", "required": ["kind"], "oneOf": stages },
            },
        },
        "required": ["stage"],
        "additionalProperties": false,
        "$defs": definitions,
    })
}

/// The schema of the table `[params]`.
fn parameters() -> Value {
    let value = json!({ "type": ["string", "number", "boolean", "array"] });
    let declared = json!({
        "type": "object",
        "properties": {
            "type": { "description": "What it takes.", "enum": ParameterType::WORDS },
            "default": {
                "description": "What it is where it is not given; none: it must be given.",
                "type": value["type"],
            },
            "about": { "description": "What it is for.", "type": "string" },
            "choices": { "description": "All that it can be.", "type": "array", "items": value },
        },
        "additionalProperties": false,
    });
    json!({
        "description": "Parameters of the pipeline, whose values take the place of ${NAME} in \
                        others: each with its default, or a table of what it takes.",
        "type": "object",
        "propertyNames": { "pattern": NAME },
        "additionalProperties": { "anyOf": [value, declared] },
    })
}

/// The schema of a `[[stage]]`.
fn stage(table: StageTable) -> Value {
    let StageTable { name, about, role, schema: own, limits } = table;
    let mut keys = Map::new();
    keys.insert("kind".to_owned(), json!({ "description": about, "const": name }));
    keys.insert(
        "name".to_owned(),
        json!({
            "description": "A name by which `from` means the stage: letters, digits, - \
                            and _.",
            "type": "string",
            "pattern": NAME,
        }),
    );
    if role != RoleName::Source {
        keys.insert(
            "from".to_owned(),
            json!({
                "description": "The name of the stage above that it takes from, or a list of \
                                names; none: the one above.",
                "anyOf": [
                    { "type": "string" },
                    { "type": "array", "items": { "type": "string" }, "minItems": 1 },
                ],
            }),
        );
    }
    let (own, limits) = (written(own), written(limits));
    let description = own.get("description").and_then(Value::as_str).unwrap_or_default();
    let description = format!("{about}\n\n{description}").trim_end().to_owned();
    let mut required = vec![json!("kind")];
    required.extend(own.get("required").and_then(Value::as_array).cloned().unwrap_or_default());
    for table in [&own, &limits] {
        keys.extend(
            table.get("properties").and_then(Value::as_object).cloned().unwrap_or_default(),
        );
    }
    json!({
        "title": name,
        "description": description,
        "type": "object",
        "properties": keys,
        "required": required,
        "additionalProperties": false,
    })
}

/// The schema of a table as it is written in a file: counts may be texts such as "10k", and a
/// parameter may stand for every value.
fn written(table: Map<String, Value>) -> Map<String, Value> {
    let mut table = table;
    table.insert("additionalProperties".to_owned(), json!(false));
    let keys = table.get_mut("properties").and_then(Value::as_object_mut);
    for key in keys.into_iter().flat_map(|keys| keys.values_mut()) {
        if let Ok(key) = <&mut Schema>::try_from(key) {
            CountTexts.transform(key);
            or_parameter(key);
        }
    }
    table
}

/// Lets whole numbers be written as counts are.
struct CountTexts;

impl Transform for CountTexts {
    fn transform(&mut self, schema: &mut Schema) {
        transform_subschemas(self, schema);
        let Some(object) = schema.as_object_mut() else { return };
        let is_count = object
            .remove("format")
            .is_some_and(|format| format.as_str().is_some_and(|format| format.starts_with("uint")));
        if is_count {
            let kept = |key: &String| ["title", "description", "default"].contains(&key.as_str());
            let (mut outer, inner): (Map<_, _>, Map<_, _>) =
                std::mem::take(object).into_iter().partition(|(key, _)| kept(key));
            outer.insert(
                "anyOf".to_owned(),
                json!([inner, { "type": "string", "pattern": COUNT_TEXT }]),
            );
            *object = outer;
        }
    }
}

/// Lets a parameter stand in the place of a value, and of the items of a list.
fn or_parameter(schema: &mut Schema) {
    let Some(object) = schema.as_object_mut() else { return };
    let is_any_text = |schema: &Map<String, Value>| {
        schema.get("type").is_some_and(|sort| sort == "string") && !schema.contains_key("pattern")
    };
    if is_any_text(object) {
        return;
    }
    if let Some(Ok(items)) = object.get_mut("items").map(<&mut Schema>::try_from) {
        or_parameter(items);
    }
    let parameter = json!({ "$ref": "#/$defs/parameter" });
    if let Some(Value::Array(choices)) = object.get_mut("anyOf") {
        choices.iter_mut().filter_map(|choice| choice.get_mut("items")).for_each(|items| {
            if let Ok(items) = <&mut Schema>::try_from(items) {
                or_parameter(items);
            }
        });
        if !choices.iter().filter_map(Value::as_object).any(is_any_text) {
            choices.push(parameter);
        }
        return;
    }
    let kept = |key: &String| ["title", "description", "default"].contains(&key.as_str());
    let (mut outer, inner): (Map<_, _>, Map<_, _>) =
        std::mem::take(object).into_iter().partition(|(key, _)| kept(key));
    outer.insert("anyOf".to_owned(), json!([inner, parameter]));
    *object = outer;
}
