//! The folder of real scans.

use std::path::PathBuf;

/// The folder of real scans that the environment names. A test that asks for it is ignored unless it
/// is run by name or with `--ignored`, and fails where there is no such folder: none passes empty.
pub fn scans() -> PathBuf {
    let folder = std::env::var_os("POINTMILL_SCANS").map(PathBuf::from);
    let folder = folder.expect("POINTMILL_SCANS names the folder of real scans");
    assert!(folder.join("MANIFEST.tsv").is_file(), "{} has no MANIFEST.tsv", folder.display());
    folder
}
