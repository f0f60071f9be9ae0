//! The built-in stages that compute: one file each.

mod assign;
mod cells;
mod drop;
mod filter;
mod grid;
mod lengths;
mod median;
mod merge;
pub mod normals;
pub(crate) mod outliers;
pub mod removal;
mod scatter;
mod stats;
mod tap;

pub use assign::Assign;
pub use cells::{By, Cells, Keep, Measure, Reference, Side, Split};
pub use drop::Drop;
pub use filter::Filter;
pub use grid::{Grid, Pick};
pub use median::Median;
pub use merge::Merge;
pub use outliers::{OutlierMethod, Outliers};
pub use stats::Stats;
pub use tap::Tap;
