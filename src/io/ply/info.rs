//! What a PLY file is, from its header alone.

use std::path::Path;

use serde::Serialize;

use super::header::{PlyHeader, PropertyKind};
use crate::Result;
use crate::io::origin::Origin;
use crate::io::rows::{Encoding, comments, noted};

/// What the header of a PLY file says.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlyInfo {
    /// "PLY".
    pub kind: &'static str,
    /// How the values are written.
    pub encoding: Encoding,
    /// Length of the file.
    pub bytes: u64,
    /// Vertices that the header claims; 0 without an element `vertex`.
    pub points: u64,
    /// All elements, in file order.
    pub elements: Vec<ElementInfo>,
    /// Texts of the `comment` lines.
    pub comments: Vec<String>,
    /// Texts of the `obj_info` lines.
    pub obj_info: Vec<String>,
}

/// One element of a PLY file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ElementInfo {
    /// Its name.
    pub name: String,
    /// How many the header claims.
    pub count: u64,
    /// Its properties, in file order.
    pub properties: Vec<PropertyInfo>,
}

/// One property of an element.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PropertyInfo {
    /// Its name.
    pub name: String,
    /// Its type in the format's classic words (`float`, `list uchar int`).
    #[serde(rename = "type")]
    pub kind: String,
}

/// Reads the header of the PLY file at `path`; counts are told as claimed.
///
/// # Errors
///
/// A file that cannot be read or has no PLY header.
pub fn describe(path: &Path) -> Result<PlyInfo> {
    let (file, origin) = Origin::open(path)?;
    let bytes = origin.length();
    let mut header = PlyHeader::read(&file, path, bytes)?;
    // It is told besides.
    noted::take(&mut header.comments);
    let points = header.vertex().map_or(0, |vertex| header.elements[vertex].count);
    let word = |kind: PropertyKind| kind.word();
    let elements = header
        .elements
        .into_iter()
        .map(|element| ElementInfo {
            name: element.name,
            count: element.count,
            properties: element
                .properties
                .into_iter()
                .map(|p| PropertyInfo { kind: word(p.kind), name: p.name })
                .collect(),
        })
        .collect();
    let told = |comment: String| match comments::is_made(&comment, points) {
        true => comment.contains(comments::MADE).then(|| comments::MADE.to_owned()),
        false => Some(comment),
    };
    let comments = header.comments.into_iter().filter_map(told).collect();
    let obj_info = header.obj_info;
    Ok(PlyInfo {
        kind: "PLY",
        encoding: header.encoding,
        bytes,
        points,
        elements,
        comments,
        obj_info,
    })
}

/// What the file at `path` says of how it was made; None if it says nothing.
pub(super) fn note(path: &Path) -> Result<Option<String>> {
    let (file, origin) = Origin::open(path)?;
    let mut header = PlyHeader::read(&file, path, origin.length())?;
    Ok(noted::take(&mut header.comments))
}
