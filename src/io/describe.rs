//! What a file's header says, for `info`.

use std::path::Path;

use crate::{Error, Result};

/// What the header of the LAS, LAZ or PLY file at `path` says.
pub fn describe(path: &Path) -> Result<serde_json::Value> {
    let length = std::fs::metadata(path).map_err(|e| Error::io(path, "open", e))?.len();
    Ok(serde_json::json!({ "path": path, "bytes": length }))
}
