//! How a stage is written: the texts of its pipeline and the places in them, for what turns out to be
//! wrong once the inputs are known.

use std::sync::Arc;

use super::mistake::{self, Mistake, SourceText};
use super::node::Node;
use crate::Error;

/// A stage as it is written.
#[derive(Clone)]
pub(super) struct Written {
    sources: Arc<[SourceText]>,
    /// Its keys; their place is that of its kind.
    keys: Node,
}

impl Written {
    /// A stage whose keys stand in `sources`.
    pub fn new(sources: &Arc<[SourceText]>, keys: &Node) -> Self {
        Written { sources: sources.clone(), keys: keys.clone() }
    }

    /// An error about the stage, told where its kind is written.
    pub fn wrong(&self, told: impl Into<String>) -> Error {
        mistake::tell(vec![Mistake::new(self.keys.place.clone(), told)], &self.sources)
    }

    /// An error about the value of `key`, told where that is written.
    pub fn wrong_key(&self, key: &str, told: impl Into<String>) -> Error {
        let place = self.keys.at(key).unwrap_or(&self.keys.place);
        mistake::tell(vec![Mistake::new(place.clone(), told)], &self.sources)
    }
}
