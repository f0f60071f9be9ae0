//! What the format and its records are called.

use crate::io::rows::RowForm;
use crate::point::Layout;

/// The family of PCD records.
pub(super) const FAMILY: &str = "PCD";

/// Points, and rows and columns behind them.
pub(super) const RECORDS: Layout = Layout::plain(FAMILY);

/// What a point takes.
pub(super) const FORM: RowForm = RowForm {
    layout: RECORDS,
    holds_long: true,
    packs_colors: true,
    keeps_steps: false,
    holds_nan: false,
};

/// What messages call a PCD file.
pub(super) const CALLED: &str = "a PCD file";
