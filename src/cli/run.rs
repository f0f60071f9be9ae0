//! `run`, `reduce` and `synth`: arguments to a pipeline, and the pipeline's run.

use super::arguments::{CutArguments, PlanArguments, ReduceArguments, SynthArguments};
use super::console::Console;
use super::flags::{common_flags, cut_flags, given, reduce_flags, synth_flags};
use super::noise::{tolerance_of, warn_of_noise};
use super::pipeline;
use super::preset::Preset;
use super::preview::preview;
use super::size::reduce_to_size;
use crate::Result;
use crate::engine::Done;
use crate::graph::Graph;
use crate::graph::Overrides;
use crate::language::Registry;

/// The pipelines of `reduce`, which users copy: to a number or a tolerance, and by the published
/// method.
const REDUCE: &str = include_str!("../../pipelines/reduce.toml");
const BY_CELLS: &str = include_str!("../../pipelines/paper.toml");
/// The number that the first of them has, where none is asked for.
const ITS_NUMBER: &str = "keep = \"10%\"";

/// The origin of the pipelines of commands: users know the flags, not these texts.
pub(super) const HIDDEN: &str = "";
/// Behind what `reduce` chose by itself.
const OTHERWISE: &str =
    "by the noise and spacing of the scan; --preset paper is the published method";

/// The pipeline of `synth`.
const SYNTH: &str = "\
[[stage]]
kind = \"synth\"

[[stage]]
kind = \"write\"
";

/// The pipeline of `cut`: what was kept is kept, noise or not.
const CUT: &str = "\
[run]
withheld = \"keep\"

[[stage]]
kind = \"read\"

[[stage]]
kind = \"cut\"

[[stage]]
kind = \"write\"
";

/// Runs a pipeline and prints its closing table.
pub(super) fn run(arguments: &PlanArguments, registry: &Registry, console: &Console) -> Result<()> {
    let read = || pipeline::read(&arguments.pipeline, &arguments.common, registry);
    finish(&mill_towards(&read, console)?, console)
}

/// Runs `pipelines/reduce.toml` or `pipelines/paper.toml` on other files and prints the closing
/// table; or shows what several such runs would come to.
pub(super) fn reduce(
    arguments: &ReduceArguments,
    registry: &Registry,
    console: &Console,
) -> Result<()> {
    if arguments.preview {
        return preview(arguments, registry, console);
    }
    if let Some(bytes) = arguments.size {
        return finish(&reduce_to_size(arguments, bytes, registry, console)?, console);
    }
    if arguments.preset.is_none() && arguments.by_cells() {
        // By options of cells, of which some may be left to the scan.
        console.hint(OTHERWISE);
    }
    finish(&mill_towards(&|| reduction(arguments, registry), console)?, console)
}

/// The pipeline of `reduce`.
pub(super) fn reduction(arguments: &ReduceArguments, registry: &Registry) -> Result<Graph> {
    let preset = arguments.preset.map_or(Vec::new(), Preset::sets);
    let sets = [preset, given([reduce_flags(arguments), common_flags(&arguments.common)])].concat();
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

/// Cuts a coarser reduction off one with ranks and prints the closing table.
pub(super) fn cut(arguments: &CutArguments, registry: &Registry, console: &Console) -> Result<()> {
    let sets = given([cut_flags(arguments), common_flags(&arguments.common)]);
    let pipeline = Graph::parse_with(CUT, HIDDEN, registry, &sets)?;
    finish(&mill(pipeline, console)?, console)
}

/// Writes a made-up scan and prints the closing table.
pub(super) fn synth(
    arguments: &SynthArguments,
    registry: &Registry,
    console: &Console,
) -> Result<()> {
    let sets = given([synth_flags(arguments), common_flags(&arguments.common)]);
    let pipeline = Graph::parse_with(SYNTH, HIDDEN, registry, &sets)?;
    finish(&mill(pipeline, console)?, console)
}

/// Plans and runs a pipeline; Ctrl-C asks it to stop.
pub(super) fn mill(pipeline: Graph, console: &Console) -> Result<Done> {
    console.hear_interrupts();
    console.run(pipeline.plan(&Overrides::default())?)
}

/// Plans and runs the pipeline that `read` makes, which may have a tolerance.
fn mill_towards(read: &dyn Fn() -> Result<Graph>, console: &Console) -> Result<Done> {
    console.hear_interrupts();
    let graph = read()?;
    let tolerance = tolerance_of(&graph)?;
    let plan = graph.plan(&Overrides::default())?;
    if let Some(tolerance) = tolerance {
        warn_of_noise(tolerance, &plan, read, console)?;
    }
    console.run(plan)
}

/// Prints the closing table of a run; fails if its result is not accepted.
pub(super) fn finish(done: &Done, console: &Console) -> Result<()> {
    console.result(done)?;
    done.accepted()
}

/// The pipeline `text` with stages of these kinds behind the first, which reads.
pub(super) fn with_stages<'a>(text: &str, kinds: impl Iterator<Item = &'a str>) -> String {
    let stage = "[[stage]]\n";
    let at = text.match_indices(stage).nth(1).map_or(text.len(), |(at, _)| at);
    let stages: String = kinds.map(|kind| format!("{stage}kind = \"{kind}\"\n\n")).collect();
    format!("{}{stages}{}", &text[..at], &text[at..])
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
