//! What there is to know of the tables of a pipeline file and their keys, for people: read from
//! their schemas, which are made from doc comments.

use serde_json::{Map, Value};

use crate::error::listed;
use crate::stage::RoleName;

/// A table of a pipeline file: a kind of stage, the settings of a run, or the keys that limit
/// stages. Texts are Markdown, in lines as they are written.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct TableDescription {
    /// The kind of the stage, `run` or `limits`.
    pub name: String,
    /// The role of the stage; none of what is no stage.
    pub role: Option<RoleName>,
    /// The key whose value stands right behind the kind in a pipeline of one line, if there is one.
    pub main: Option<&'static str>,
    /// What it is, in one sentence.
    pub about: String,
    /// All that is said of it.
    pub docs: String,
    /// Its keys, in order.
    pub keys: Vec<KeyDescription>,
    /// The keys that limit a stage to some records, which it takes besides its own.
    pub limits: Vec<KeyDescription>,
}

/// A key of a table.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct KeyDescription {
    /// Its name.
    pub name: String,
    /// What it takes, in words.
    pub value: String,
    /// True if it must be given.
    pub is_required: bool,
    /// What it is where it is not given; none where that is nothing.
    pub default: Option<Value>,
    /// What it is.
    pub docs: String,
    /// The words that it takes of which something is said.
    pub words: Vec<WordDescription>,
}

/// A word that a key takes.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct WordDescription {
    /// The word.
    pub word: String,
    /// What it means.
    pub docs: String,
}

impl TableDescription {
    /// Of a table with this schema.
    pub(crate) fn of(name: &str, about: &str, schema: &Map<String, Value>) -> Self {
        TableDescription {
            name: name.to_owned(),
            role: None,
            main: None,
            about: about.to_owned(),
            docs: text(schema, "description"),
            keys: keys(schema),
            limits: Vec::new(),
        }
    }

    /// Of a table whose documentation says first what it is.
    pub(crate) fn of_docs(name: &str, schema: &Map<String, Value>) -> Self {
        let docs = text(schema, "description");
        let about = docs.split_once(". ").map_or(docs.clone(), |(first, _)| format!("{first}."));
        TableDescription::of(name, &about, schema)
    }

    /// The same of a stage of this role, with its main key and those that limit it.
    pub(crate) fn of_stage(
        self,
        role: RoleName,
        main: Option<&'static str>,
        limits: &Map<String, Value>,
    ) -> Self {
        TableDescription { role: Some(role), main, limits: keys(limits), ..self }
    }

    /// Its own keys, then those that limit it.
    pub fn all_keys(&self) -> impl Iterator<Item = &KeyDescription> {
        self.keys.iter().chain(&self.limits)
    }
}

fn text(schema: &Map<String, Value>, key: &str) -> String {
    schema.get(key).and_then(Value::as_str).unwrap_or_default().to_owned()
}

fn keys(table: &Map<String, Value>) -> Vec<KeyDescription> {
    let required = table.get("required").and_then(Value::as_array);
    let key = |(name, schema): (&String, &Value)| {
        let schema = schema.as_object().cloned().unwrap_or_default();
        let mut words = Vec::new();
        collect_words(&schema, &mut words);
        KeyDescription {
            name: name.clone(),
            value: taken(&schema),
            is_required: required.is_some_and(|keys| keys.iter().any(|key| key == name)),
            default: schema.get("default").cloned(),
            docs: text(&schema, "description"),
            words,
        }
    };
    table.get("properties").and_then(Value::as_object).into_iter().flatten().map(key).collect()
}

/// The schemas of which a value must fit one, if a schema has any.
fn choices(schema: &Map<String, Value>) -> impl Iterator<Item = &Map<String, Value>> {
    let lists = ["anyOf", "oneOf"].into_iter().filter_map(|key| schema.get(key)?.as_array());
    lists.flatten().filter_map(Value::as_object)
}

fn collect_words(schema: &Map<String, Value>, words: &mut Vec<WordDescription>) {
    let docs = text(schema, "description");
    if let (Some(word), false) = (schema.get("const").and_then(Value::as_str), docs.is_empty()) {
        words.push(WordDescription { word: word.to_owned(), docs });
    }
    choices(schema).for_each(|choice| collect_words(choice, words));
}

/// What a key of that schema takes, in words.
fn taken(schema: &Map<String, Value>) -> String {
    listed(alternatives(schema, false), "or")
}

/// The same as a list of which any will do; `several` for the items of a list.
fn alternatives(schema: &Map<String, Value>, several: bool) -> Vec<String> {
    if let Some(title) = schema.get("title").and_then(Value::as_str) {
        return vec![title.to_owned()];
    }
    let one = schema.get("const").into_iter();
    let listed = schema.get("enum").and_then(Value::as_array).into_iter().flatten();
    let mut all: Vec<String> = one.chain(listed).map(|value| format!("`{value}`")).collect();
    all.extend(choices(schema).flat_map(|choice| alternatives(choice, several)));
    if all.is_empty() {
        all.push(sort(schema, several));
    }
    all
}

/// What a value of a type is.
fn sort(schema: &Map<String, Value>, several: bool) -> String {
    let count = |key| schema.get(key).and_then(Value::as_u64);
    let plural = |one: &str, more: &str| if several { more.to_owned() } else { one.to_owned() };
    match schema.get("type").and_then(Value::as_str) {
        Some("string") => plural("text", "texts"),
        Some("boolean") => "`true` or `false`".to_owned(),
        Some("integer") => {
            let bounds = match (count("minimum"), count("maximum")) {
                (None | Some(0), None) => String::new(),
                (None | Some(0), Some(most)) => format!(" to {most}"),
                (Some(least), None) => format!(" from {least}"),
                (Some(least), Some(most)) => format!(" from {least} to {most}"),
            };
            plural("a whole number", "whole numbers") + &bounds
        }
        Some("number") => {
            let bounds = match (schema.get("minimum"), schema.get("exclusiveMinimum")) {
                (Some(least), _) => format!(" from {least}"),
                (None, Some(below)) => format!(" above {below}"),
                (None, None) => String::new(),
            };
            plural("a number", "numbers") + &bounds
        }
        Some("array") => {
            let items = schema.get("items").and_then(Value::as_object);
            let items =
                items.map_or("values".into(), |items| listed(alternatives(items, true), "or"));
            match (count("minItems"), count("maxItems")) {
                (Some(3), Some(3)) => format!("three {items}"),
                _ => format!("a list of {items}"),
            }
        }
        Some("object") => plural("a table", "tables"),
        _ => plural("a value", "values"),
    }
}
