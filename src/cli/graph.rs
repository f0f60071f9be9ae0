//! `graph`: a pipeline as a drawing.

use super::arguments::{Drawing, GraphArguments};
use super::{pipeline, print};
use crate::Result;
use crate::language::Registry;

/// Draws the graph of a pipeline.
pub(super) fn graph(arguments: &GraphArguments, registry: &Registry) -> Result<()> {
    let registry = registry.clone().unread();
    let graph = pipeline::read_with(&arguments.pipeline, Vec::new(), &registry)?;
    let drawn = match arguments.drawing {
        Drawing::Text => graph.to_string(),
        Drawing::Mermaid => graph.to_mermaid(),
        Drawing::Dot => graph.to_dot(),
    };
    print::result(drawn.trim_end())
}
