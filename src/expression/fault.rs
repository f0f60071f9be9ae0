//! What is wrong with an expression, and where in it.

use std::ops::Range;

use crate::Error;
use crate::error::{is_control, listed, nearest};

/// Something wrong at a place of an expression's text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ExpressionFault {
    /// The bytes of the text that it is about.
    pub span: Range<usize>,
    /// What is wrong.
    pub told: String,
    /// What would be right; empty where that is not known.
    pub help: String,
}

impl ExpressionFault {
    pub fn new(span: Range<usize>, told: impl Into<String>) -> Self {
        ExpressionFault { span, told: told.into(), help: String::new() }
    }

    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = help.into();
        self
    }

    /// A word that is none of the `valid` ones; `all` says what these are.
    pub fn word(span: Range<usize>, told: String, word: &str, all: &str, valid: &[String]) -> Self {
        let list = match valid.is_empty() {
            true => format!("{all}: none"),
            false => format!("{all}: {}", valid.join(", ")),
        };
        // What is shown of a word may say more than the word.
        let plain: Vec<String> =
            valid.iter().map(|word| word.split(" (").next().unwrap_or(word).to_owned()).collect();
        let help = match nearest(word, &plain) {
            Some(near) => format!("did you mean `{near}`? {list}"),
            None => list,
        };
        ExpressionFault::new(span, told).help(help)
    }

    /// The fault as an error that shows the text with a caret below its place.
    pub fn error(&self, text: &str) -> Error {
        let plain = |c: char| if is_control(c) { ' ' } else { c };
        let shown: String = text.chars().map(plain).collect();
        let before = text.get(..self.span.start).unwrap_or(text).chars().count();
        let marked = text.get(self.span.clone()).unwrap_or_default().chars().count().max(1);
        let carets = format!("{}{}", " ".repeat(before), "^".repeat(marked));
        let error = Error::pipeline(format!("{}\n  | {shown}\n  | {carets}", self.told));
        if self.help.is_empty() { error } else { error.help(self.help.clone()) }
    }
}

/// Words in backticks, as a sentence lists them.
pub(super) fn quoted<'a>(words: impl IntoIterator<Item = &'a str>) -> String {
    listed(words.into_iter().map(|word| format!("`{word}`")), "or")
}
