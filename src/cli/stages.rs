//! `stages` and `schema`: the kinds of stages with their keys, for people, programs and editors.

use serde_json::{Value, json};

use super::arguments::StagesArguments;
use super::print;
use crate::error::nearest;
use crate::language::{KeyDescription, Registry, TableDescription, WordDescription};
use crate::{Error, Result};

/// Columns of a terminal that text is wrapped to.
const COLUMNS: usize = 96;

/// Prints the tables `[run]` and `[accept]` and all kinds of stages, or one of them.
pub(super) fn stages(arguments: &StagesArguments, registry: &Registry) -> Result<()> {
    let Some(kind) = &arguments.kind else {
        let kinds = registry.kinds().filter_map(|(kind, _)| registry.describe(kind));
        let all: Vec<TableDescription> = [registry.describe_run(), registry.describe_accept()]
            .into_iter()
            .chain(kinds)
            .collect();
        return match arguments.json {
            true => printed(&all.iter().map(as_json).collect()),
            false => print::result(all.iter().map(text).collect::<Vec<_>>().join("\n")),
        };
    };
    let described = match kind.as_str() {
        "run" => Some(registry.describe_run()),
        "accept" => Some(registry.describe_accept()),
        kind => registry.describe(kind),
    };
    let described = described.ok_or_else(|| unknown(kind, registry))?;
    match arguments.json {
        true => printed(&as_json(&described)),
        false => print::result(text_of_one(&described)),
    }
}

/// Prints the JSON Schema of pipeline files.
pub(super) fn schema(registry: &Registry) -> Result<()> {
    printed(&registry.schema())
}

fn unknown(kind: &str, registry: &Registry) -> Error {
    let kinds = registry.kinds().map(|(kind, _)| kind.to_owned());
    let tables = ["run", "accept"].map(str::to_owned);
    let kinds: Vec<String> = tables.into_iter().chain(kinds).collect();
    let near = nearest(kind, &kinds).map(|near| format!("did you mean `{near}`? "));
    let near = near.unwrap_or_default();
    Error::pipeline(format!("there is no stage `{kind}`"))
        .help(format!("{near}stages: {}", kinds.join(", ")))
}

fn printed(json: &Value) -> Result<()> {
    let failed =
        |e| Error::internal("what is known of stages could not be written as JSON").because(e);
    print::json(&serde_json::to_string_pretty(json).map_err(failed)?)
}

/// Markdown for a terminal, on one line.
fn plain(text: &str) -> String {
    text.replace('\n', " ").replace('`', "")
}

fn as_json(table: &TableDescription) -> Value {
    let key = |key: &KeyDescription| {
        json!({
            "key": key.name,
            "value": plain(&key.value),
            "required": key.is_required,
            "default": key.default,
            "about": plain(&key.docs),
            "words": key.words.iter().map(word_as_json).collect::<Value>(),
        })
    };
    json!({
        "kind": table.name,
        "about": plain(&table.about),
        "docs": table.docs,
        "main": table.main,
        "keys": table.all_keys().map(key).collect::<Value>(),
    })
}

fn word_as_json(word: &WordDescription) -> Value {
    json!({ "word": word.word, "about": plain(&word.docs) })
}

fn text(table: &TableDescription) -> String {
    let heading = match table.name.as_str() {
        "run" => "[run]",
        "accept" => "[accept]",
        kind => kind,
    };
    let about = format!("{heading}\n{}", wrapped(&plain(&table.about), 2));
    about + &keys_text(table)
}

/// The same with all that is said of it.
fn text_of_one(table: &TableDescription) -> String {
    let mut out = format!("{}\n{}", table.name, wrapped(&plain(&table.about), 2));
    for paragraph in table.docs.split("\n\n") {
        out.push('\n');
        // The items of a list are lines of their own.
        for line in paragraph.trim_start_matches("# ").replace("\n- ", "\0- ").split('\0') {
            out += &wrapped(&plain(line), 2);
        }
    }
    out += &keys_text(table);
    match table.main {
        Some(main) => {
            let told = "In a pipeline of one line the word right behind it is its";
            out + "\n" + &wrapped(&format!("{told} {main}."), 2)
        }
        None => out,
    }
}

fn keys_text(table: &TableDescription) -> String {
    match table.all_keys().next() {
        None => wrapped("It has no keys.", 2),
        Some(_) => table.all_keys().map(key_text).collect(),
    }
}

fn key_text(key: &KeyDescription) -> String {
    let default = match &key.default {
        _ if key.is_required => "must be given".to_owned(),
        None => "default: none".to_owned(),
        Some(value) => format!("default: {value}"),
    };
    let mut out = format!("\n  {} = {} [{default}]\n", key.name, plain(&key.value));
    out += &wrapped(&plain(&key.docs), 6);
    for WordDescription { word, docs, .. } in &key.words {
        out += &wrapped(&plain(&format!("\"{word}\": {docs}")), 8);
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
