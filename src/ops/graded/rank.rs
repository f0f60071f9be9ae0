//! In which order points were kept, as outputs have it.

use crate::point::Column;

/// The number of the round that kept each point: points of rounds before it are a coarser reduction
/// of the same scan. 65535 are exceptions, which are kept and no part of the surface.
pub const KEEP_RANK: Column<u16> = Column::new("KeepRank", &[]).computed_by("graded");
/// The rank of exceptions.
pub(super) const EXCEPTION: u16 = u16::MAX;

/// The rank of what a round kept: below that of an exception.
pub(super) fn rank_of(round: u32) -> u16 {
    round.min(u32::from(EXCEPTION) - 1) as u16
}
