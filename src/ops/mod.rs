//! The built-in stages that compute: one file each.

mod cells;
mod filter;
mod grid;
mod lengths;
mod median;
mod merge;
pub mod normals;
pub(crate) mod outliers;
pub mod removal;
mod scatter;

pub use cells::{By, Cells, Keep, Measure, Reference, Side, Split};
pub use filter::Filter;
pub use grid::{Grid, Pick};
pub use median::Median;
pub use merge::Merge;
pub use outliers::{OutlierMethod, Outliers};
