//! Where the values of a pipeline come from, in words: a line of its file, an argument, a parameter
//! or the environment.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::draft::Draft;
use super::mistake::SourceText;
use super::node::{KeyEntry, Node, NodeValue};
use super::params;
use super::place::TextPlace;
use super::references::{Environment, Piece, pieces};

/// Where the keys of a draft have their values from.
pub(super) struct Origins {
    /// By the place of the key.
    keys: BTreeMap<TextPlace, String>,
    /// By the name of the parameter.
    params: BTreeMap<String, String>,
    sources: Arc<[SourceText]>,
}

impl Origins {
    /// Those of `draft`, in which values are in their place and references not replaced yet.
    pub fn of(draft: &Draft, sources: &Arc<[SourceText]>, environment: Environment<'_>) -> Self {
        let mut params = BTreeMap::new();
        for one in params::declared(&draft.params, &mut Vec::new()) {
            let given = draft.given.iter().rev().find(|((name, _), _)| *name == one.name);
            let words = match (given, &one.default) {
                (Some((_, (_, place))), _) => {
                    format!("{} {}", sources[place.source].origin, one.name)
                }
                (None, default) => {
                    let names = default.iter().flat_map(|node| names(node, environment, &[]));
                    let line = sources[0].line(one.at.start);
                    let all: Vec<String> = std::iter::once(line).chain(names).collect();
                    all.join(", ")
                }
            };
            params.insert(one.name, words);
        }
        let told: Vec<(String, String)> = params
            .iter()
            .map(|(name, words)| match words.starts_with("--") {
                true => (name.clone(), words.clone()),
                false => (name.clone(), format!("params.{name} ({words})")),
            })
            .collect();
        let entries = draft.values().flat_map(Node::entries);
        let origin = |KeyEntry { at, node, .. }: &KeyEntry| {
            // What arguments give refers to nothing.
            let names = if at.source == 0 { names(node, environment, &told) } else { Vec::new() };
            let all: Vec<String> =
                std::iter::once(sources[at.source].line(at.start)).chain(names).collect();
            (at.clone(), all.join(", "))
        };
        let keys = entries.map(origin).collect();
        Origins { keys, params, sources: sources.clone() }
    }

    /// That of the key that is written at `at`.
    pub fn key(&self, at: &TextPlace) -> Option<&str> {
        self.keys.get(at).map(String::as_str)
    }

    /// That of what is written at `at` and refers to nothing.
    pub fn line(&self, at: &TextPlace) -> String {
        self.sources[at.source].line(at.start)
    }

    /// That of the value of a parameter.
    pub fn param(&self, name: &str) -> &str {
        self.params.get(name).map_or("", String::as_str)
    }
}

/// What the texts of `node` refer to, each once: parameters by their words in `params`, variables
/// of the environment.
fn names(node: &Node, environment: Environment<'_>, params: &[(String, String)]) -> Vec<String> {
    let mut all = Vec::new();
    match &node.value {
        NodeValue::Text(text) => {
            for (piece, _) in pieces(text).unwrap_or_default() {
                all.extend(match piece {
                    Piece::Plain(_) => None,
                    Piece::Parameter(name) => {
                        params.iter().find(|(known, _)| known == name).map(|(_, told)| told.clone())
                    }
                    Piece::Variable(name, default) => Some(variable(name, default, environment)),
                });
            }
        }
        NodeValue::List(list) => {
            all = list.iter().flat_map(|item| names(item, environment, params)).collect();
        }
        NodeValue::Table(entries) => {
            all = entries.iter().flat_map(|e| names(&e.node, environment, params)).collect();
        }
        _ => {}
    }
    let mut once: Vec<String> = Vec::new();
    all.into_iter().for_each(|name| {
        if !once.contains(&name) {
            once.push(name);
        }
    });
    once
}

/// A variable, or that its default stands for it.
fn variable(name: &str, default: Option<&str>, environment: Environment<'_>) -> String {
    let is_there = environment(name).is_some_and(|value| !value.is_empty());
    match default.filter(|_| !is_there) {
        Some(default) => format!("the default of ${{ENV:{name}:-{default}}}"),
        None => format!("${{ENV:{name}}}"),
    }
}
