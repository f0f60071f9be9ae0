//! A pipeline file's values, each with its place in the text it was read from.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::mistake::Mistake;
use super::place::Place;

/// A value and where it is written.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    /// Where it is written.
    pub place: Place,
    /// What is written.
    pub value: Value,
}

impl Node {
    /// The entries of a table; none of what is no table.
    pub fn entries(&self) -> &[Entry] {
        match &self.value {
            Value::Table(entries) => entries,
            _ => &[],
        }
    }

    /// Where the value of `key` is written, if this is a table that has it.
    pub fn at(&self, key: &str) -> Option<&Place> {
        let Value::Table(entries) = &self.value else { return None };
        entries.iter().find(|e| e.key == key).map(|e| &e.node.place)
    }
}

/// What a key can be given.
#[derive(Debug, Clone)]
pub(crate) enum Value {
    Text(String),
    Whole(i128),
    Number(f64),
    Flag(bool),
    List(Vec<Node>),
    Table(Vec<Entry>),
}

/// A key with its value.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    /// The key.
    pub key: String,
    /// Where the key is written.
    pub at: Place,
    /// Its value.
    pub node: Node,
}

/// Reads text `source` as a TOML table, or every place where it is none.
pub(crate) fn parse(text: &str, source: usize) -> Result<Vec<Entry>, Vec<Mistake>> {
    let (table, errors) = DeTable::parse_recoverable(text);
    let mut mistakes: Vec<Mistake> = errors
        .iter()
        .map(|e| {
            let place = Place::new(source, e.span().unwrap_or(text.len()..text.len()));
            let mistake = Mistake::new(place, format!("not TOML: {}", e.message()));
            let key = e.span().and_then(|span| text.get(span)).unwrap_or_default();
            match e.message().starts_with("duplicate key") && key.trim() == "kind" {
                true => mistake.note("a second stage begins with a line [[stage]] of its own"),
                false => mistake,
            }
        })
        .collect();
    let entries = entries(table.into_inner(), source, &mut mistakes);
    if mistakes.is_empty() { Ok(entries) } else { Err(mistakes) }
}

/// Reads a value as it stands behind `=` in TOML; what is no TOML is a text (`out.laz`, `6deg`).
/// `shift` is where `text` begins in text `source`.
pub(crate) fn parse_value(text: &str, source: usize, shift: usize) -> Result<Node, Vec<Mistake>> {
    let place = Place::new(source, shift..shift + text.len());
    let Ok(value) = DeValue::parse(text) else {
        return Ok(Node { place, value: Value::Text(text.to_owned()) });
    };
    let mut mistakes = Vec::new();
    match convert(value, source, &mut mistakes) {
        Some(mut node) if mistakes.is_empty() => {
            move_to(&mut node, &place);
            Ok(node)
        }
        _ => Err(mistakes.into_iter().map(|m| m.moved_to(place.clone())).collect()),
    }
}

/// The same value, given by the program rather than a text; `place` is all that points to it.
pub(crate) fn from_json(value: &serde_json::Value, place: &Place) -> Node {
    use serde_json::Value as Json;
    let value = match value {
        Json::Null => Value::Text(String::new()),
        Json::Bool(v) => Value::Flag(*v),
        Json::Number(n) => match (n.as_i64(), n.as_u64()) {
            (Some(v), _) => Value::Whole(v.into()),
            (_, Some(v)) => Value::Whole(v.into()),
            _ => Value::Number(n.as_f64().unwrap_or_default()),
        },
        Json::String(v) => Value::Text(v.clone()),
        Json::Array(list) => Value::List(list.iter().map(|v| from_json(v, place)).collect()),
        Json::Object(map) => Value::Table(
            map.iter()
                .map(|(key, v)| Entry {
                    key: key.clone(),
                    at: place.clone(),
                    node: from_json(v, place),
                })
                .collect(),
        ),
    };
    Node { place: place.clone(), value }
}

fn entries(table: DeTable<'_>, source: usize, mistakes: &mut Vec<Mistake>) -> Vec<Entry> {
    let mut out = Vec::new();
    for (key, value) in table {
        let at = Place::new(source, key.span());
        if let Some(node) = convert(value, source, mistakes) {
            out.push(Entry { key: key.into_inner().into_owned(), at, node });
        }
    }
    out
}

fn convert(
    value: Spanned<DeValue<'_>>,
    source: usize,
    mistakes: &mut Vec<Mistake>,
) -> Option<Node> {
    let place = Place::new(source, value.span());
    let refused = |message: &str| Mistake::new(place.clone(), message);
    let value = match value.into_inner() {
        DeValue::String(v) => Value::Text(v.into_owned()),
        DeValue::Boolean(v) => Value::Flag(v),
        DeValue::Integer(v) => match i128::from_str_radix(v.as_str(), v.radix()) {
            Ok(v) => Value::Whole(v),
            Err(_) => {
                mistakes.push(refused("the whole number is too large"));
                return None;
            }
        },
        DeValue::Float(v) => match v.as_str().parse::<f64>() {
            Ok(v) if v.is_finite() => Value::Number(v),
            _ => {
                mistakes.push(refused("no key takes a number that is not finite"));
                return None;
            }
        },
        DeValue::Datetime(_) => {
            mistakes.push(refused("no key takes a date"));
            return None;
        }
        DeValue::Array(list) => Value::List(
            list.into_iter().filter_map(|item| convert(item, source, mistakes)).collect(),
        ),
        DeValue::Table(table) => Value::Table(entries(table, source, mistakes)),
    };
    Some(Node { place, value })
}

fn move_to(node: &mut Node, place: &Place) {
    node.place = place.clone();
    match &mut node.value {
        Value::List(list) => list.iter_mut().for_each(|item| move_to(item, place)),
        Value::Table(entries) => {
            for entry in entries {
                entry.at = place.clone();
                move_to(&mut entry.node, place);
            }
        }
        _ => {}
    }
}
