//! The built-in stages that compute: one file each.

mod cells;
mod median;
pub mod normals;

pub use cells::{Cells, Keep, Measure, Reference, Side, Split};
pub use median::Median;
