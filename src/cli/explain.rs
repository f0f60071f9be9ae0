//! `explain`: a pipeline as it takes effect, with the origin of every value.

use super::arguments::ExplainArguments;
use super::{pipeline, print};
use crate::Result;
use crate::language::Registry;

/// Prints a pipeline with every key, and where each value is from.
pub(super) fn explain(arguments: &ExplainArguments, registry: &Registry) -> Result<()> {
    let explained = pipeline::explain(&arguments.pipeline, &registry.clone().unread())?;
    match arguments.json {
        true => print::json(&format!("{:#}", explained.to_json())),
        // Texts in TOML escape as those of JSON do.
        false => print::json(&explained.to_string()),
    }
}
