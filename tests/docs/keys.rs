//! The keys of a stage or of the `[run]` table: as a table of a page, and as JSON for the command.

use std::fmt::Write as _;

use serde_json::{Value, json};

/// What a key is when it is left out.
pub enum Default {
    /// It cannot be.
    MustBeGiven,
    None,
    Is(Value),
}

/// A key of a stage or of the `[run]` table.
pub struct Key {
    pub name: String,
    /// What it takes, with code in backticks.
    pub value: String,
    pub default: Default,
    pub docs: String,
    /// The words that it takes, if it takes words, with their documentation.
    pub words: Vec<(String, String)>,
}

/// The table of keys, and lists of the words that they take.
pub fn markdown(keys: &[Key]) -> String {
    let mut table = "| key | value | default | |\n|---|---|---|---|\n".to_owned();
    let mut lists = String::new();
    for Key { name, value, default, docs, words } in keys {
        let default = match default {
            Default::MustBeGiven => "must be given".to_owned(),
            Default::None => "none".to_owned(),
            Default::Is(value) => format!("`{value}`"),
        };
        let docs = docs.replace('\n', " ").replace('|', "\\|");
        let _ = writeln!(table, "| `{name}` | {value} | {default} | {docs} |");
        if words.is_empty() {
            continue;
        }
        let _ = writeln!(lists, "\n`{name}`:\n");
        for (word, docs) in words {
            let _ = writeln!(lists, "- `\"{word}\"`: {}", docs.replace('\n', "\n  "));
        }
    }
    table + &lists
}

/// What `pointmill stages --json` says of a stage, or of the `[run]` table.
pub fn described(kind: &str, about: &str, keys: &[Key]) -> Value {
    let plain = |text: &str| text.replace('\n', " ").replace('`', "");
    let word = |(word, docs): &(String, String)| json!({"word": word, "about": plain(docs)});
    let key = |key: &Key| {
        json!({
            "key": key.name,
            "value": key.value.replace('`', ""),
            "required": matches!(key.default, Default::MustBeGiven),
            "default": match &key.default {
                Default::Is(value) => value.clone(),
                Default::MustBeGiven | Default::None => Value::Null,
            },
            "about": plain(&key.docs),
            "words": key.words.iter().map(word).collect::<Vec<Value>>(),
        })
    };
    let keys: Vec<Value> = keys.iter().map(key).collect();
    json!({"kind": kind, "about": plain(about), "keys": keys})
}
