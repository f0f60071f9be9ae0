//! What is known of the kinds of stages and their keys.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::language::Registry;
use crate::{Error, Result};

/// The `[run]` table, then every built-in kind: written from the documentation of their keys by the
/// test that writes the pages of docs/stages.
const DESCRIBED: &str = include_str!("stages.json");

/// A kind of stage, or the `[run]` table.
#[derive(Deserialize, Serialize)]
pub(super) struct StageDescription {
    pub kind: String,
    pub about: String,
    /// None for a kind that an embedding program brings: its keys are not known here.
    pub keys: Option<Vec<Key>>,
}

#[derive(Deserialize, Serialize)]
pub(super) struct Key {
    pub key: String,
    pub value: String,
    pub required: bool,
    pub default: Value,
    pub about: String,
    pub words: Vec<Word>,
}

#[derive(Deserialize, Serialize)]
pub(super) struct Word {
    pub word: String,
    pub about: String,
}

/// The addresses of all settings that are described, as `--set` takes them.
pub(super) fn settings() -> BTreeSet<String> {
    // The description is the program's own; a test reads it.
    let known: Vec<StageDescription> = serde_json::from_str(DESCRIBED).unwrap_or_default();
    let keys = |d: StageDescription| -> Vec<String> {
        d.keys.iter().flatten().map(|key| format!("{}.{}", d.kind, key.key)).collect()
    };
    known.into_iter().flat_map(keys).collect()
}

/// The `[run]` table, then the kinds of the registry in their order.
pub(super) fn described(registry: &Registry) -> Result<Vec<StageDescription>> {
    let mut known: Vec<StageDescription> = serde_json::from_str(DESCRIBED)
        .map_err(|e| Error::internal("the built-in description of stages is wrong").because(e))?;
    let mut all: Vec<StageDescription> = known.extract_if(.., |d| d.kind == "run").collect();
    for (kind, about) in registry.kinds() {
        // A program's own kind may have the name of a built-in one.
        let built_in = known.iter().position(|d| d.kind == kind && d.about == about);
        all.push(match built_in {
            Some(at) => known.swap_remove(at),
            None => StageDescription { kind: kind.to_owned(), about: about.to_owned(), keys: None },
        });
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_kind_is_described() {
        let registry = Registry::builtin();
        let all = described(&registry).unwrap();
        let kinds: Vec<&str> = all.iter().skip(1).map(|d| d.kind.as_str()).collect();
        assert_eq!(kinds, registry.kinds().map(|(kind, _)| kind).collect::<Vec<&str>>());
        assert!(all.iter().all(|d| d.keys.is_some()));
        assert!(all[0].kind == "run" && all[0].keys.as_ref().unwrap().len() >= 8);
    }
}
