//! What the format and its records are called.

use crate::point::Layout;

/// The family of E57 records.
pub(super) const FAMILY: &str = "E57";

/// Numbers of a point.
pub(super) const RECORDS: Layout = Layout::plain(FAMILY);

/// What messages call an E57 file.
pub(super) const CALLED: &str = "an E57 file";

/// The first bytes of a file.
pub(super) const MAGIC: &[u8] = b"ASTM-E57";
