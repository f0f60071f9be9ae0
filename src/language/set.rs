//! Values that an argument puts in the place of a pipeline file's: `--set stage.key=value`.

use std::ops::Range;

use super::mistake;
use super::mistake::{Mistake, SourceText};
use super::node;
use super::node::Node;
use super::place::{PlacedWord, TextPlace};
use super::references;
use crate::{Error, Result};

/// The arguments whose texts [`Set::parse`] and [`Set::param`] read, as errors name them.
const ARGUMENT: &str = "--set";
const PARAMETER: &str = "--param";

/// What stands in an address in the place of a stage where a parameter is meant.
pub(super) const PARAMETERS: &str = "params";

/// One value put in the place of a pipeline file's.
///
/// The address is `run.KEY` for a setting, `params.NAME` for a parameter, else `STAGE.KEY`: the
/// stage by its `name`, or by its kind where only one stage is of that kind, or as `KIND.N.KEY`,
/// the N-th stage of that kind, from 1.
#[derive(Debug, Clone)]
pub struct Set {
    argument: String,
    text: String,
    address: String,
    value: Given,
}

#[derive(Debug, Clone)]
enum Given {
    /// Bytes `from..` of the text, as TOML or else as a text.
    Text {
        from: usize,
    },
    Json(serde_json::Value),
}

impl Set {
    /// Reads `stage.key=value`, as `--set` takes it. The value is TOML; what is no TOML is a text,
    /// so that `write.path=out.laz` needs no quotes.
    ///
    /// # Errors
    ///
    /// A text without `=`. Whether there is such a key is found where it is put into a text.
    pub fn parse(text: &str) -> Result<Set> {
        let Some((address, _)) = text.split_once('=') else {
            let help = "write STAGE.KEY=VALUE, such as cells.max_angle=0.2 or run.threads=2";
            return Err(refused(ARGUMENT, text, 0..text.len(), "there is no `=`", help));
        };
        let end = address.len();
        let address = address.trim_end().to_owned();
        if address.split('.').next() == Some(PARAMETERS) {
            let told = "a parameter has an argument of its own";
            return Err(refused(ARGUMENT, text, 0..end, told, "write --param NAME=VALUE"));
        }
        let value = Given::Text { from: end + 1 };
        Ok(Set { argument: ARGUMENT.to_owned(), text: text.to_owned(), address, value })
    }

    /// Reads `name=value`, as `--param` takes it: a value for a parameter that the pipeline
    /// declares. It is read as the parameter's type asks for, a text as it is.
    ///
    /// # Errors
    ///
    /// A text without `=`, or without a name before it. Whether there is such a parameter is found
    /// where it is put into a text.
    pub fn param(text: &str) -> Result<Set> {
        let end = text.find('=').unwrap_or(0);
        let name = text[..end].trim_end();
        if !references::is_name(name) {
            let told = match text.contains('=') {
                true => "a parameter's name is made of letters, digits, - and _",
                false => "there is no `=`",
            };
            let help = "write NAME=VALUE, NAME as the pipeline declares it under `params`";
            return Err(refused(PARAMETER, text, 0..text.len(), told, help));
        }
        Ok(Set {
            argument: PARAMETER.to_owned(),
            text: text.to_owned(),
            address: format!("{PARAMETERS}.{name}"),
            value: Given::Text { from: end + 1 },
        })
    }

    /// The value of another argument, which errors name, for `address`.
    pub fn argument(argument: &str, address: &str, value: serde_json::Value) -> Set {
        let text = match &value {
            serde_json::Value::String(text) => text.clone(),
            serde_json::Value::Array(list) => {
                let text = |v: &serde_json::Value| v.as_str().map_or(v.to_string(), str::to_owned);
                list.iter().map(text).collect::<Vec<_>>().join(",")
            }
            other => other.to_string(),
        };
        let (argument, address) = (argument.to_owned(), address.to_owned());
        Set { argument, text, address, value: Given::Json(value) }
    }

    /// The same value, which `text` was typed for: errors show it.
    pub fn typed(self, text: String) -> Set {
        Set { text, ..self }
    }

    /// The text that errors show.
    pub(crate) fn source(&self) -> SourceText {
        let setting = matches!(self.value, Given::Json(_)).then(|| self.address.clone());
        let (origin, text) = (self.argument.clone(), self.text.clone());
        SourceText { origin, text, has_lines: false, setting }
    }

    /// The address as it was written.
    pub(crate) fn written(&self) -> &str {
        &self.address
    }

    /// The stage part and the key part of the address, if it has both.
    pub(crate) fn address(&self) -> Option<(&str, &str)> {
        self.address.rsplit_once('.').filter(|(stage, key)| !stage.is_empty() && !key.is_empty())
    }

    /// Bytes `part` of the address in the argument's text (source `source`), or all of the text
    /// where the address is not in it.
    pub(crate) fn place(&self, source: usize, part: &str) -> TextPlace {
        let start = match self.value {
            Given::Text { .. } => self.text.find(part),
            Given::Json(_) => None,
        };
        let span = start.map_or(0..self.text.len(), |start| start..start + part.len());
        TextPlace::new(source, span)
    }

    /// The value as it was typed, with its place in source `source`.
    pub(crate) fn text(&self, source: usize) -> PlacedWord {
        let from = if let Given::Text { from } = self.value { from } else { 0 };
        let text = self.text[from..].trim();
        let start = from + self.text[from..].len() - self.text[from..].trim_start().len();
        (text.to_owned(), TextPlace::new(source, start..start + text.len()))
    }

    /// The value, its place in source `source`.
    pub(crate) fn value(&self, source: usize) -> Result<Node, Vec<Mistake>> {
        match &self.value {
            Given::Text { .. } => {
                let (text, place) = self.text(source);
                node::parse_value(&text, source, place.start)
            }
            Given::Json(value) => {
                Ok(node::from_json(value, &TextPlace::new(source, 0..self.text.len())))
            }
        }
    }
}

/// What is wrong with the part `span` of an argument.
fn refused(argument: &str, text: &str, span: Range<usize>, told: &str, help: &str) -> Error {
    let mistake = Mistake::new(TextPlace::new(1, span), told).note(help);
    let source = |origin: &str, text: &str| SourceText {
        origin: origin.to_owned(),
        text: text.to_owned(),
        has_lines: false,
        setting: None,
    };
    mistake::tell(vec![mistake], &[source("", ""), source(argument, text)])
}
