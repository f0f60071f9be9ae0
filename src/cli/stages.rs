//! `stages`: the kinds of stages with their keys, as text or JSON.

use serde_json::Value;

use super::arguments::StagesArguments;
use super::described::{Key, StageDescription, Word, described};
use super::print;
use crate::error::nearest;
use crate::language::Registry;
use crate::{Error, Result};

/// Columns of a terminal that text is wrapped to.
const COLUMNS: usize = 96;

/// Prints the `[run]` table and all kinds of stages, or one of them.
pub(super) fn stages(arguments: &StagesArguments, registry: &Registry) -> Result<()> {
    let all = described(registry)?;
    let shown: Vec<&StageDescription> = match &arguments.kind {
        None => all.iter().collect(),
        Some(kind) => vec![all.iter().find(|d| d.kind == *kind).ok_or_else(|| {
            let kinds: Vec<String> = all.iter().map(|d| d.kind.clone()).collect();
            let near = nearest(kind, &kinds).map(|near| format!("did you mean `{near}`? "));
            let told = format!("there is no stage `{kind}`");
            let near = near.unwrap_or_default();
            Error::pipeline(told).help(format!("{near}stages: {}", kinds.join(", ")))
        })?],
    };
    if arguments.json {
        let json = match (&arguments.kind, &shown[..]) {
            (Some(_), [one]) => serde_json::to_string_pretty(one),
            _ => serde_json::to_string_pretty(&shown),
        };
        let failed = |e| Error::internal("the stages could not be written as JSON").because(e);
        return print::json(&json.map_err(failed)?);
    }
    let text: Vec<String> = shown.into_iter().map(text).collect();
    print::result(text.join("\n"))
}

fn text(described: &StageDescription) -> String {
    let heading = match described.kind.as_str() {
        "run" => "[run]",
        kind => kind,
    };
    let mut out = format!("{heading}\n{}", wrapped(&described.about, 2));
    match &described.keys {
        None => out += &wrapped("Its keys are not described here.", 2),
        Some(keys) if keys.is_empty() => out += &wrapped("It has no keys.", 2),
        Some(keys) => keys.iter().for_each(|key| out += &key_text(key)),
    }
    out
}

fn key_text(key: &Key) -> String {
    let default = match &key.default {
        _ if key.required => "must be given".to_owned(),
        Value::Null => "default: none".to_owned(),
        value => format!("default: {value}"),
    };
    let mut out = format!("\n  {} = {} [{default}]\n", key.key, key.value);
    out += &wrapped(&key.about, 6);
    for Word { word, about } in &key.words {
        out += &wrapped(&format!("\"{word}\": {about}"), 8);
    }
    out
}

/// Lines of words, indented.
fn wrapped(text: &str, indent: usize) -> String {
    let mut out = String::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        let length = indent + line.chars().count() + 1 + word.chars().count();
        if !line.is_empty() && length > COLUMNS {
            out += &format!("{:indent$}{line}\n", "");
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line += word;
    }
    if !line.is_empty() {
        out += &format!("{:indent$}{line}\n", "");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_wrapped_between_words() {
        let text = wrapped(&"word ".repeat(100), 4);
        assert!(text.lines().count() > 4);
        for line in text.lines() {
            assert!(line.starts_with("    word") && line.len() <= COLUMNS, "{line}");
        }
        assert_eq!(wrapped("", 2), "");
    }
}
