//! The pipeline of `reduce`: one of two that users copy, with values of arguments.

use super::arguments::ReduceArguments;
use super::flags::{common_flags, given, reduce_flags};
use super::form::with_form;
use super::pipeline::{HIDDEN, with_stages};
use super::preset::Preset;
use crate::Result;
use crate::graph::Graph;
use crate::language::Registry;

/// The pipelines of `reduce`, which users copy: to a number or a tolerance, and by the published
/// method.
const REDUCE: &str = include_str!("../../pipelines/reduce.toml");
const BY_CELLS: &str = include_str!("../../pipelines/paper.toml");
/// The number that the first of them has, where none is asked for.
const ITS_NUMBER: &str = "keep = \"10%\"";

/// The pipeline of `reduce`.
pub(super) fn reduction(arguments: &ReduceArguments, registry: &Registry) -> Result<Graph> {
    let preset = arguments.preset.map_or(Vec::new(), Preset::sets);
    let ends = (&arguments.read, &arguments.written);
    let [all, form] = with_form(reduce_flags(arguments), &arguments.inputs, ends, registry);
    let sets = given([all, form, common_flags(&arguments.common)]);
    let sets = [preset, sets].concat();
    let outliers = arguments.outliers.then_some("outliers");
    let filter = arguments.filter.is_given().then_some("filter");
    let text = match (arguments.by_cells(), &arguments.tolerance) {
        (true, _) => BY_CELLS.to_owned(),
        (false, None) => REDUCE.replace(ITS_NUMBER, "keep = \"auto\""),
        (false, Some(_)) => REDUCE.replace(ITS_NUMBER, ""),
    };
    let text = with_stages(&text, filter.into_iter().chain(outliers));
    Graph::parse_with(&text, HIDDEN, registry, &sets)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_of_arguments_go_before_all_other_stages() {
        let kinds: Vec<String> = with_stages(REDUCE, ["filter", "outliers"].into_iter())
            .lines()
            .filter_map(|line| line.strip_prefix("kind = \"")?.split('"').next().map(str::to_owned))
            .collect();
        assert_eq!(kinds, ["read", "filter", "outliers", "graded", "write"]);
        assert!(REDUCE.contains(ITS_NUMBER));
    }
}
