//! What a file's header says, for `info`.

use std::path::Path;
use std::sync::Arc;

use serde::Serialize;

use super::sniff;
use crate::error::listed;
use crate::stage::{Format, Formats};
use crate::{Error, Result};

/// What the header of the file at `path` says, as JSON; which of `formats` it is, its first bytes
/// tell.
///
/// # Errors
///
/// Files of no format among them, and headers that their format does not allow.
pub fn describe(path: &Path, formats: &Formats) -> Result<serde_json::Value> {
    let format = format_of(path, formats)?;
    let told = |error| sniff::told(error, &**format, formats);
    let mut facts = format.describe(path).map_err(told)?;
    if let (Some(facts), Some(told)) = (facts.as_object_mut(), format.note(path)?) {
        // What is no JSON is shown as it is: whoever wrote it.
        let told = serde_json::from_str(&told).unwrap_or(told.into());
        facts.insert("provenance".to_owned(), told);
    }
    Ok(facts)
}

/// The format of the file at `path`, as its first bytes tell.
///
/// # Errors
///
/// A file of no format among `formats`.
pub(super) fn format_of<'a>(path: &Path, formats: &'a Formats) -> Result<&'a Arc<dyn Format>> {
    let first = sniff::first_bytes(path)?;
    found(path, &first, formats).ok_or_else(|| {
        let known = listed(sniff::upper(formats), "or");
        sniff::not(&format!("a {known} file"), path, &first, formats)
    })
}

/// The format of a file that begins with `first`: among those that begin so, that of its extension;
/// where none does, that of its extension all the same, for some have nothing to know them by.
fn found<'a>(path: &Path, first: &[u8], formats: &'a Formats) -> Option<&'a Arc<dyn Format>> {
    let named = formats.of(path);
    let begins = named.filter(|format| format.sniff(first));
    begins.or_else(|| formats.sniffed(first)).or(named)
}

/// What the file at `path` says of how it was made; None if it says nothing.
///
/// # Errors
///
/// As [`describe`].
pub(crate) fn note(path: &Path, formats: &Formats) -> Result<Option<String>> {
    let first = sniff::first_bytes(path)?;
    let begins = found(path, &first, formats).filter(|format| format.sniff(&first));
    begins.map_or(Ok(None), |format| format.note(path))
}

/// A description as JSON.
pub(super) fn json(described: &impl Serialize) -> Result<serde_json::Value> {
    serde_json::to_value(described)
        .map_err(|e| Error::internal("a header could not be written as JSON").because(e))
}
