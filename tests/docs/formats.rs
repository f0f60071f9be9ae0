//! Compares the keys that docs/formats.md names with those of real JSON.

use std::collections::BTreeSet;

use serde_json::Value;

/// The keys of a value, as paths: `ledger.removed[].stage`.
fn key_paths(value: &Value, path: &str, into: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => {
            for (key, value) in object {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                into.insert(path.clone());
                key_paths(value, &path, into);
            }
        }
        Value::Array(list) => {
            list.iter().for_each(|value| key_paths(value, &format!("{path}[]"), into));
        }
        _ => {}
    }
}

/// The keys that a section of docs/formats.md names: code at the beginning of a table's rows. True
/// for those of which it says "not always".
pub fn documented(section: &str) -> Vec<(String, bool)> {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/formats.md");
    let text = std::fs::read_to_string(page).unwrap();
    let heading = format!("\n## {section}\n");
    let (_, after) = text.split_once(&heading).unwrap_or_else(|| panic!("no section {section}"));
    let section = after.split("\n## ").next().unwrap_or(after);
    let key = |row: &str| {
        let (key, _) = row.strip_prefix("| `")?.split_once('`')?;
        Some((key.to_owned(), row.contains("not always")))
    };
    section.lines().filter_map(key).collect()
}

/// Every key of `value` is named in the section, and every key named is one, unless it says that it
/// is not always there. Below a key `x.*` are keys of free choice.
pub fn agree(value: &Value, section: &str) {
    let mut there = BTreeSet::new();
    key_paths(value, "", &mut there);
    let documented = documented(section);
    let free: Vec<&str> = documented.iter().filter_map(|(key, _)| key.strip_suffix('*')).collect();
    there.retain(|path| !free.iter().any(|free| path.starts_with(free)));
    let named: BTreeSet<&str> = documented.iter().map(|(key, _)| key.as_str()).collect();
    let unnamed: Vec<&String> =
        there.iter().filter(|path| !named.contains(path.as_str())).collect();
    assert!(unnamed.is_empty(), "docs/formats.md does not name {unnamed:?} under {section}");
    let must = documented.iter().filter(|(key, not_always)| !not_always && !key.ends_with('*'));
    let missing: Vec<&String> =
        must.map(|(key, _)| key).filter(|key| !there.contains(*key)).collect();
    assert!(missing.is_empty(), "there are no {missing:?}, which docs/formats.md names");
    assert!(there.len() >= 4, "{section}: too few keys to prove anything");
}
