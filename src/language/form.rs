//! The forms in which a pipeline is written, and the words in which their syntax is told.

use std::fmt::Display;
use std::path::Path;

/// A form of pipeline texts. All say the same with the same keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TextForm {
    /// TOML, which people write.
    Toml,
    /// JSON, which programs write.
    Json,
    /// One line, which is typed as an argument.
    Line,
}

impl TextForm {
    /// That of a file's text: JSON if it begins with a brace or `origin` is named so, else TOML.
    pub fn of(text: &str, origin: &str) -> Self {
        let is_named =
            Path::new(origin).extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        match is_named || begin(text).1.starts_with('{') {
            true => TextForm::Json,
            false => TextForm::Toml,
        }
    }

    /// How a table of this name is written.
    pub fn table(self, name: &str) -> String {
        match self {
            TextForm::Toml | TextForm::Line => format!("[{name}]"),
            TextForm::Json => format!("\"{name}\": {{…}}"),
        }
    }

    /// How the stages are written.
    pub fn stages(self) -> &'static str {
        match self {
            TextForm::Toml => "[[stage]]",
            TextForm::Json => "\"stage\": [{…}, {…}]",
            TextForm::Line => "KIND ! KIND",
        }
    }

    /// How one of the stages is written.
    pub fn stage(self) -> &'static str {
        match self {
            TextForm::Toml => "[[stage]]",
            TextForm::Json => "{\"kind\": …}",
            TextForm::Line => "KIND KEY=VALUE",
        }
    }

    /// How `key` is given the text `value`.
    pub fn key(self, key: &str, value: impl Display) -> String {
        match self {
            TextForm::Toml => format!("{key} = \"{value}\""),
            TextForm::Json => format!("\"{key}\": \"{value}\""),
            TextForm::Line => format!("{key}={value}"),
        }
    }
}

/// Where a text begins behind a mark of its encoding and space, and what is there.
pub(super) fn begin(text: &str) -> (usize, &str) {
    let rest = text.trim_start_matches('\u{feff}').trim_start();
    (text.len() - rest.len(), rest)
}
