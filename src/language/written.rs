//! How a stage is written: the texts of its pipeline and the places in them, for what turns out to
//! be wrong once the inputs are known.

use std::sync::Arc;

use super::mistake;
use super::mistake::{Mistake, SourceText};
use super::node::{KeyEntry, Node, NodeValue};
use crate::Error;
use crate::expression::ExpressionFault;
use crate::graph::Written;

/// A stage as it is written.
#[derive(Clone)]
pub(crate) struct WrittenText {
    sources: Arc<[SourceText]>,
    /// Its keys; their place is that of its kind.
    keys: Node,
}

impl WrittenText {
    /// A stage whose keys stand in `sources`.
    pub fn new(sources: &Arc<[SourceText]>, keys: &Node) -> Self {
        WrittenText { sources: sources.clone(), keys: keys.clone() }
    }
}

impl Written for WrittenText {
    fn wrong(&self, told: String) -> Error {
        mistake::tell(vec![Mistake::new(self.keys.place.clone(), told)], &self.sources)
    }

    fn wrong_key(&self, key: &str, told: String) -> Error {
        let place = self.keys.at(key).unwrap_or(&self.keys.place);
        mistake::tell(vec![Mistake::new(place.clone(), told)], &self.sources)
    }

    fn keys(&self) -> Option<Vec<(String, String)>> {
        let mut entries: Vec<&KeyEntry> = self.keys.entries().iter().collect();
        entries.sort_by(|a, b| a.at.cmp(&b.at)); // as they are written
        let key = |entry: &KeyEntry| (entry.key.clone(), entry.node.to_string());
        Some(entries.into_iter().map(key).collect())
    }

    fn wrong_expression(&self, key: &str, text: &str, fault: ExpressionFault) -> Error {
        let node = self.keys.entries().iter().find(|entry| entry.key == key);
        let nodes = match node.map(|entry| &entry.node) {
            Some(Node { value: NodeValue::List(list), .. }) => &list[..],
            Some(node) => std::slice::from_ref(node),
            None => &[],
        };
        let is_it = |node: &&Node| matches!(&node.value, NodeValue::Text(is) if is == text);
        let place = match nodes.iter().find(is_it) {
            Some(node) => node.place.within(text, &fault.span),
            None => self.keys.place.clone(),
        };
        let told = format!("`{key}`: {}", fault.told);
        mistake::tell(vec![Mistake::new(place, told).note(fault.help)], &self.sources)
    }
}
