//! A value that does not fit its key, from the words that serde has for it to those of a message.

use std::fmt;

use serde::de::{self, Expected, Unexpected};

use super::mistake::Mistake;
use super::node::Node;
use super::place::TextPlace;
use crate::error::nearest;
use crate::expression::ExpressionFault;
use crate::quantity::Figure;

/// A value that does not fit, as serde tells it.
#[derive(Debug)]
pub(super) struct Fault {
    pub place: Option<TextPlace>,
    pub key: Option<String>,
    pub problem: Problem,
}

#[derive(Debug)]
pub(super) enum Problem {
    UnknownKey(String, Vec<&'static str>),
    UnknownWord(String, Vec<&'static str>),
    Missing(&'static str),
    /// The value is wrong, which is told already.
    Told,
    Expression(ExpressionFault),
    /// What is wrong, and a word that was meant, perhaps.
    Wrong(String, Option<Box<str>>),
}

impl Fault {
    pub fn new(problem: Problem) -> Self {
        Fault { place: None, key: None, problem }
    }

    pub fn at(mut self, place: &TextPlace) -> Self {
        self.place.get_or_insert_with(|| place.clone());
        self
    }

    pub fn under(mut self, key: &str) -> Self {
        self.key = Some(key.to_owned()); // the outermost key wins: it is the stage's
        self
    }

    pub fn mistake(&self, subject: &str, keys: &Node) -> Mistake {
        let place = self.place.clone().unwrap_or_else(|| keys.place.clone());
        let key = self.key.as_deref().unwrap_or(subject);
        match &self.problem {
            Problem::UnknownKey(word, valid) => Mistake::word(
                place,
                format!("`{subject}` has no key `{word}`"),
                word,
                "keys",
                valid,
            ),
            Problem::UnknownWord(word, valid) => {
                Mistake::word(place, format!("`{key}` cannot be `{word}`"), word, "valid", valid)
            }
            Problem::Expression(fault) => {
                let told = format!("`{key}`: {}", fault.told);
                Mistake::new(place, told).note(fault.help.clone())
            }
            Problem::Missing(lacks) => Mistake::new(place, format!("`{key}` needs `{lacks}`")),
            Problem::Told => Mistake::new(place, format!("`{key}` is wrong")),
            Problem::Wrong(what, near) => {
                let near = near.as_ref().map(|near| format!("did you mean `{near}`?"));
                // A message may begin with the key that it is about.
                let told = match what.strip_prefix(key).and_then(|rest| rest.strip_prefix(' ')) {
                    Some(rest) => format!("`{key}`: {rest}"),
                    None => format!("`{key}`: {what}"),
                };
                Mistake::new(place, told).note(near.unwrap_or_default())
            }
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.problem)
    }
}

impl std::error::Error for Fault {}

impl de::Error for Fault {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Fault::new(Problem::Wrong(message.to_string(), None))
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        let takes = plain(expected);
        let told = format!("takes {takes}, not {}", found_words(found));
        // What is expected quotes the words that it can be: a number above 0, or "auto".
        // Its examples ("10%", "2m") are none that anyone meant.
        let words = takes.split('"').skip(1).step_by(2);
        let is_word = |word: &&str| !word.contains(|c: char| c.is_ascii_digit());
        let words: Vec<String> = words.filter(is_word).map(str::to_owned).collect();
        let near = match found {
            Unexpected::Str(text) => nearest(text, &words).map(|near| near.as_str().into()),
            _ => None,
        };
        Fault::new(Problem::Wrong(told, near))
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Fault::invalid_type(found, expected)
    }

    fn invalid_length(len: usize, expected: &dyn Expected) -> Self {
        Fault::custom(format!("takes {}, not {len} values", plain(expected)))
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        Fault::new(Problem::UnknownWord(variant.to_owned(), expected.to_vec()))
    }

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        Fault::new(Problem::UnknownKey(field.to_owned(), expected.to_vec()))
    }

    fn missing_field(field: &'static str) -> Self {
        Fault::new(Problem::Missing(field))
    }
}

/// Serde's name of what it expected, in plain words.
fn plain(expected: &dyn Expected) -> String {
    let name = expected.to_string();
    match name.as_str() {
        "u8" => "a whole number from 0 to 255",
        "u16" => "a whole number from 0 to 65535",
        "u32" | "u64" | "usize" => "a whole number from 0",
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
        "a nonzero u8" | "a nonzero u32" | "a nonzero u64" | "a nonzero usize" => {
            "a whole number from 1"
        }
        "f32" | "f64" => "a number",
        "a string" | "path string" => "a text in quotes",
        "a boolean" => "true or false",
        "a sequence" => "a list in brackets",
        _ => match name.strip_prefix("an array of length ") {
            Some(length) => return format!("a list of {length} values"),
            None => &name,
        },
    }
    .to_owned()
}

fn found_words(found: Unexpected<'_>) -> String {
    match found {
        Unexpected::Bool(v) => v.to_string(),
        Unexpected::Unsigned(v) => v.to_string(),
        Unexpected::Signed(v) => v.to_string(),
        Unexpected::Float(v) => Figure(v).to_string(),
        Unexpected::Str(v) => format!("the text \"{}\"", v.chars().take(60).collect::<String>()),
        Unexpected::Seq => "a list".to_owned(),
        Unexpected::Map => "a table".to_owned(),
        other => other.to_string(),
    }
}
