//! `run`, `reduce` and `synth`: arguments to a pipeline, and the pipeline's run.

use serde_json::{Value, json};

use super::arguments::{Classes, Common, Filtered, Reduce, Run, Synth, Written};
use super::console::Console;
use super::preset::Preset;
use super::words::{self, Flag, Given, flags};
use crate::Result;
use crate::engine::Done;
use crate::graph::Graph;
use crate::graph::Overrides;
use crate::language::{Registry, Set};
use crate::quantity::parse_count;

/// The pipeline of `reduce`, which users copy.
const REDUCE: &str = include_str!("../../pipelines/reduce.toml");

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

/// Runs a pipeline file and prints its closing table.
pub(super) fn run(arguments: &Run, registry: &Registry, console: &Console) -> Result<()> {
    let sets = parse_sets(&arguments.sets, &arguments.common)?;
    let pipeline = Graph::read(&arguments.pipeline, registry, &sets)?;
    console.result(mill(pipeline, console)?)
}

/// Runs `pipelines/reduce.toml` on other files and prints the closing table.
pub(super) fn reduce(arguments: &Reduce, registry: &Registry, console: &Console) -> Result<()> {
    let preset = arguments.preset.map_or(Vec::new(), Preset::sets);
    let sets = [preset, given([reduce_flags(arguments), arguments.common.flags()])].concat();
    if arguments.preset.is_none() {
        console.hint(OTHERWISE);
    }
    let outliers = arguments.outliers.then_some("outliers");
    let filter = arguments.filter.is_given().then_some("filter");
    let text = with_stages(REDUCE, filter.into_iter().chain(outliers));
    let pipeline = Graph::parse_with(&text, HIDDEN, registry, &sets)?;
    console.result(mill(pipeline, console)?)
}

/// Writes a made-up scan and prints the closing table.
pub(super) fn synth(arguments: &Synth, registry: &Registry, console: &Console) -> Result<()> {
    let sets = given([synth_flags(arguments), arguments.common.flags()]);
    let pipeline = Graph::parse_with(SYNTH, HIDDEN, registry, &sets)?;
    console.result(mill(pipeline, console)?)
}

/// Plans and runs a pipeline; Ctrl-C asks it to stop.
pub(super) fn mill(pipeline: Graph, console: &Console) -> Result<Done> {
    console.hear_interrupts();
    let plan = pipeline.plan(&Overrides::default())?;
    console.planned(&plan);
    let done = plan.run(console);
    console.end();
    done.inspect(|done| console.done(done))
}

/// The values of several tables of flags.
pub(super) fn given<const N: usize>(tables: [Vec<Flag>; N]) -> Vec<Set> {
    words::sets(tables.into_iter().flatten().collect())
}

/// A number as a pipeline's value; one that JSON cannot hold is left for the stage to refuse.
fn number(value: f64) -> Value {
    serde_json::Number::from_f64(value).map_or_else(|| json!(value.to_string()), Value::from)
}

/// The values of `--set`, and those of other arguments.
pub(super) fn parse_sets(sets: &[String], common: &Common) -> Result<Vec<Set>> {
    let sets = sets.iter().map(|set| Set::parse(set)).collect::<Result<Vec<Set>>>()?;
    Ok([sets, given([common.flags()])].concat())
}

/// The pipeline `text` with stages of these kinds behind the first, which reads.
pub(super) fn with_stages<'a>(text: &str, kinds: impl Iterator<Item = &'a str>) -> String {
    let stage = "[[stage]]\n";
    let at = text.match_indices(stage).nth(1).map_or(text.len(), |(at, _)| at);
    let stages: String = kinds.map(|kind| format!("{stage}kind = \"{kind}\"\n\n")).collect();
    format!("{}{stages}{}", &text[..at], &text[at..])
}

impl Filtered {
    /// True if any points are to be left out.
    pub fn is_given(&self) -> bool {
        !self.keep_classes.is_empty() || !self.drop_classes.is_empty()
    }
}

/// Which points are left out, as the keys of `filter`.
pub(super) fn filtered(arguments: &Filtered) -> Vec<Flag> {
    flags([
        ("--keep-classes", "filter.keep_classes", classes(&arguments.keep_classes)),
        ("--drop-classes", "filter.drop_classes", classes(&arguments.drop_classes)),
    ])
}

/// What becomes of noise: left out, unless all points are to be written, or noise is asked for.
fn noise(arguments: &Reduce) -> &str {
    let mut asked = arguments.classes.iter().chain(&arguments.filter.keep_classes);
    match &arguments.noise {
        Some(noise) => noise,
        None if asked.any(|classes| classes.has(7) || classes.has(18)) => "keep",
        None if arguments.mark.is_some() => "ignore",
        None => "drop",
    }
}

/// True if what is left is to be reduced again and nothing says by what: a number would be met at once.
fn again(arguments: &Reduce) -> bool {
    let passes = arguments.passes.as_deref().and_then(|passes| parse_count(passes).ok());
    let limit = arguments.keep.is_some() || arguments.max_angle.is_some();
    passes.is_some_and(|passes| passes > 1) && !limit && arguments.preset.is_none()
}

/// The flags of `reduce`.
pub(super) fn reduce_flags(arguments: &Reduce) -> Vec<Flag> {
    let classes = || classes(&arguments.classes);
    let mut all = flags([
        ("IN", "read.path", Some(json!(arguments.inputs).into())),
        ("-o", "write.path", arguments.output.clone().map(Given::from)),
        ("--outdir", "write.folder", arguments.outdir.clone().map(Given::from)),
        ("--to", "write.format", arguments.to.clone().map(Given::from)),
        ("--max-angle", "cells.max_angle", arguments.max_angle.as_deref().map(number_or_text)),
        ("--keep", "cells.keep", arguments.keep.as_deref().map(whole_or_text)),
        ("--max-side", "cells.max_side", arguments.max_side.as_deref().map(number_or_text)),
        (
            "--min-spacing",
            "cells.min_spacing",
            arguments.min_spacing.as_deref().map(number_or_text),
        ),
        ("--measure", "cells.measure", arguments.measure.clone().map(Given::from)),
        ("--reference", "cells.reference", arguments.reference.as_deref().map(numbers_or_text)),
        ("--neighbors", "normals.neighbors", arguments.neighbors.as_deref().map(whole_or_text)),
        ("--side", "cells.side", arguments.side.as_deref().map(number_or_text)),
        ("--min-points", "cells.min_points", arguments.min_points.as_deref().map(whole_or_text)),
        ("--split", "cells.split", arguments.split.clone().map(Given::from)),
        ("--method", "normals.method", arguments.method.clone().map(Given::from)),
        ("--passes", "median.passes", arguments.passes.as_deref().map(whole_or_text)),
        ("--passes", "cells.max_angle", again(arguments).then(|| "auto".into())),
        ("--order", "write.order", arguments.order.clone().map(Given::from)),
        ("--mark", "median.mark", arguments.mark.as_deref().map(whole_or_text)),
        ("--classes", "outliers.classes", classes().filter(|_| arguments.outliers)),
        ("--classes", "normals.classes", classes()),
        ("--classes", "cells.classes", classes()),
        ("--classes", "median.classes", classes()),
        ("--withheld", "run.withheld", arguments.withheld.clone().map(Given::from)),
        ("--noise", "run.noise", Some(noise(arguments).into())),
        ("--nonfinite", "run.nonfinite", arguments.nonfinite.clone().map(Given::from)),
        ("--lattice", "run.lattice", arguments.lattice.as_deref().map(number_or_text)),
        ("--headers", "run.headers", arguments.headers.clone().map(Given::from)),
        ("--z-scale", "run.z_scale", arguments.z_scale.as_deref().map(number_or_text)),
    ]);
    all.extend(filtered(&arguments.filter));
    all.extend(written(&arguments.written));
    all
}

/// The flags of `synth`.
pub(super) fn synth_flags(arguments: &Synth) -> Vec<Flag> {
    flags([
        ("KIND", "synth.scene", Some(arguments.scene.clone().into())),
        ("-n", "synth.points", Some(whole_or_text(&arguments.points))),
        ("-o", "write.path", Some(arguments.output.clone().into())),
        ("--seed", "synth.seed", arguments.seed.as_deref().map(whole_or_text)),
        ("--noise", "synth.noise", arguments.noise.as_deref().map(number_or_text)),
    ])
}

/// How the output is written, as the keys of `write`.
pub(super) fn written(arguments: &Written) -> Vec<Flag> {
    let names = (!arguments.drop.is_empty()).then(|| json!(arguments.drop).into());
    flags([
        ("--scale", "write.scale", arguments.scale.as_deref().map(numbers_or_text)),
        ("--offset", "write.offset", arguments.offset.as_deref().map(numbers_or_text)),
        ("--drop", "write.drop", names),
        ("--encoding", "write.encoding", arguments.encoding.clone().map(Given::from)),
        ("--colors", "write.colors", arguments.colors.clone().map(Given::from)),
    ])
}

/// All classes of several numbers and ranges.
fn classes(given: &[Classes]) -> Option<Given> {
    let all: Vec<u8> = given.iter().flat_map(Classes::each).collect();
    let typed: Vec<String> = given.iter().map(Classes::to_string).collect();
    (!all.is_empty()).then(|| Given::of(&typed.join(","), json!(all)))
}

/// A whole number where the text is one (`10k`, `1e1`), else a number or the text.
pub(super) fn whole_or_text(text: &str) -> Given {
    match parse_count(text) {
        Ok(count) => Given::of(text, count.into()),
        // As a float it would be told in other digits than were typed.
        Err(_) if is_too_large(text) => Given::of(text, json!(text.trim())),
        Err(_) => number_or_text(text),
    }
}

/// True for a whole number that no integer holds.
fn is_too_large(text: &str) -> bool {
    let digits = text.trim().trim_start_matches(['-', '+']);
    digits.len() > 15 && digits.chars().all(|c| c.is_ascii_digit())
}

/// A number where the text is one, else the text (`6deg`, `auto`).
fn number_or_text(text: &str) -> Given {
    Given::of(text, plain(text))
}

/// A list of numbers where the text has commas (what is no number there is told), else a number or the
/// text (`x`).
fn numbers_or_text(text: &str) -> Given {
    let list = || text.split(',').map(plain).collect();
    Given::of(text, if text.contains(',') { list() } else { plain(text) })
}

fn plain(text: &str) -> Value {
    let text = text.trim();
    match text.parse::<i64>() {
        Ok(whole) => whole.into(),
        Err(_) => text.parse().map_or_else(|_| json!(text), number),
    }
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
        assert_eq!(kinds, ["read", "filter", "outliers", "normals", "cells", "median", "write"]);
    }
}
