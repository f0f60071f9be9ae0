//! What the beginning of a text says, for `info`.

use std::path::Path;

use serde::Serialize;

use super::columns::dimensions;
use super::head::TextHead;
use super::ptx;
use super::source::TextKind;
use crate::Result;
use crate::io::describe::json;
use crate::io::origin::Origin;
use crate::io::rows::fields::Delimiter;

/// What a text says before its points are read.
#[derive(Debug, Serialize)]
struct TextDescription {
    kind: &'static str,
    bytes: u64,
    /// None where only the end of the file would tell it.
    points: Option<u64>,
    /// What stands between two numbers.
    separator: &'static str,
    /// Numbers on a line.
    columns: usize,
    /// What they are, if the text says it.
    dimensions: Option<Vec<String>>,
    /// Byte where the points begin.
    body: u64,
}

/// The description of the text at `path`.
///
/// # Errors
///
/// A file that is none.
pub(super) fn describe(path: &Path, kind: TextKind, name: &str) -> Result<serde_json::Value> {
    let (file, origin) = Origin::open(path)?;
    let bytes = origin.length();
    if kind == TextKind::Ptx {
        let (columns, body) = ptx::first_cell(file, path, bytes)?;
        return json(&TextDescription {
            kind: upper(name),
            bytes,
            points: None,
            separator: Delimiter::Blanks.word(),
            columns,
            dimensions: None,
            body,
        });
    }
    let head = TextHead::read(file, path, bytes, None)?;
    let named = head.names.as_ref().and_then(|names| dimensions(names).ok());
    json(&TextDescription {
        kind: upper(name),
        bytes,
        points: head.claimed.or((head.body == bytes).then_some(0)),
        separator: head.separator.word(),
        columns: head.columns,
        dimensions: named.map(|names| names.into_iter().flatten().collect()),
        body: head.body,
    })
}

/// What a format is called by itself.
fn upper(name: &str) -> &'static str {
    match name {
        "csv" => "CSV",
        "pts" => "PTS",
        "ptx" => "PTX",
        "xyz" => "XYZ",
        _ => "text",
    }
}
