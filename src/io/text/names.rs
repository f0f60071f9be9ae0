//! What the formats and their records are called.

use crate::point::Layout;

/// The family of texts.
pub(super) const FAMILY: &str = "text";

/// Numbers of a line in the order of the columns, little-endian.
pub(super) const RECORDS: Layout = Layout::plain(FAMILY);

/// What messages call such a file.
pub(super) const CALLED: &str = "a text of numbers";

/// The longest line that is read.
pub(super) const LONGEST_LINE: usize = 1 << 14;
