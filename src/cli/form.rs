//! Flags of an output that are about its inputs, too: several that differ are brought to one form
//! as they are read.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::arguments::{ReadArguments, WrittenArguments};
use super::flags::{CommandFlag, flags, numbers_or_text, whole_or_text};
use crate::io::ends::expand;
use crate::language::Registry;
use crate::stage::{Format, Formats};

/// The flags `all` of a command that reads `inputs` and writes, and those of the one form that the
/// inputs are brought to. What is about that form alone, since the output's format has no such key,
/// is not among the first any more.
pub(super) fn with_form(
    all: Vec<CommandFlag>,
    inputs: &[String],
    (read, written): (&ReadArguments, &WrittenArguments),
    registry: &Registry,
) -> [Vec<CommandFlag>; 2] {
    let form = one_form(inputs, read, written, registry);
    let given = |address: &str| {
        let flag = all.iter().find(|flag| flag.address == address);
        flag.and_then(|flag| flag.given.as_ref()?.text()).map(str::to_owned)
    };
    let (output, to) = (given("write.path"), given("write.format"));
    let output = output.map(PathBuf::from);
    let format = output.and_then(|output| format_of(&output, to.as_deref(), registry.formats()));
    let lacks = |key: &str| format.is_some_and(|format| !format.keys().contains(&key));
    let is_of_form = |flag: &CommandFlag| {
        let key = flag.address.strip_prefix("write.");
        form.iter().any(|of| of.name == flag.name && of.given.is_some()) && key.is_some_and(lacks)
    };
    [all.into_iter().filter(|flag| !is_of_form(flag)).collect(), form]
}

/// The format of a file: the one that is named, else that of its extension.
fn format_of<'a>(
    file: &Path,
    named: Option<&str>,
    formats: &'a Formats,
) -> Option<&'a Arc<dyn Format>> {
    let by_name = |name: &str| formats.iter().find(|format| format.name() == name);
    named.and_then(by_name).or_else(|| formats.of(file))
}

/// [`united`] where `inputs` are several LAS files, or LAS files whose coordinates become others;
/// other inputs are not brought to such a form.
fn one_form(
    inputs: &[String],
    read: &ReadArguments,
    written: &WrittenArguments,
    registry: &Registry,
) -> Vec<CommandFlag> {
    let form = united(written);
    if form.iter().all(|flag| flag.given.is_none()) {
        return form;
    }
    let formats = registry.formats();
    let has_scale = |file: &PathBuf| {
        let format = format_of(file, read.from.as_deref(), formats);
        format.is_some_and(|format| format.read_keys().contains(&"scale"))
    };
    // What is wrong with the names, the run tells.
    let files = expand(inputs, formats).unwrap_or_default();
    let is_wanted = files.len() > 1 || read.reproject.is_some();
    match is_wanted && files.iter().all(has_scale) {
        true => form,
        false => Vec::new(),
    }
}

/// The one form that several LAS inputs are brought to, as keys of `read`: that of the output. What
/// is dropped may be what its point format lacks, so that the inputs first have one that has all.
pub(super) fn united(arguments: &WrittenArguments) -> Vec<CommandFlag> {
    let format = arguments.point_format.as_deref();
    let format = format.map(|given| if arguments.drop.is_empty() { given } else { "auto" });
    flags([
        ("--scale", "read.scale", arguments.scale.as_deref().map(numbers_or_text)),
        ("--offset", "read.offset", arguments.offset.as_deref().map(numbers_or_text)),
        ("--point-format", "read.point_format", format.map(whole_or_text)),
    ])
}
