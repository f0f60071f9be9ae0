//! The pipeline that a command is given, in a file or in one line, and what other arguments put in
//! the place of its values.

use std::fmt::Write as _;
use std::path::Path;

use super::arguments::{CommonArguments, PipelineArguments};
use super::flags::{common_flags, given};
use crate::graph::Graph;
use crate::language::{Explained, Parameter, PipelineText, Registry, Set};
use crate::{Error, Result};

/// The origin of the pipelines of commands: users know the flags, not these texts.
pub(super) const HIDDEN: &str = "";

/// The graph that the arguments of a command mean.
pub(super) fn read(
    arguments: &PipelineArguments,
    common: &CommonArguments,
    registry: &Registry,
) -> Result<Graph> {
    read_with(arguments, given([common_flags(common)]), registry)
}

/// The same for a command without the arguments of runs: `others` are put in the place of values.
pub(super) fn read_with(
    arguments: &PipelineArguments,
    others: Vec<Set>,
    registry: &Registry,
) -> Result<Graph> {
    let sets = [sets(arguments)?, others].concat();
    text(arguments, registry)?.graph(registry, &sets)
}

/// The pipeline with the origin of every value.
pub(super) fn explain(arguments: &PipelineArguments, registry: &Registry) -> Result<Explained> {
    text(arguments, registry)?.explain(registry, &sets(arguments)?)
}

fn sets(arguments: &PipelineArguments) -> Result<Vec<Set>> {
    let sets = arguments.sets.iter().map(|set| Set::parse(set));
    let params = arguments.params.iter().map(|param| Set::param(param));
    sets.chain(params).collect()
}

/// What help says of the parameters of a pipeline.
pub(super) fn parameters(arguments: &PipelineArguments, registry: &Registry) -> Result<String> {
    let parameters = text(arguments, registry)?.parameters()?;
    let name = &arguments.pipeline;
    if parameters.is_empty() {
        return Ok(format!("\n{name} has no parameters."));
    }
    let typed = |one: &Parameter| {
        let takes = format!("{:?}", one.takes).to_uppercase();
        format!("--param {}={takes}", one.name)
    };
    let widest = parameters.iter().map(|one| typed(one).chars().count()).max().unwrap_or_default();
    let mut out = format!("\nParameters of {name}:\n");
    for one in &parameters {
        let choices = match &one.choices[..] {
            [] => String::new(),
            choices => format!("[possible values: {}]", choices.join(", ")),
        };
        let default = match &one.default {
            Some(default) => format!("[default: {default}]"),
            None => "[must be given]".to_owned(),
        };
        let said = [one.about.clone(), default, choices];
        let said: Vec<String> = said.into_iter().filter(|part| !part.is_empty()).collect();
        let _ = writeln!(out, "  {:widest$}  {}", typed(one), said.join(" ")); // a String takes all
    }
    Ok(out)
}

fn text(arguments: &PipelineArguments, registry: &Registry) -> Result<PipelineText> {
    let typed = &arguments.pipeline;
    let text = match PipelineText::is_line(typed) {
        true => PipelineText::line(typed),
        false => PipelineText::read(Path::new(typed), registry.formats())
            .map_err(|error| not_there(typed, error, registry))?,
    };
    Ok(text.with_environment(|name| std::env::var_os(name)))
}

/// What helps where no file has the name that was typed, and it looks like a pipeline.
fn not_there(typed: &str, error: Error, registry: &Registry) -> Error {
    let first = typed.split_whitespace().next().unwrap_or_default();
    let is_meant = typed.contains('!') || first != typed && registry.has(first);
    match is_meant && !Path::new(typed).exists() {
        true => error.help(
            "a file of this name was looked for; a pipeline in one line has ` ! `, with spaces, \
             between its stages: 'read in.laz ! write out.laz'",
        ),
        false => error,
    }
}

/// The pipeline `text` with stages of these kinds behind the first, which reads.
pub(super) fn with_stages<'a>(text: &str, kinds: impl Iterator<Item = &'a str>) -> String {
    let stage = "[[stage]]\n";
    let at = text.match_indices(stage).nth(1).map_or(text.len(), |(at, _)| at);
    let stages: String = kinds.map(|kind| format!("{stage}kind = \"{kind}\"\n\n")).collect();
    format!("{}{stages}{}", &text[..at], &text[at..])
}
