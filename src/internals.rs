//! What the project's own tests and benchmarks use of the rooms that are not public. No promise
//! holds for it: anything here may change or go with any version.
//!
//! Most tests stand beside the code that they are about, or go through the surface that programs
//! have. Here is what is left: chains of rooms (intake, merge, loader) that are looked at without a
//! run around them, writers of files with headers that no run would write, and kernels that tests
//! of several rooms compare with an oracle.

use crate::tile::Tile;

pub use crate::budget::Budget;
pub use crate::geom::angle::{
    MaxAngle, cosine, direction, dominant_axis, is_turned, outer_sum, sine2,
};
pub use crate::geom::nearest::{Nearest, NearestAmong};
pub use crate::geom::plane;
pub use crate::geom::simd::Simd;
pub use crate::geom::star::Star;
pub use crate::graph::LimitKeys;
pub use crate::host::Threads;
pub use crate::host::process::cpu_seconds;
pub use crate::ops::normals::estimate::{Estimate, Fallback};
pub use crate::ops::normals::estimator::Estimator;
pub use crate::ops::outliers::{RadiusOutliers, StatisticalOutliers};
pub use crate::report::digits::Grouped;
pub use crate::report::lot::Lot;
pub use crate::report::moments::{Moments, Plane};
pub use crate::report::survey::{ScanSurvey, report_tile_level};
pub use crate::store::{
    CutError, Fetch, Folder, Intake, Reader, SealedTiles, SpillArea, Tag, TileKey, TileStore,
    morton_cmp, seal,
};
pub use crate::tile::load::Loader;
pub use crate::tile::sieve::Sieve;

/// LAS and LAZ without a run around them.
pub mod las {
    pub use crate::io::las::describe::{Description, Record, describe};
    pub use crate::io::las::format::{layout, records};
    pub use crate::io::las::holding::las_schema;
    pub use crate::io::las::sink::{LasOptions, create};
}

/// PLY without a run around it.
pub mod ply {
    pub use crate::io::ply::info::describe;
    pub use crate::io::ply::sink::PlyOptions;
    pub use crate::io::ply::sink::create;
    pub use crate::io::ply::sink::ply_schema;
    pub use crate::io::rows::Encoding;
}

/// What the dimensions that formats share are called.
#[derive(Debug, Clone)]
pub struct SharedName {
    /// The dimension.
    pub dimension: &'static str,
    /// In PLY, PCD and E57.
    pub written: [String; 3],
    /// Other spellings that headings and properties may have.
    pub spellings: Vec<&'static str>,
    /// What it is, with range and unit.
    pub about: &'static str,
}

/// The dimensions that formats share, in the order in which they are written.
pub fn shared_names() -> Vec<SharedName> {
    let table = crate::io::rows::names::TABLE;
    let dimensions: Vec<&str> = table.iter().map(|row| row.0).collect();
    let in_e57 = crate::io::e57::sink::value_names(&dimensions);
    let named = |(row, e57): (&(&'static str, &str, &[&'static str], &'static str), String)| {
        let pcd = crate::io::pcd::sink::field_name(row.0);
        let written = [row.1.to_owned(), pcd, e57];
        SharedName { dimension: row.0, written, spellings: row.2.to_vec(), about: row.3 }
    };
    table.iter().zip(in_e57).map(named).collect()
}

/// How many neighbourhoods of a tile had to be searched for beyond it since this was asked last.
pub fn take_unproven(tile: &mut Tile) -> u64 {
    tile.around.take_unproven()
}

/// Searches a tile's neighbours by this instruction set from now on.
pub fn compute_by(tile: &mut Tile, simd: Simd) {
    tile.compute_by(simd);
}
