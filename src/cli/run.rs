//! `run`, `reduce`, `synth` and `plan`: arguments to a pipeline, and the pipeline's run.

use serde_json::{Value, json};

use super::arguments::{Common, Plan, Reduce, Run, Synth, Written};
use super::print;
use super::progress::Bars;
use crate::Result;
use crate::pipeline::{Pipeline, Registry, Set};

/// The pipeline of `reduce`, which users copy.
const REDUCE: &str = include_str!("../../pipelines/reduce.toml");

/// The pipeline of `synth`.
const SYNTH: &str = "\
[[stage]]
kind = \"synth\"

[[stage]]
kind = \"write\"
";

/// Runs a pipeline file and prints its closing table.
pub(super) fn run(arguments: &Run, registry: &Registry) -> Result<()> {
    let sets = parse_sets(&arguments.sets, &arguments.common)?;
    let pipeline = Pipeline::read(&arguments.pipeline, registry, &sets)?;
    print::result(mill(pipeline, &arguments.common)?)
}

/// Runs `pipelines/reduce.toml` on other files and prints the closing table.
pub(super) fn reduce(arguments: &Reduce, registry: &Registry) -> Result<()> {
    let written = written(&arguments.written);
    let sets = [reduce_sets(arguments), written, arguments.common.sets()?].concat();
    let pipeline = Pipeline::parse_with(REDUCE, "pipelines/reduce.toml", registry, &sets)?;
    print::result(mill(pipeline, &arguments.common)?)
}

/// Writes a made-up scan.
pub(super) fn synth(arguments: &Synth, registry: &Registry) -> Result<()> {
    let stages = given([
        ("KIND", "synth.scene", Some(json!(arguments.scene))),
        ("-n", "synth.points", Some(json!(arguments.points))),
        ("-o", "write.path", Some(json!(arguments.output))),
        ("--seed", "synth.seed", arguments.seed.map(Value::from)),
        ("--noise", "synth.noise", arguments.noise.map(number)),
    ]);
    let sets = [stages, arguments.common.sets()?].concat();
    let pipeline = Pipeline::parse_with(SYNTH, "synth", registry, &sets)?;
    mill(pipeline, &arguments.common).map(|_report| ())
}

/// Prints how a pipeline would be run.
pub(super) fn plan(arguments: &Plan, registry: &Registry) -> Result<()> {
    let sets = parse_sets(&arguments.sets, &arguments.common)?;
    let pipeline = Pipeline::read(&arguments.pipeline, registry, &sets)?;
    print::result(pipeline.plan(&arguments.common.overrides())?)
}

/// Plans and runs a pipeline under progress bars; gives its report.
pub(super) fn mill(pipeline: Pipeline, common: &Common) -> Result<impl std::fmt::Display> {
    mill_under(pipeline, common, &Bars::new(common.progress))
}

/// The same under bars that several runs share.
pub(super) fn mill_under(
    pipeline: Pipeline,
    common: &Common,
    bars: &Bars,
) -> Result<impl std::fmt::Display + use<>> {
    let plan = pipeline.plan(&common.overrides())?;
    let report = plan.run(bars);
    bars.clear();
    report
}

/// Those of `(argument, address, value)` that are given.
pub(super) fn given<const N: usize>(arguments: [(&str, &str, Option<Value>); N]) -> Vec<Set> {
    let set = |(argument, address, value): (&str, &str, Option<Value>)| {
        value.map(|value| Set::argument(argument, address, value))
    };
    arguments.into_iter().filter_map(set).collect()
}

/// A number as a pipeline's value; one that JSON cannot hold is left for the stage to refuse.
pub(super) fn number(value: f64) -> Value {
    serde_json::Number::from_f64(value).map_or_else(|| json!(value.to_string()), Value::from)
}

fn parse_sets(sets: &[String], common: &Common) -> Result<Vec<Set>> {
    let sets = sets.iter().map(|set| Set::parse(set)).collect::<Result<Vec<Set>>>()?;
    Ok([sets, common.sets()?].concat())
}

fn reduce_sets(arguments: &Reduce) -> Vec<Set> {
    given([
        ("IN", "read.path", Some(json!(arguments.inputs))),
        ("-o", "write.path", arguments.output.clone().map(Value::from)),
        ("--outdir", "write.folder", arguments.outdir.clone().map(Value::from)),
        ("--to", "write.format", arguments.to.clone().map(Value::from)),
        ("--max-angle", "cells.max_angle", arguments.max_angle.as_deref().map(number_or_text)),
        ("--neighbors", "normals.neighbors", arguments.neighbors.map(Value::from)),
        ("--side", "cells.side", arguments.side.as_deref().map(number_or_text)),
        ("--min-points", "cells.min_points", arguments.min_points.map(Value::from)),
        ("--split", "cells.split", arguments.split.clone().map(Value::from)),
        ("--method", "normals.method", arguments.method.clone().map(Value::from)),
    ])
}

/// How the output is written, as the keys of `write`.
pub(super) fn written(arguments: &Written) -> Vec<Set> {
    let list = |given: bool, value: Value| given.then_some(value);
    given([
        ("--scale", "write.scale", arguments.scale.map(number)),
        ("--offset", "write.offset", list(!arguments.offset.is_empty(), json!(arguments.offset))),
        ("--drop", "write.drop", list(!arguments.drop.is_empty(), json!(arguments.drop))),
        ("--encoding", "write.encoding", arguments.encoding.as_deref().map(Value::from)),
    ])
}

/// A number where the text is one, else the text (`6deg`, `auto`).
fn number_or_text(text: &str) -> Value {
    text.parse().map_or_else(|_| json!(text), number)
}
