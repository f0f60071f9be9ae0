//! What is asked of a format that it does not have, and names that say no format: the errors.

use std::path::Path;

use crate::error::{listed, shown};
use crate::host::standard;
use crate::io::sniff::{of_extension, upper};
use crate::stage::{Format, Formats, ReadKeys, WriteKeys};
use crate::{Error, Result};

/// Refuses keys that inputs of `format` do not have; tells which.
pub fn check_read(
    keys: &ReadKeys,
    format: &dyn Format,
    formats: &Formats,
) -> Result<(), (&'static str, Error)> {
    let Some(key) = keys.given().find(|key| !format.read_keys().contains(key)) else {
        return Ok(());
    };
    let having = formats.iter().filter(|format| format.read_keys().contains(&key));
    let having = listed(having.map(|format| format.name()), "and");
    let told = format!("`read.{key}` is for {having}, the input is {}", format.name());
    Err((key, Error::pipeline(told)))
}

/// Refuses keys that an output of `format` does not have; tells which.
pub fn check(
    keys: &WriteKeys,
    format: &dyn Format,
    formats: &Formats,
) -> Result<(), (&'static str, Error)> {
    if let Some(help) = format.unwritten() {
        let told = format!("{} files are read and not written", format.name().to_uppercase());
        return Err(("path", Error::pipeline(told).help(help)));
    }
    if let Some(key) = keys.given().find(|key| !format.keys().contains(key)) {
        let having = formats.iter().filter(|format| format.keys().contains(&key));
        let having = listed(having.map(|format| format.name()), "and");
        let is = format.name();
        let told = format!("`write.{key}` is for {having}, the output is {is}");
        return Err((key, Error::pipeline(told)));
    }
    if let Some(name) = keys.computed.first().filter(|_| !format.holds_computed()) {
        let is = format.name();
        let told = format!("`write.dimensions` asks for {name}, and {is} holds nothing computed");
        return Err(("dimensions", Error::pipeline(told).help("write LAS, PLY or another")));
    }
    let offset = keys.given_offset();
    match offset.is_some_and(|offset| offset.iter().any(|v| !v.is_finite())) {
        true => Err(("offset", Error::pipeline("an offset is three finite numbers"))),
        false => Ok(()),
    }
}

/// The error of a file of which neither its extension nor `setting` says the format.
pub fn unknown_extension(path: &Path, setting: &str, formats: &Formats) -> Error {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let name = shown(path);
    let is_read = setting.starts_with("read");
    if standard::is_input(path) || standard::is_output(path) {
        let names = formats.iter().filter(|format| is_read || format.unwritten().is_none());
        let names = listed(names.map(|format| format.name()), "or");
        let told = format!("nothing says the format of {name}");
        return Error::pipeline(told).help(format!("give `{setting}`: {names}"));
    }
    let can = if is_read { "read" } else { "written" };
    let known = formats.iter().filter(|format| is_read || format.unwritten().is_none());
    let dotted = listed(known.map(|format| format!(".{}", format.extension())), "or");
    match of_extension(&extension) {
        Some(format) => {
            let told = format!("by its extension `{name}` is {format}, which is not {can}");
            let known = listed(upper(formats), "or");
            Error::pipeline(told).help(match is_read {
                true => format!("convert it to {known} with another program first"),
                false => format!("name it {dotted}"),
            })
        }
        None => Error::pipeline(format!("the extension of `{name}` names no format"))
            .help(format!("name it {dotted}, or give `{setting}`")),
    }
}
