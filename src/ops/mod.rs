//! The built-in stages that compute: one file each.

mod assign;
mod cells;
mod crop;
mod cut;
mod drop;
mod filter;
mod graded;
mod grid;
mod lengths;
mod median;
mod merge;
pub mod normals;
pub(crate) mod outliers;
pub mod removal;
mod sample;
mod scatter;
mod stats;
mod tap;
mod transform;

pub use assign::Assign;
pub use cells::{By, Cells, Keep, Measure, Reference, Side, Split};
pub use crop::{Crop, CropBox, CropSide};
pub use cut::Cut;
pub use drop::Drop;
pub use filter::Filter;
pub use graded::{Effort, Graded, KEEP_RANK};
pub use grid::{Grid, Pick};
pub use median::{Median, Representative};
pub use merge::Merge;
pub use outliers::{OutlierMethod, Outliers};
pub use sample::Sample;
pub use stats::Stats;
pub use tap::Tap;
pub use transform::{MatrixRows, Rotation, RotationAxis, ScaleFactors, Transformation};
