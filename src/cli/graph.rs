//! `graph`: a pipeline as a drawing.

use super::arguments::{Drawing, GraphArguments};
use super::print;
use crate::Result;
use crate::graph::Graph;
use crate::language::{Registry, Set};

/// Draws the graph of a pipeline file.
pub(super) fn graph(arguments: &GraphArguments, registry: &Registry) -> Result<()> {
    let sets = arguments.sets.iter().map(|set| Set::parse(set)).collect::<Result<Vec<Set>>>()?;
    let graph = Graph::read(&arguments.pipeline, registry, &sets)?;
    let drawn = match arguments.drawing {
        Drawing::Text => graph.to_string(),
        Drawing::Mermaid => graph.to_mermaid(),
        Drawing::Dot => graph.to_dot(),
    };
    print::result(drawn.trim_end())
}
