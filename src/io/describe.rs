//! What a file's header says, for `info`.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::{Error, Result};

/// What the header of the LAS, LAZ or PLY file at `path` says, as JSON; which of them it is, its
/// first bytes tell. Fails on other files and on headers that their format does not allow.
pub fn describe(path: &Path) -> Result<serde_json::Value> {
    let mut magic = Vec::new();
    File::open(path)
        .and_then(|file| file.take(4).read_to_end(&mut magic))
        .map_err(|e| Error::io(path, "read", e))?;
    let described = if magic == b"LASF" {
        serde_json::to_value(super::las::describe(path)?)
    } else if magic.starts_with(b"ply") {
        serde_json::to_value(super::ply::describe(path)?)
    } else {
        return Err(Error::data(path, "this is neither LAS, LAZ nor PLY").at_byte(0));
    };
    described.map_err(|e| Error::internal("a header could not be written as JSON").because(e))
}
