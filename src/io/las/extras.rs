//! The extra bytes that several LAS inputs have together, where not all have the same.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::extra::Descriptor;
use super::input::LasInput;
use super::union::described;
use crate::error::shown;
use crate::stage::OnError;
use crate::{Error, Result};

/// The descriptors of all extra bytes that the files at `paths` have, sorted by name; None if each
/// has the same, in one order.
///
/// # Errors
///
/// Files that cannot be read, bytes that nothing describes, and two descriptions of one name.
pub fn of_all(paths: &[PathBuf], on_error: OnError) -> Result<Option<Vec<Descriptor>>> {
    let mut first: Option<Vec<Descriptor>> = None;
    let mut differ = false;
    let mut all: BTreeMap<String, (Descriptor, &Path)> = BTreeMap::new();
    let mut bare: Option<&Path> = None;
    for path in paths {
        let input = LasInput::open(path, on_error)?;
        let own = described(&input);
        let size: usize = own.iter().map(Descriptor::size).sum();
        if size != input.extra_len() {
            bare = bare.or(Some(path));
        }
        differ |= first.as_ref().is_some_and(|first| *first != own);
        for descriptor in &own {
            let known = all.entry(descriptor.name());
            let (known, other) = known.or_insert_with(|| (descriptor.clone(), path));
            if *known != *descriptor {
                return Err(unlike(&descriptor.name(), path, other));
            }
        }
        let names: Vec<String> = own.iter().map(Descriptor::name).collect();
        if names.iter().enumerate().any(|(n, name)| names[..n].contains(name)) {
            bare = bare.or(Some(path));
        }
        first.get_or_insert(own);
    }
    match bare.filter(|_| differ) {
        None => Ok(differ.then(|| all.into_values().map(|(descriptor, _)| descriptor).collect())),
        Some(path) => Err(Error::data(
            path,
            "its extra bytes have no names, or two of them have one: they cannot be told from \
             those of other inputs",
        )
        .help("convert it by itself first, with `write.drop` or `write.map`")),
    }
}

fn unlike(name: &str, path: &Path, other: &Path) -> Error {
    let told = format!(
        "its extra bytes `{name}` are of another type, scale or meaning than those of {}",
        shown(other)
    );
    Error::data(path, told).help(format!(
        "convert one of the two by itself first: `write.types = [\"{name}=f64\"]` gives it a type, \
         `write.map` another name"
    ))
}
