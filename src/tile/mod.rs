//! Octree tiles of scans larger than memory: one decode, a sorted spill, exact neighbourhoods.

mod key;
mod levels;

pub use key::{TileKey, morton_cmp};
pub use levels::Levels;

use std::ops::Range;

use crate::point::{Bounds, Position};

/// The points of one cube, then a rim of its neighbours' points.
///
/// Positions are distinct and in Morton order, so those of the cube itself, the core, are one range.
/// Columns have one entry a position.
#[derive(Debug)]
pub struct Tile {
    /// The cube whose points this tile decides.
    pub cube: Bounds,
    /// The cube grown by what the stages look at together: columns must be right for all positions
    /// in it. Every position of it is loaded.
    pub zone: Bounds,
    /// All positions loaded.
    pub positions: Vec<Position>,
    /// How many records share each position.
    pub copies: Vec<u32>,
    /// Those of `cube`.
    pub core: Range<usize>,
    /// Unit normals; NaN where there is none or it was not asked for.
    pub normals: Vec<[f32; 3]>,
    /// The partition into cells, once a stage made one.
    pub cells: Cells,
    /// What becomes of each position (meaningful in the core). Kept unless a stage says otherwise.
    pub fates: Vec<Fate>,
}

impl Tile {
    /// True if columns must be right for position `i`.
    pub fn in_zone(&self, i: usize) -> bool {
        self.zone.contains(self.positions[i])
    }
}

/// What becomes of the records of a position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fate {
    /// All are kept.
    Kept,
    /// The canonical first is kept, the other copies are removed as coincident.
    KeptOnce,
    /// All are removed; a kept point stands for them.
    Represented {
        /// Distance to the plane through the point that stands for them, along its normal, in
        /// lattice steps.
        deviation: f32,
    },
}

/// Groups of positions that are decided together.
///
/// Group `g` is `members[ends[g - 1]..ends[g]]`, in Morton order; positions without a normal are in
/// none.
#[derive(Debug, Default)]
pub struct Cells {
    /// Indices into the tile's positions, group after group.
    pub members: Vec<u32>,
    /// For each member, its normal's sign in the group: true if the normal is to be turned.
    pub turned: Vec<bool>,
    /// End of each group in `members`.
    pub ends: Vec<u32>,
    /// Reference direction N of the partition; θ is the angle to it.
    pub reference: [f64; 3],
}

impl Cells {
    /// Forgets all groups, keeps the memory.
    pub fn clear(&mut self) {
        self.members.clear();
        self.turned.clear();
        self.ends.clear();
    }

    /// The ranges of `members`, one a group.
    pub fn groups(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        (0..self.ends.len()).map(|g| {
            let start = if g == 0 { 0 } else { self.ends[g - 1] as usize };
            start..self.ends[g] as usize
        })
    }
}
