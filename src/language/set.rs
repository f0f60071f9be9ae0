//! Values that an argument puts in the place of a pipeline file's: `--set stage.key=value`.

use super::mistake;
use super::mistake::{Mistake, SourceText};
use super::node;
use super::node::Node;
use super::place::TextPlace;
use crate::Result;

/// The argument whose texts [`Set::parse`] reads, as errors name it.
const ARGUMENT: &str = "--set";

/// One value put in the place of a pipeline file's.
///
/// The address is `run.KEY` for a setting, else `STAGE.KEY`: the stage by its `name`, or by its
/// kind where only one stage is of that kind, or as `KIND.N.KEY`, the N-th stage of that kind, from
/// 1.
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
            let told = Mistake::new(TextPlace::new(1, 0..text.len()), "there is no `=`")
                .note("write STAGE.KEY=VALUE, such as cells.max_angle=0.2 or run.threads=2");
            let none = || SourceText { origin: String::new(), text: String::new(), setting: None };
            let given = SourceText { origin: ARGUMENT.to_owned(), text: text.to_owned(), ..none() };
            return Err(mistake::tell(vec![told], &[none(), given]));
        };
        Ok(Set {
            argument: ARGUMENT.to_owned(),
            text: text.to_owned(),
            address: address.trim_end().to_owned(),
            value: Given::Text { from: address.len() + 1 },
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
        SourceText { origin: self.argument.clone(), text: self.text.clone(), setting }
    }

    /// The stage part and the key part of the address.
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

    /// The value, its place in source `source`.
    pub(crate) fn value(&self, source: usize) -> Result<Node, Vec<Mistake>> {
        match &self.value {
            Given::Text { from } => node::parse_value(self.text[*from..].trim(), source, *from),
            Given::Json(value) => {
                Ok(node::from_json(value, &TextPlace::new(source, 0..self.text.len())))
            }
        }
    }
}
