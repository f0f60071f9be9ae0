//! Flags of an output that are about its inputs, too: several that differ are brought to one form
//! as they are read.

use std::path::{Path, PathBuf};

use super::arguments::{ReadArguments, WrittenArguments};
use super::flags::{CommandFlag, flags, numbers_or_text, whole_or_text};
use crate::io::ends::expand;
use crate::language::Registry;

/// [`united`] where `inputs` are several LAS files, or LAS files whose coordinates become others;
/// other inputs are not brought to such a form.
pub(super) fn one_form(
    inputs: &[String],
    read: &ReadArguments,
    arguments: &WrittenArguments,
    registry: &Registry,
) -> Vec<CommandFlag> {
    let form = united(arguments);
    if form.iter().all(|flag| flag.given.is_none()) {
        return form;
    }
    let formats = registry.formats();
    let named =
        read.from.as_deref().and_then(|name| formats.iter().find(|format| format.name() == name));
    let has_scale = |file: &PathBuf| {
        let format = named.or_else(|| formats.of(file));
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

/// The flags of an output without those that are about the one `form` of its inputs alone, where
/// its own format has no such key.
pub(super) fn without_form(
    all: Vec<CommandFlag>,
    form: &[CommandFlag],
    (output, to): (&str, Option<&str>),
    registry: &Registry,
) -> Vec<CommandFlag> {
    let formats = registry.formats();
    let named = to.and_then(|name| formats.iter().find(|format| format.name() == name));
    let format = named.or_else(|| formats.of(Path::new(output)));
    let lacks = |key: &str| format.is_some_and(|format| !format.keys().contains(&key));
    let is_of_form = |flag: &CommandFlag| {
        let key = flag.address.strip_prefix("write.");
        form.iter().any(|of| of.name == flag.name && of.given.is_some()) && key.is_some_and(lacks)
    };
    all.into_iter().filter(|flag| !is_of_form(flag)).collect()
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
