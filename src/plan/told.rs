//! What outputs and the report are to say of the run: taken down while the graph is as it was
//! written, and settled once it is known in which order records are wanted.

use std::sync::Arc;

use super::order::WriteOrder;
use super::sorted::Sorted;
use crate::engine::pass::StreamOp;
use crate::engine::provenance::Provenance;
use crate::graph::noted::NotedGraph;
use crate::graph::{Graph, RunSettings};

/// What is to be said of a graph.
pub(super) struct ToldGraph {
    noted: Option<NotedGraph>,
    /// What was said when it ran before.
    again: Option<Arc<str>>,
}

impl ToldGraph {
    /// A graph as it was written.
    pub fn of(graph: &Graph, settings: &RunSettings) -> Self {
        let noted = settings.has_provenance().then(|| NotedGraph::of(graph, settings)).flatten();
        ToldGraph { noted, again: graph.note.clone() }
    }

    /// What outputs and the report say of its run.
    pub fn provenance(
        self,
        sorted: &Sorted,
        order: &WriteOrder,
        settings: &RunSettings,
    ) -> Provenance {
        if let Some(text) = self.again {
            return Provenance::Again(text);
        }
        let is_noted = self.noted.is_some() && sorted.sinks.iter().any(|sink| sink.is_file());
        if !settings.has_provenance() || !(is_noted || settings.report.is_some()) {
            return Provenance::Untold;
        }
        let numbered = sorted.transforms.iter().any(StreamOp::reads_record_numbers);
        let decides = !order.mills || order.in_input_order.contains(&true) || numbered;
        let noted = self.noted.map(|noted| Arc::new(noted.in_order(decides)));
        let files = match &noted {
            Some(noted) => noted.files().to_vec(),
            None => sorted.source.1.paths(),
        };
        Provenance::Told { files, noted }
    }
}
