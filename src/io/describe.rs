//! What a file's header says, for `info`.

use std::io::Read;
use std::path::Path;

use super::origin::open_plain;
use super::sniff;
use crate::{Error, Result};

/// What the header of the LAS, LAZ or PLY file at `path` says, as JSON; which of them it is, its
/// first bytes tell. Fails on other files and on headers that their format does not allow.
pub fn describe(path: &Path) -> Result<serde_json::Value> {
    let mut first = Vec::new();
    let (file, _) = open_plain(path)?;
    file.take(sniff::BYTES as u64)
        .read_to_end(&mut first)
        .map_err(|e| Error::io(path, "read it", e))?;
    let described = if sniff::is_las(&first) {
        serde_json::to_value(super::las::describe(path)?)
    } else if sniff::is_ply(&first) {
        serde_json::to_value(super::ply::describe(path)?)
    } else {
        return Err(sniff::not("a LAS, LAZ or PLY file", path, &first));
    };
    described.map_err(|e| Error::internal("a header could not be written as JSON").because(e))
}
