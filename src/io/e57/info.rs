//! What an E57 file says of its scans, for `info`.

use std::path::Path;

use e57::RecordName;
use serde::Serialize;

use super::file::{E57File, reader};
use crate::Result;
use crate::io::describe::json;
use crate::io::origin::Origin;
use crate::stage::OnError;

/// What begins a scan's description that says how the file was made.
pub(super) const NOTE: &str = "pointmill: ";

#[derive(Debug, Serialize)]
struct E57Description {
    kind: &'static str,
    bytes: u64,
    points: u64,
    scans: Vec<E57ScanFacts>,
    images: usize,
    crs: Option<String>,
    /// The program that wrote it.
    library: Option<String>,
}

#[derive(Debug, Serialize)]
struct E57ScanFacts {
    name: Option<String>,
    points: u64,
    /// True if it has a turn or a shift.
    posed: bool,
    /// What its points have, in the format's words.
    values: Vec<String>,
}

/// What a value is called.
pub(super) fn name(name: &RecordName) -> String {
    match name {
        RecordName::Unknown { namespace, name } => format!("{namespace}:{name}"),
        known => format!("{known:?}"),
    }
}

/// The description of the file at `path`.
///
/// # Errors
///
/// As opening it.
pub(super) fn describe(path: &Path) -> Result<serde_json::Value> {
    let file = E57File::open(path, None, OnError::Fail)?;
    let opened = reader(path, &file.origin)?;
    let scans = file.scans.iter().map(|scan| E57ScanFacts {
        name: scan.cloud.name.clone(),
        points: scan.cloud.records,
        posed: scan.pose.is_some(),
        values: scan.cloud.prototype.iter().map(|record| name(&record.name)).collect(),
    });
    json(&E57Description {
        kind: "E57",
        bytes: file.origin.length(),
        points: file.points(),
        scans: scans.collect(),
        images: opened.images().len(),
        crs: file.crs.clone(),
        library: opened.library_version().map(str::to_owned),
    })
}

/// What the file at `path` says of how it was made; None if it says nothing.
pub(super) fn note(path: &Path) -> Result<Option<String>> {
    let (_, origin) = Origin::open(path)?;
    let first = reader(path, &origin)?.pointclouds().into_iter().next();
    let text = first.and_then(|cloud| cloud.description);
    Ok(text.and_then(|text| text.strip_prefix(NOTE).map(str::to_owned)))
}
