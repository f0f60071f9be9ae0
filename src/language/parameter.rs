//! What a parameter of a pipeline is and takes.

use serde::Deserialize;

use super::node;
use super::node::{Node, NodeValue};
use super::place::TextPlace;
use crate::quantity::parse_count;

/// A parameter that a pipeline declares under `[params]`.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// What it takes.
    pub takes: ParameterType,
    /// The value that it has where none is given; None if one must be given.
    pub default: Option<String>,
    /// The values that it can have; none: all of its type.
    pub choices: Vec<String>,
    /// What it is for.
    pub about: String,
}

/// What a parameter takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ParameterType {
    /// Any text.
    Text,
    /// A text that is not empty.
    Path,
    /// A number, without a unit.
    Number,
    /// A number, or one with a unit, such as `5 cm`.
    Measure,
    /// A whole number; as a text also such as `10k`.
    Whole,
    /// True or false.
    Flag,
    /// A list: `[a, b]`.
    List,
}

impl ParameterType {
    /// The names of all, as pipelines have them.
    pub(super) const WORDS: [&'static str; 7] =
        ["text", "path", "number", "measure", "whole", "flag", "list"];

    /// The type of a value; None of a table, which no parameter takes.
    pub(super) fn of(node: &Node) -> Option<ParameterType> {
        Some(match node.value {
            NodeValue::Text(_) => ParameterType::Text,
            NodeValue::Whole(_) => ParameterType::Whole,
            NodeValue::Number(_) => ParameterType::Number,
            NodeValue::Flag(_) => ParameterType::Flag,
            NodeValue::List(_) => ParameterType::List,
            NodeValue::Table(_) | NodeValue::Told => return None,
        })
    }

    /// What it takes, in words.
    pub fn words(self) -> &'static str {
        match self {
            ParameterType::Text => "a text",
            ParameterType::Path => "a path",
            ParameterType::Number => "a number",
            ParameterType::Measure => "a number, or one with a unit such as 5 cm",
            ParameterType::Whole => "a whole number",
            ParameterType::Flag => "true or false",
            ParameterType::List => "a list such as [a, b]",
        }
    }

    /// True for a value of this type.
    pub(super) fn fits(self, node: &Node) -> bool {
        match (self, &node.value) {
            (ParameterType::Text, NodeValue::Text(_)) => true,
            (ParameterType::Path, NodeValue::Text(path)) => !path.is_empty(),
            (ParameterType::Number, NodeValue::Number(_) | NodeValue::Whole(_)) => true,
            (ParameterType::Measure, NodeValue::Number(_) | NodeValue::Whole(_)) => true,
            (ParameterType::Measure, NodeValue::Text(text)) => begins_with_number(text),
            (ParameterType::Whole, NodeValue::Number(number)) => number.fract() == 0.0,
            (ParameterType::Whole, NodeValue::Whole(_)) => true,
            (ParameterType::Flag, NodeValue::Flag(_)) => true,
            (ParameterType::List, NodeValue::List(_)) => true,
            _ => false,
        }
    }

    /// A text as a value of this type.
    pub(super) fn read(self, text: &str, place: &TextPlace) -> Option<Node> {
        let value = match self {
            ParameterType::Text => NodeValue::Text(text.to_owned()),
            ParameterType::Path if text.is_empty() => return None,
            ParameterType::Path => NodeValue::Text(text.to_owned()),
            ParameterType::Number => match (text.parse::<i128>(), text.parse::<f64>()) {
                (Ok(whole), _) => NodeValue::Whole(whole),
                (_, Ok(number)) if number.is_finite() => NodeValue::Number(number),
                _ => return None,
            },
            ParameterType::Measure => match ParameterType::Number.read(text, place) {
                Some(number) => return Some(number),
                None if begins_with_number(text) => NodeValue::Text(text.to_owned()),
                None => return None,
            },
            ParameterType::Whole => match (text.parse::<i128>(), parse_count(text)) {
                (Ok(whole), _) => NodeValue::Whole(whole),
                (_, Ok(count)) => NodeValue::Whole(count.into()),
                _ => return None,
            },
            ParameterType::Flag => NodeValue::Flag(text.parse().ok()?),
            ParameterType::List => return node::parse_list(text, place),
        };
        Some(Node { place: place.clone(), value })
    }
}

fn begins_with_number(text: &str) -> bool {
    let digits = text.strip_prefix(['-', '+']).unwrap_or(text).trim_start_matches('.');
    digits.starts_with(|c: char| c.is_ascii_digit())
}

/// A value as it is shown, and as it stands within a longer text.
pub(super) fn value_words(node: &Node) -> String {
    match &node.value {
        NodeValue::Text(text) => text.clone(),
        NodeValue::Whole(whole) => whole.to_string(),
        NodeValue::Number(number) => number.to_string(),
        NodeValue::Flag(flag) => flag.to_string(),
        NodeValue::List(list) => {
            format!("[{}]", list.iter().map(value_words).collect::<Vec<_>>().join(", "))
        }
        NodeValue::Table(_) | NodeValue::Told => "a table".to_owned(),
    }
}
