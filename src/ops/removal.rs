//! What stages do to the fates of positions, and how they account for it.

use crate::point::Mark;
use crate::report::Tally;
use crate::tile::{Fate, Tile};

/// Keeps one record of position `i`; returns how many copies that removes.
pub(super) fn keep_once(tile: &mut Tile, i: usize) -> u64 {
    if tile.fates[i] == Fate::Kept && tile.copies[i] > 1 {
        tile.fates[i] = Fate::KeptOnce;
        return u64::from(tile.copies[i] - 1);
    }
    0
}

/// Removes position `i`; returns how many records that removes.
pub(super) fn remove(tile: &mut Tile, i: usize) -> u64 {
    let records = records(tile, i);
    if records > 0 {
        tile.fates[i] = Fate::Removed;
    }
    records
}

/// Lets `kept`, through which the plane of a unit normal goes, stand for position `i`; returns how
/// many records that removes.
pub(super) fn represent(tile: &mut Tile, i: usize, kept: usize, normal: [f64; 3]) -> u64 {
    let records = records(tile, i);
    if records > 0 {
        let (p, q) = (tile.positions[i], tile.positions[kept]);
        let [x, y, z]: [f64; 3] =
            std::array::from_fn(|axis| p[axis].saturating_sub(q[axis]) as f64 * normal[axis]);
        tile.fates[i] = Fate::Represented { deviation: (x + y + z).abs() as f32 };
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
pub(super) struct RemovalAccount {
    /// The stage's kind.
    pub(super) stage: &'static str,
    /// The count of marked records in the report.
    pub(super) marked: &'static str,
    /// How it marks instead of removing, if it does.
    pub(super) mark: Option<Mark>,
}

impl RemovalAccount {
    /// That of `outliers`.
    pub(super) fn of_outliers(mark: Option<Mark>) -> RemovalAccount {
        RemovalAccount { stage: "outliers", marked: "outliers_marked", mark }
    }

    /// Enters `records` as removed for `reason`; marked ones are all still there, and only counted.
    pub(super) fn enter(&self, tally: &mut Tally, reason: &'static str, records: u64) {
        match self.mark {
            Some(_) => tally.count(self.marked, records),
            None => tally.remove(self.stage, reason, records),
        }
    }
}
