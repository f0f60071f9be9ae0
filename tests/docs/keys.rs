//! The keys of a stage or of the `[run]` table: as a table of a page.

use std::fmt::Write as _;

use pointmill::{KeyDescription, WordDescription};

/// The table of keys, and lists of the words that they take.
pub fn markdown(keys: &[KeyDescription]) -> String {
    let mut table = "| key | value | default | |\n|---|---|---|---|\n".to_owned();
    let mut lists = String::new();
    for KeyDescription { name, value, default, docs, words, is_required, .. } in keys {
        let default = match default {
            _ if *is_required => "must be given".to_owned(),
            None => "none".to_owned(),
            Some(value) => format!("`{value}`"),
        };
        let docs = docs.replace('\n', " ").replace('|', "\\|");
        let _ = writeln!(table, "| `{name}` | {value} | {default} | {docs} |");
        if words.is_empty() {
            continue;
        }
        let _ = writeln!(lists, "\n`{name}`:\n");
        for WordDescription { word, docs, .. } in words {
            let _ = writeln!(lists, "- `\"{word}\"`: {}", docs.replace('\n', "\n  "));
        }
    }
    table + &lists
}
