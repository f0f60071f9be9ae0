//! `run`, `reduce` and `synth`: arguments to a pipeline, and the pipeline's run.

use serde_json::{Value, json};

use super::arguments::{Axes, Common, Filtered, Reduce, Run, Synth, Written};
use super::console::Console;
use super::preset::Preset;
use super::words::{self, Flag, flags};
use crate::Result;
use crate::pipeline::{Done, Overrides, Pipeline, Registry, Set};

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
    let pipeline = Pipeline::read(&arguments.pipeline, registry, &sets)?;
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
    let pipeline = Pipeline::parse_with(&text, HIDDEN, registry, &sets)?;
    console.result(mill(pipeline, console)?)
}

/// Writes a made-up scan and prints the closing table.
pub(super) fn synth(arguments: &Synth, registry: &Registry, console: &Console) -> Result<()> {
    let sets = given([synth_flags(arguments), arguments.common.flags()]);
    let pipeline = Pipeline::parse_with(SYNTH, HIDDEN, registry, &sets)?;
    console.result(mill(pipeline, console)?)
}

/// Plans and runs a pipeline; Ctrl-C asks it to stop.
pub(super) fn mill(pipeline: Pipeline, console: &Console) -> Result<Done> {
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
pub(super) fn number(value: f64) -> Value {
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
    let list = |classes: &[u8]| (!classes.is_empty()).then(|| json!(classes));
    flags([
        ("--keep-classes", "filter.keep_classes", list(&arguments.keep_classes)),
        ("--drop-classes", "filter.drop_classes", list(&arguments.drop_classes)),
    ])
}

/// What becomes of noise: left out, unless all points are to be written, or noise is asked for.
fn noise(arguments: &Reduce) -> &str {
    let asked = arguments.classes.iter().chain(&arguments.filter.keep_classes);
    match &arguments.noise {
        Some(noise) => noise,
        None if asked.into_iter().any(|class| [7, 18].contains(class)) => "keep",
        None if arguments.mark.is_some() => "ignore",
        None => "drop",
    }
}

/// True if what is left is to be reduced again and nothing says by what: a number would be met at once.
fn again(arguments: &Reduce) -> bool {
    let limit = arguments.keep.is_some() || arguments.max_angle.is_some();
    arguments.passes.is_some_and(|passes| passes > 1) && !limit && arguments.preset.is_none()
}

/// The flags of `reduce`.
pub(super) fn reduce_flags(arguments: &Reduce) -> Vec<Flag> {
    let classes = (!arguments.classes.is_empty()).then(|| json!(arguments.classes));
    let mut all = flags([
        ("IN", "read.path", Some(json!(arguments.inputs))),
        ("-o", "write.path", arguments.output.clone().map(Value::from)),
        ("--outdir", "write.folder", arguments.outdir.clone().map(Value::from)),
        ("--to", "write.format", arguments.to.clone().map(Value::from)),
        ("--max-angle", "cells.max_angle", arguments.max_angle.as_deref().map(number_or_text)),
        ("--keep", "cells.keep", arguments.keep.as_deref().map(whole_or_text)),
        ("--max-side", "cells.max_side", arguments.max_side.as_deref().map(number_or_text)),
        (
            "--min-spacing",
            "cells.min_spacing",
            arguments.min_spacing.as_deref().map(number_or_text),
        ),
        ("--measure", "cells.measure", arguments.measure.clone().map(Value::from)),
        ("--reference", "cells.reference", arguments.reference.as_deref().map(numbers_or_text)),
        ("--neighbors", "normals.neighbors", arguments.neighbors.as_deref().map(whole_or_text)),
        ("--side", "cells.side", arguments.side.as_deref().map(number_or_text)),
        ("--min-points", "cells.min_points", arguments.min_points.map(Value::from)),
        ("--split", "cells.split", arguments.split.clone().map(Value::from)),
        ("--method", "normals.method", arguments.method.clone().map(Value::from)),
        ("--passes", "median.passes", arguments.passes.map(Value::from)),
        ("--passes", "cells.max_angle", again(arguments).then(|| json!("auto"))),
        ("--order", "write.order", arguments.order.clone().map(Value::from)),
        ("--mark", "median.mark", arguments.mark.as_deref().map(whole_or_text)),
        ("--classes", "outliers.classes", classes.clone().filter(|_| arguments.outliers)),
        ("--classes", "normals.classes", classes.clone()),
        ("--classes", "cells.classes", classes.clone()),
        ("--classes", "median.classes", classes),
        ("--withheld", "run.withheld", arguments.withheld.clone().map(Value::from)),
        ("--noise", "run.noise", Some(json!(noise(arguments)))),
        ("--nonfinite", "run.nonfinite", arguments.nonfinite.clone().map(Value::from)),
        ("--lattice", "run.lattice", arguments.lattice.map(number)),
        ("--headers", "run.headers", arguments.headers.clone().map(Value::from)),
        ("--z-scale", "run.z_scale", arguments.z_scale.as_deref().map(number_or_text)),
    ]);
    all.extend(filtered(&arguments.filter));
    all.extend(written(&arguments.written));
    all
}

/// The flags of `synth`.
pub(super) fn synth_flags(arguments: &Synth) -> Vec<Flag> {
    flags([
        ("KIND", "synth.scene", Some(json!(arguments.scene))),
        ("-n", "synth.points", Some(json!(arguments.points))),
        ("-o", "write.path", Some(json!(arguments.output))),
        ("--seed", "synth.seed", arguments.seed.map(Value::from)),
        ("--noise", "synth.noise", arguments.noise.map(number)),
    ])
}

/// How the output is written, as the keys of `write`.
pub(super) fn written(arguments: &Written) -> Vec<Flag> {
    let list = |given: bool, value: Value| given.then_some(value);
    flags([
        ("--scale", "write.scale", arguments.scale.as_ref().map(axes)),
        ("--offset", "write.offset", list(!arguments.offset.is_empty(), json!(arguments.offset))),
        ("--drop", "write.drop", list(!arguments.drop.is_empty(), json!(arguments.drop))),
        ("--encoding", "write.encoding", arguments.encoding.as_deref().map(Value::from)),
        ("--colors", "write.colors", arguments.colors.as_deref().map(Value::from)),
    ])
}

/// One number, or a list of them.
fn axes(Axes(numbers): &Axes) -> Value {
    match numbers[..] {
        [one] => number(one),
        _ => numbers.iter().map(|&axis| number(axis)).collect(),
    }
}

/// A whole number where the text is one, else the text.
fn whole_or_text(text: &str) -> Value {
    text.parse::<u64>().map_or_else(|_| json!(text), Value::from)
}

/// A number where the text is one, else the text (`6deg`, `auto`).
fn number_or_text(text: &str) -> Value {
    text.parse().map_or_else(|_| json!(text), number)
}

/// A list of numbers where the text is one with commas, else the text (`x`).
fn numbers_or_text(text: &str) -> Value {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    numbers.map_or_else(|_| json!(text), |numbers| numbers.into_iter().map(number).collect())
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
