//! What a PCD header says, for `info`.

use std::path::Path;

use serde::Serialize;

use super::header::PcdHeader;
use crate::Result;
use crate::io::describe::json;
use crate::io::origin::Origin;
use crate::io::rows::noted;

#[derive(Debug, Serialize)]
struct PcdDescription {
    kind: &'static str,
    version: String,
    /// How the points are written.
    encoding: &'static str,
    bytes: u64,
    points: u64,
    width: u64,
    height: u64,
    viewpoint: Option<[f64; 7]>,
    fields: Vec<PcdFieldFacts>,
    comments: Vec<String>,
}

#[derive(Debug, Serialize)]
struct PcdFieldFacts {
    name: String,
    /// A letter and how many bytes a number has.
    #[serde(rename = "type")]
    kind: String,
    count: usize,
}

/// The description of the file at `path`.
///
/// # Errors
///
/// As [`PcdHeader::read`].
pub(super) fn describe(path: &Path) -> Result<serde_json::Value> {
    let (file, origin) = Origin::open(path)?;
    let mut header = PcdHeader::read(file, path, origin.length())?;
    noted::take(&mut header.comments);
    let fields = header.fields.iter().map(|field| PcdFieldFacts {
        name: field.name.clone(),
        kind: format!("{}{}", field.letter(), field.size),
        count: field.count,
    });
    json(&PcdDescription {
        kind: "PCD",
        version: header.version.clone(),
        encoding: header.data.word(),
        bytes: origin.length(),
        points: header.points,
        width: header.width,
        height: header.height,
        viewpoint: header.viewpoint,
        fields: fields.collect(),
        comments: header.comments.clone(),
    })
}

/// What the file at `path` says of how it was made; None if it says nothing.
pub(super) fn note(path: &Path) -> Result<Option<String>> {
    let (file, origin) = Origin::open(path)?;
    let mut header = PcdHeader::read(file, path, origin.length())?;
    Ok(noted::take(&mut header.comments))
}
