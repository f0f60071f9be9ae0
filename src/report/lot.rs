//! What became of the records of a position. Knows no sums.

use crate::point::Position;
use crate::tile::Fate;

/// What became of the records of a position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lot {
    /// Records.
    pub copies: u32,
    /// Those of them that are kept.
    pub kept: u32,
    /// How far the others are from the surface of what stands for them, in lattice steps; None
    /// where nothing does.
    pub deviation: Option<f32>,
}

impl Lot {
    /// The lot of `copies` records that share a fate: copies of a kept position are on the surface.
    pub fn of(copies: u32, fate: Fate) -> Lot {
        let (kept, deviation) = match fate {
            Fate::Kept => (copies, None),
            Fate::KeptOnce => (copies.min(1), Some(0.0)),
            Fate::Removed => (0, None),
            Fate::Represented { deviation } => (0, Some(deviation)),
        };
        Lot { copies, kept, deviation }
    }

    pub(super) fn removed(self) -> u32 {
        self.copies.saturating_sub(self.kept)
    }
}

/// Positions that a walk came by, and what became of them.
#[derive(Debug, Clone, Copy)]
pub struct Walked<'a> {
    /// As they were read.
    pub before: &'a [Position],
    /// Where stages moved those that are kept, in the box of the scan; the same where none did.
    pub after: &'a [Position],
    /// What became of the records of each.
    pub lots: &'a [Lot],
}

impl<'a> Walked<'a> {
    /// Positions that nothing moved.
    pub fn still(positions: &'a [Position], lots: &'a [Lot]) -> Self {
        Walked { before: positions, after: positions, lots }
    }
}
