//! pointmill reduces laser scans that do not fit in memory to the points that matter.

pub mod budget;
pub mod cli;
mod error;
pub mod geom;
pub mod io;
pub mod ops;
pub mod pipeline;
pub mod point;
pub mod report;
pub mod stage;
pub mod tile;

pub use error::{Error, ErrorKind, Result};
