//! PCD: the points of the Point Cloud Library, as text, as bytes, or packed.
//!
//! A record is a point in its file's own binary form, and behind it, where the points are a grid,
//! its row and column. A cell of which a coordinate is NaN has no point, as the library has it: it
//! is left out, and said. `rgb` and `rgba` are a number whose bytes are blue, green, red and
//! opacity.

mod file;
mod header;
mod info;
mod lzf;
mod packed;
mod part;
mod registered;
mod sink;
mod source;

pub use registered::{PCD, PcdFormat};

use crate::io::rows::RowForm;
use crate::point::Layout;

/// The family of PCD records.
const FAMILY: &str = "PCD";

/// Points, and rows and columns behind them.
const RECORDS: Layout = Layout::plain(FAMILY);

/// What a point takes.
const FORM: RowForm =
    RowForm { layout: RECORDS, holds_long: true, packs_colors: true, keeps_steps: false };

/// What messages call a PCD file.
const CALLED: &str = "a PCD file";
