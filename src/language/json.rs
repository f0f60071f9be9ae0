//! Pipelines in JSON: every value with its place. A number that other programs may have rounded, a
//! key that is there twice and whatever JSON does not have are refused.

use std::collections::BTreeSet;

use jsonc_parser::ast::{Object, Value};
use jsonc_parser::common::{Range, Ranged};
use jsonc_parser::errors::{ParseError, ParseErrorKind};
use jsonc_parser::{CollectOptions, ParseOptions, parse_to_ast};

use super::form::begin;
use super::mistake::Mistake;
use super::node::{KeyEntry, Node, NodeValue};
use super::place::TextPlace;

/// The largest number up to which all whole numbers are exact where numbers are doubles.
const EXACT: i128 = 1 << 53;

/// JSON as its standard has it, and nothing that is common besides.
const STRICT: ParseOptions = ParseOptions {
    allow_comments: false,
    allow_loose_object_property_names: false,
    allow_trailing_commas: false,
    allow_missing_commas: false,
    allow_single_quoted_strings: false,
    allow_hexadecimal_numbers: false,
    allow_unary_plus_numbers: false,
    allow_bare_decimal_point_numbers: false,
    allow_non_finite_numbers: false,
    allow_extended_string_escapes: false,
};

/// Reads text 0 as a JSON object, or tells where it is none.
pub(super) fn parse(text: &str) -> Result<Vec<KeyEntry>, Vec<Mistake>> {
    let (shift, json) = begin(text);
    let mut reader = JsonReader { shift, mistakes: Vec::new() };
    let parsed = parse_to_ast(json, &CollectOptions::default(), &STRICT);
    let value = parsed.map_err(|error| vec![reader.syntax(&error)])?.value;
    let Some(Value::Object(object)) = value else {
        let told = "a pipeline in JSON is an object: write {\"stage\": [{…}, {…}]}";
        return Err(vec![Mistake::new(TextPlace::new(0, shift..shift + 1), told)]);
    };
    let entries = reader.entries(object);
    if reader.mistakes.is_empty() { Ok(entries) } else { Err(reader.mistakes) }
}

struct JsonReader {
    /// Bytes of the text before the JSON.
    shift: usize,
    mistakes: Vec<Mistake>,
}

impl JsonReader {
    fn place(&self, Range { start, end }: Range) -> TextPlace {
        TextPlace::new(0, self.shift + start..self.shift + end)
    }

    fn syntax(&self, error: &ParseError) -> Mistake {
        let note = match error.kind() {
            ParseErrorKind::CommentsNotAllowed => "a pipeline file with comments is TOML",
            ParseErrorKind::UnexpectedToken | ParseErrorKind::UnexpectedWord => {
                "JSON has texts in double quotes, numbers, true, false and null"
            }
            _ => "",
        };
        let told = error.kind().to_string();
        let (first, rest) = told.split_at(told.chars().next().map_or(0, char::len_utf8));
        let told = format!("not JSON: {}{rest}", first.to_lowercase());
        Mistake::new(self.place(error.range()), told).note(note)
    }

    /// The entries of an object; those that are null are as if they were not there.
    fn entries(&mut self, object: Object<'_>) -> Vec<KeyEntry> {
        let mut entries: Vec<KeyEntry> = Vec::new();
        let mut known = BTreeSet::new();
        for property in object.properties {
            let at = self.place(property.name.range());
            let key = property.name.into_string();
            if !known.insert(key.clone()) {
                let told = format!("`{key}` is given twice");
                self.mistakes.push(Mistake::new(at, told));
                continue;
            }
            if matches!(property.value, Value::NullKeyword(_)) {
                continue;
            }
            if let Some(node) = self.node(property.value) {
                entries.push(KeyEntry { key, at, node });
            }
        }
        entries
    }

    fn node(&mut self, value: Value<'_>) -> Option<Node> {
        let place = self.place(value.range());
        let value = match value {
            Value::StringLit(text) => Ok(NodeValue::Text(text.value.into_owned())),
            Value::BooleanLit(flag) => Ok(NodeValue::Flag(flag.value)),
            Value::NumberLit(number) => self::number(number.value),
            Value::NullKeyword(_) => Err("no list takes null".to_owned()),
            Value::Array(list) => {
                let items = list.elements.into_iter();
                Ok(NodeValue::List(items.filter_map(|item| self.node(item)).collect()))
            }
            Value::Object(object) => Ok(NodeValue::Table(self.entries(object))),
        };
        match value {
            Ok(value) => Some(Node { place, value }),
            Err(told) => {
                self.mistakes.push(Mistake::new(place, told));
                None
            }
        }
    }
}

/// A number, or what is wrong with it.
fn number(text: &str) -> Result<NodeValue, String> {
    if text.contains(['.', 'e', 'E']) {
        return match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(NodeValue::Number(number)),
            _ => Err("no key takes a number that is not finite".to_owned()),
        };
    }
    match text.parse::<i128>() {
        Ok(whole) if whole.abs() <= EXACT => Ok(NodeValue::Whole(whole)),
        _ => Err(format!(
            "beyond {EXACT} programs round the whole numbers of JSON: write it in quotes"
        )),
    }
}
