//! How a stage is written: the texts of its pipeline and the places in them, for what turns out to
//! be wrong once the inputs are known.

use std::sync::Arc;

use super::mistake;
use super::mistake::{Mistake, SourceText};
use super::node::Node;
use crate::Error;
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
}
