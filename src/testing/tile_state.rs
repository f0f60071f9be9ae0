//! What a tile is before a stage works on it, to see what the stage did.

use std::ops::Range;

use super::promise::Promise;
use super::witness::Witness;
use crate::point::{Bounds, ColumnKind, Position};
use crate::stage::Needs;
use crate::tile::{Fate, Tile};

/// Copies of what a stage must leave as it is, and of the fates that it may change.
pub(super) struct TileState {
    cube: Bounds,
    zone: Bounds,
    core: Range<usize>,
    positions: Vec<Position>,
    copies: Vec<u32>,
    classes: Vec<u8>,
    /// Columns that it may read and not write.
    columns: Vec<(ColumnKind, Vec<u8>)>,
    fates: Vec<Fate>,
}

impl TileState {
    /// That of `tile`, on which a stage is to work that needs this.
    pub fn of(tile: &Tile, needs: &Needs) -> TileState {
        let kept = tile.columns.kinds().into_iter().filter(|kind| !needs.writes.contains(kind));
        let copy = |kind| (kind, tile.columns.bytes_of(kind).unwrap_or_default().to_vec());
        TileState {
            cube: tile.cube,
            zone: tile.zone,
            core: tile.core.clone(),
            positions: tile.positions.clone(),
            copies: tile.copies.clone(),
            classes: tile.classes.clone(),
            columns: kept.map(copy).collect(),
            fates: tile.fates.clone(),
        }
    }

    /// Tells of what the stage changed without having declared it.
    pub fn compare(&self, tile: &Tile, needs: &Needs, witness: &Witness) {
        let changed = |name: &ColumnKind, was: &Vec<u8>| tile.columns.bytes_of(*name) != Some(was);
        let column = self.columns.iter().find(|(kind, was)| changed(kind, was));
        let what = match column {
            Some((kind, _)) => Some(kind.name()),
            None if tile.positions != self.positions => Some("positions"),
            None if tile.copies != self.copies => Some("copies"),
            None if tile.classes != self.classes => Some("classes"),
            None if (tile.cube, tile.zone) != (self.cube, self.zone) => Some("cube or zone"),
            None if tile.core != self.core => Some("core"),
            None => None,
        };
        if let Some(what) = what {
            let told = format!("it changed the {what} of a tile, and its needs do not say so");
            witness.tell(Promise::Changes, told);
        }
        if self.fates != tile.fates && !needs.removes && needs.mark.is_none() {
            witness.tell(Promise::Ledger, "it removed records, and its needs say no removal");
        }
    }

    /// Tells of records that the stage removed and did not enter in the ledger, where it entered
    /// `entered`, or the other way round.
    pub fn balance(&self, tile: &Tile, needs: &Needs, entered: u64, witness: &Witness) {
        let left = |fates: &[Fate]| -> u64 {
            let core = fates.get(self.core.clone()).unwrap_or_default();
            core.iter().zip(&self.copies[self.core.clone()]).map(|(f, n)| records(*f, *n)).sum()
        };
        let removed = match needs.mark {
            // What is marked stays.
            Some(_) => 0,
            None => left(&self.fates).saturating_sub(left(&tile.fates)),
        };
        if removed != entered {
            let told = format!("of a tile it removed {removed} records, and it entered {entered}");
            witness.tell(Promise::Ledger, told);
        }
    }
}

/// How many of `copies` records are left.
fn records(fate: Fate, copies: u32) -> u64 {
    match fate {
        Fate::Kept => u64::from(copies),
        Fate::KeptOnce => u64::from(copies.min(1)),
        Fate::Removed | Fate::Represented { .. } => 0,
    }
}
