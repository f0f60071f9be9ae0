//! Formats: one folder each, plain sources and sinks of records; conversion between records; and
//! the stages that name files. Knows nothing of tiles.

pub(crate) mod convert;
mod damage;
mod deep;
mod describe;
pub mod e57;
pub(crate) mod ends;
mod epsg;
mod facets;
pub mod las;
mod meaning;
mod origin;
pub mod pcd;
pub mod ply;
mod project;
#[cfg(feature = "proj")]
mod reproject;
pub(crate) mod rows;
pub(crate) mod sniff;
mod steps;
mod systems;
pub mod text;
mod united;
mod validate;
pub mod vertices;
mod wkt;

pub use convert::{Projection, Rounding};
pub use deep::{
    ClassCount, DeepDimension, DeepFigures, DensityFigures, QuantileFigures, ReturnCount, deep,
};
pub use describe::describe;
pub(crate) use describe::note;
pub use ends::{Discard, Mesh, OutputOrder, Read, Write};
pub(crate) use origin::{Origin, open_plain};
pub use project::Projected;
pub use validate::validate;
