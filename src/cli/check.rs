//! `plan` and `check`: what a pipeline would do, and whether it can.

use std::path::PathBuf;

use super::arguments::{CommonArguments, PlanArguments, PredictArguments};
use super::console::Console;
use super::draw::{Nothing, watched};
use super::flags::{CommandFlag, common_flags, given};
use super::mistyped::marked;
use super::pipeline;
use super::print;
use crate::error::shown;
use crate::graph::{Graph, Overrides, RunSettings};
use crate::language::Registry;
use crate::plan::Outline;
use crate::report::Grouped;
use crate::stage::Role;
use crate::{Error, Result, io};

/// Prints how a pipeline would be run.
pub(super) fn plan(
    PredictArguments { planned, json, no_trial }: &PredictArguments,
    registry: &Registry,
    console: &Console,
) -> Result<()> {
    let plan = read(planned, registry)?.plan(&Overrides::default())?;
    plan.warnings().iter().for_each(|warning| console.warn(warning));
    let prediction = match no_trial {
        true => plan.predict()?,
        false => {
            console.hear_interrupts();
            let again = read(planned, registry)?;
            watched(&mut Nothing, &|| console.cancelled(), |watch| {
                plan.predict_by_trial(again, watch)
            })?
        }
    };
    if !json {
        return print::result(format_args!("{plan}\n{prediction}"));
    }
    let mut told = plan.to_json();
    let failed = |e| Error::internal("a prediction could not be written as JSON").because(e);
    told["prediction"] = serde_json::to_value(&prediction).map_err(failed)?;
    print::json(&format!("{told:#}"))
}

/// Prints that a pipeline can be run, or fails as its run would before it reads a point; then the
/// inputs that cannot be read are all told, and not the first alone.
pub(super) fn check(
    arguments: &PlanArguments,
    registry: &Registry,
    console: &Console,
) -> Result<()> {
    let pipeline = read(arguments, registry)?;
    let inputs = inputs(&pipeline);
    let name = pipeline.origin.clone();
    match pipeline.plan(&Overrides::default()) {
        Ok(plan) => {
            console.planned(&plan);
            plan.warnings().iter().for_each(|warning| console.warn(warning));
            console.result(format_args!("{name} is right: {}", said(&plan.outline())))
        }
        Err(error) => {
            let told = error.to_string(); // of one input, or of several and other mistakes
            let others = inputs.iter().filter(|input| !told.contains(&shown(input).to_string()));
            let wrong = |input: &PathBuf| {
                io::describe(input, registry.formats()).err().map(|e| e.at(input))
            };
            for other in others.filter_map(wrong) {
                console.error(&other);
            }
            Err(error)
        }
    }
}

fn read(arguments: &PlanArguments, registry: &Registry) -> Result<Graph> {
    refuse_outputs(&arguments.common)?;
    pipeline::read(&arguments.pipeline, &arguments.common, registry)
}

/// Refuses flags about files that are written, for commands that write none.
pub(super) fn refuse_outputs(common: &CommonArguments) -> Result<()> {
    let flags = [
        ("--report", common.report.is_some()),
        ("--no-clobber", common.no_clobber),
        ("--no-provenance", common.no_provenance),
    ];
    match flags.into_iter().find(|(_, is_given)| *is_given) {
        None => Ok(()),
        Some((flag, _)) => {
            let told = marked(&format!("{flag}: is for commands that write files"), flag, "");
            Err(Error::pipeline(told).help("give it to `run`"))
        }
    }
}

/// Refuses flags about what is written or judged, for commands that read scans and tell figures;
/// `instead` is what to do about rules.
pub(super) fn refuse_rules(common: &CommonArguments, instead: &str) -> Result<()> {
    refuse_outputs(common)?;
    let Some(rules) = &common.accept else { return Ok(()) };
    let told = marked("--accept: is for commands that reduce or write", rules, "");
    Err(Error::pipeline(told).help(instead))
}

/// The settings of the runs that read the scans of such a command, of its own flags and those that
/// all commands have.
pub(super) fn reading(
    common: &CommonArguments,
    own: Vec<CommandFlag>,
    registry: &Registry,
) -> Result<RunSettings> {
    let text = "[[stage]]\nkind = \"read\"\n\n[[stage]]\nkind = \"discard\"\n";
    let sets = given([own, common_flags(common)]);
    Ok(Graph::parse_with(text, pipeline::HIDDEN, registry, &sets)?.settings)
}

fn inputs(pipeline: &Graph) -> Vec<PathBuf> {
    let paths = |role: &Role| match role {
        Role::Source(source) => source.paths(),
        _ => Vec::new(),
    };
    pipeline.stages.iter().flat_map(|stage| paths(&stage.role)).collect()
}

fn said(outline: &Outline) -> String {
    let Outline { inputs, points, .. } = outline;
    let outputs: Vec<String> =
        outline.outputs.iter().map(|output| shown(output).to_string()).collect();
    let files = if *inputs == 1 { "file" } else { "files" };
    let from = if *inputs == 0 { String::new() } else { format!(" from {inputs} {files}") };
    let points = Grouped(*points);
    format!("{points} points{from} would become {}", outputs.join(", "))
}
