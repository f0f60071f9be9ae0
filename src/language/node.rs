//! A pipeline file's values, each with its place in the text it was read from.

use std::fmt;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::mistake::Mistake;
use super::place::TextPlace;

/// A value and where it is written.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    /// Where it is written.
    pub place: TextPlace,
    /// What is written.
    pub value: NodeValue,
}

impl Node {
    /// The entries of a table; none of what is no table.
    pub fn entries(&self) -> &[KeyEntry] {
        match &self.value {
            NodeValue::Table(entries) => entries,
            _ => &[],
        }
    }

    /// Where the value of `key` is written, if this is a table that has it.
    pub fn at(&self, key: &str) -> Option<&TextPlace> {
        let NodeValue::Table(entries) = &self.value else { return None };
        entries.iter().find(|e| e.key == key).map(|e| &e.node.place)
    }
}

impl fmt::Display for Node {
    /// As it stands in a pipeline file, on one line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.value {
            // What JSON escapes in a text, TOML reads, too.
            NodeValue::Text(text) => serde_json::Value::from(text.as_str()).fmt(f),
            NodeValue::Whole(number) => number.fmt(f),
            NodeValue::Number(number) => write!(f, "{number:?}"),
            NodeValue::Flag(flag) => flag.fmt(f),
            NodeValue::List(list) => {
                let items: Vec<String> = list.iter().map(Node::to_string).collect();
                write!(f, "[{}]", items.join(", "))
            }
            NodeValue::Told => f.write_str("?"),
            NodeValue::Table(entries) => {
                let entry = |entry: &KeyEntry| format!("{} = {}", entry.key, entry.node);
                let entries: Vec<String> = entries.iter().map(entry).collect();
                write!(f, "{{ {} }}", entries.join(", "))
            }
        }
    }
}

/// What a key can be given.
#[derive(Debug, Clone)]
pub(crate) enum NodeValue {
    Text(String),
    Whole(i128),
    Number(f64),
    Flag(bool),
    List(Vec<Node>),
    Table(Vec<KeyEntry>),
    /// What is wrong, and told already.
    Told,
}

/// A key with its value.
#[derive(Debug, Clone)]
pub(crate) struct KeyEntry {
    /// The key.
    pub key: String,
    /// Where the key is written.
    pub at: TextPlace,
    /// Its value.
    pub node: Node,
}

/// Reads text `source` as a TOML table, or every place where it is none.
pub(crate) fn parse(text: &str, source: usize) -> Result<Vec<KeyEntry>, Vec<Mistake>> {
    let (table, errors) = DeTable::parse_recoverable(text);
    let mut mistakes: Vec<Mistake> = errors
        .iter()
        .map(|e| {
            let place = TextPlace::new(source, e.span().unwrap_or(text.len()..text.len()));
            let key = e.span().and_then(|span| text.get(span)).unwrap_or_default().trim();
            if e.message().starts_with("duplicate key") {
                let mistake = Mistake::new(place, format!("`{key}` is given twice"));
                return match key {
                    "kind" => {
                        mistake.note("a second stage begins with a line [[stage]] of its own")
                    }
                    _ => mistake,
                };
            }
            Mistake::new(place, format!("not TOML: {}", in_plain_words(e.message())))
        })
        .collect();
    let entries = entries(table.into_inner(), source, &mut mistakes);
    if mistakes.is_empty() { Ok(entries) } else { Err(mistakes) }
}

/// What the parser of TOML says, without the words of its grammar where users meet it most.
fn in_plain_words(message: &str) -> &str {
    match message {
        "string values must be quoted, expected literal string" => "a text stands in quotes",
        "invalid basic string, expected `\"`" => "the text has no `\"` at its end",
        "invalid literal string, expected `'`" => "the text has no `'` at its end",
        _ => message,
    }
}

/// Reads a value as it stands behind `=` in TOML; what is no TOML is a text (`out.laz`, `6deg`).
/// `shift` is where `text` begins in text `source`.
pub(crate) fn parse_value(text: &str, source: usize, shift: usize) -> Result<Node, Vec<Mistake>> {
    let place = TextPlace::new(source, shift..shift + text.len());
    let Ok(value) = DeValue::parse(text) else {
        return Ok(Node { place, value: NodeValue::Text(text.to_owned()) });
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

/// Reads a list in brackets, at `place`: as TOML, or each of its items as a value is read.
pub(crate) fn parse_list(text: &str, place: &TextPlace) -> Option<Node> {
    let inside = text.strip_prefix('[')?.strip_suffix(']')?;
    if let Ok(node @ Node { value: NodeValue::List(_), .. }) =
        parse_value(text, place.source, place.start)
    {
        return Some(node);
    }
    let items = inside.split(',').map(str::trim).filter(|item| !item.is_empty());
    let items = items.map(|item| {
        let mut node = parse_value(item, place.source, place.start).ok()?;
        move_to(&mut node, place);
        Some(node)
    });
    Some(Node { place: place.clone(), value: NodeValue::List(items.collect::<Option<_>>()?) })
}

/// The same value, given by the program rather than a text; `place` is all that points to it.
pub(crate) fn from_json(value: &serde_json::Value, place: &TextPlace) -> Node {
    use serde_json::Value as Json;
    let value = match value {
        Json::Null => NodeValue::Text(String::new()),
        Json::Bool(v) => NodeValue::Flag(*v),
        Json::Number(n) => match (n.as_i64(), n.as_u64()) {
            (Some(v), _) => NodeValue::Whole(v.into()),
            (_, Some(v)) => NodeValue::Whole(v.into()),
            _ => NodeValue::Number(n.as_f64().unwrap_or_default()),
        },
        Json::String(v) => NodeValue::Text(v.clone()),
        Json::Array(list) => NodeValue::List(list.iter().map(|v| from_json(v, place)).collect()),
        Json::Object(map) => NodeValue::Table(
            map.iter()
                .map(|(key, v)| KeyEntry {
                    key: key.clone(),
                    at: place.clone(),
                    node: from_json(v, place),
                })
                .collect(),
        ),
    };
    Node { place: place.clone(), value }
}

fn entries(table: DeTable<'_>, source: usize, mistakes: &mut Vec<Mistake>) -> Vec<KeyEntry> {
    let mut out = Vec::new();
    for (key, value) in table {
        let at = TextPlace::new(source, key.span());
        if let Some(node) = convert(value, source, mistakes) {
            out.push(KeyEntry { key: key.into_inner().into_owned(), at, node });
        }
    }
    out
}

fn convert(
    value: Spanned<DeValue<'_>>,
    source: usize,
    mistakes: &mut Vec<Mistake>,
) -> Option<Node> {
    let place = TextPlace::new(source, value.span());
    let refused = |message: &str| Mistake::new(place.clone(), message);
    let value = match value.into_inner() {
        DeValue::String(v) => NodeValue::Text(v.into_owned()),
        DeValue::Boolean(v) => NodeValue::Flag(v),
        DeValue::Integer(v) => match i128::from_str_radix(v.as_str(), v.radix()) {
            Ok(v) => NodeValue::Whole(v),
            Err(_) => {
                mistakes.push(refused("the whole number is too large"));
                return None;
            }
        },
        DeValue::Float(v) => match v.as_str().parse::<f64>() {
            Ok(v) if v.is_finite() => NodeValue::Number(v),
            _ => {
                mistakes.push(refused("no key takes a number that is not finite"));
                return None;
            }
        },
        DeValue::Datetime(_) => {
            mistakes.push(refused("no key takes a date").note("a text stands in quotes"));
            return None;
        }
        DeValue::Array(list) => NodeValue::List(
            list.into_iter().filter_map(|item| convert(item, source, mistakes)).collect(),
        ),
        DeValue::Table(table) => NodeValue::Table(entries(table, source, mistakes)),
    };
    Some(Node { place, value })
}

fn move_to(node: &mut Node, place: &TextPlace) {
    node.place = place.clone();
    match &mut node.value {
        NodeValue::List(list) => list.iter_mut().for_each(|item| move_to(item, place)),
        NodeValue::Table(entries) => {
            for entry in entries {
                entry.at = place.clone();
                move_to(&mut entry.node, place);
            }
        }
        _ => {}
    }
}
