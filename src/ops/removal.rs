//! What stages do to the fates of positions, and how they account for it.
//!
//! A tile op that removes points goes through here, so that no record is removed twice and the
//! ledger balances: each function says how many records it removed, and [`RemovalAccount::enter`]
//! takes their sum.
//!
//! ```
//! use pointmill::ops::removal;
//! use pointmill::tile::{Fate, Tile};
//!
//! let mut tile = Tile::of(vec![[0, 0, 0], [1, 0, 3]]);
//! // The second position is three lattice steps above the plane through the first.
//! assert_eq!(removal::represent(&mut tile, 1, 0, [0.0, 0.0, 1.0]), 1);
//! assert_eq!(tile.fates, [Fate::Kept, Fate::Represented { deviation: 3.0 }]);
//! // Nothing of it is left to be removed.
//! assert_eq!(removal::remove(&mut tile, 1), 0);
//! ```

use crate::point::{Mark, Position};
use crate::report::Tally;
use crate::tile::{Fate, Tile};

/// Keeps one record of position `i`, the canonical first; returns how many copies that removes.
pub fn keep_once(tile: &mut Tile, i: usize) -> u64 {
    if tile.fates[i] == Fate::Kept && tile.copies[i] > 1 {
        tile.fates[i] = Fate::KeptOnce;
        return u64::from(tile.copies[i] - 1);
    }
    0
}

/// Removes position `i`; returns how many records that removes.
pub fn remove(tile: &mut Tile, i: usize) -> u64 {
    let records = records(tile, i);
    if records > 0 {
        tile.fates[i] = Fate::Removed;
    }
    records
}

/// Lets position `kept` stand for position `i`; returns how many records that removes.
///
/// The deviation is measured in lattice steps along `normal`, the unit normal of the plane through
/// `kept`.
pub fn represent(tile: &mut Tile, i: usize, kept: usize, normal: [f64; 3]) -> u64 {
    represent_by(tile, i, tile.positions[kept], normal)
}

/// Lets a point that was moved to `place` stand for position `i`, as [`represent`] does.
pub fn represent_by(tile: &mut Tile, i: usize, place: Position, normal: [f64; 3]) -> u64 {
    let p = tile.positions[i];
    let [x, y, z]: [f64; 3] =
        std::array::from_fn(|axis| p[axis].saturating_sub(place[axis]) as f64 * normal[axis]);
    represent_at(tile, i, (x + y + z).abs() as f32)
}

/// Lets points that stay stand for position `i`, which is so many lattice steps from the surface
/// that they tell; returns how many records that removes.
pub fn represent_at(tile: &mut Tile, i: usize, deviation: f32) -> u64 {
    let records = records(tile, i);
    if records > 0 {
        tile.fates[i] = Fate::Represented { deviation };
    }
    records
}

/// Records of position `i` that are left.
fn records(tile: &Tile, i: usize) -> u64 {
    match tile.fates[i] {
        Fate::Kept => u64::from(tile.copies[i]),
        Fate::KeptOnce => 1,
        Fate::Removed | Fate::Represented { .. } => 0,
    }
}

/// How a stage accounts for records that it removes, or only marks.
#[derive(Debug, Clone, Copy)]
pub struct RemovalAccount {
    /// The stage's kind.
    pub stage: &'static str,
    /// The count of marked records in the report.
    pub marked: &'static str,
    /// How it marks instead of removing, if it does.
    pub mark: Option<Mark>,
}

impl RemovalAccount {
    /// That of `outliers`.
    pub(super) fn of_outliers(mark: Option<Mark>) -> RemovalAccount {
        RemovalAccount { stage: "outliers", marked: "outliers_marked", mark }
    }

    /// Enters `records` as removed for `reason`; marked ones are all still there, and only counted.
    pub fn enter(&self, tally: &mut Tally, reason: &'static str, records: u64) {
        match self.mark {
            Some(_) => tally.count(self.marked, records),
            None => tally.remove(self.stage, reason, records),
        }
    }
}
