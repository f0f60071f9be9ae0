//! PCD: the points of the Point Cloud Library, as text, as bytes, or packed.
//!
//! A record is a point in its file's own binary form, and behind it, where the points are a grid,
//! its row and column. A cell of which a coordinate is NaN has no point, as the library has it: it
//! is left out, and said. `rgb` and `rgba` are a number whose bytes are blue, green, red and
//! opacity.

mod counts;
mod file;
mod header;
mod info;
mod lzf;
mod names;
mod packed;
mod part;
mod registered;
pub(crate) mod sink;
mod source;

pub use registered::{PCD, PcdFormat};
