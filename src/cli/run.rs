//! `run`, `reduce` and `synth`: arguments to a pipeline, and the pipeline's run.

use std::path::Path;

use super::arguments::{CutArguments, PlanArguments, ReduceArguments, SynthArguments};
use super::console::Console;
use super::flags::{common_flags, cut_flags, given, synth_flags};
use super::noise::{tolerance_of, warn_of_noise};
use super::pipeline;
use super::pipeline::HIDDEN;
use super::preview::preview;
use super::reduction::reduction;
use super::size::reduce_to_size;
use crate::Result;
use crate::engine::Done;
use crate::graph::Graph;
use crate::graph::Overrides;
use crate::host::standard;
use crate::language::Registry;

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

/// Prints the closing table of a run, beside points that went to standard output on stderr; fails
/// if its result is not accepted.
pub(super) fn finish(done: &Done, console: &Console) -> Result<()> {
    let mut outputs = done.report.run.outputs.iter();
    match outputs.any(|output| standard::is_output(Path::new(&output.path))) {
        true => console.note(done),
        false => console.result(done)?,
    }
    done.accepted()
}
