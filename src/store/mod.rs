//! The decoded scan: sorted runs as the decode leaves them, their merge, and what comes of it,
//! sealed: distinct positions in Morton order with their records, in memory or on disk. Knows
//! neither tiles, nor stages, nor formats.
//!
//! A scan is sorted once, by an external merge sort, and is only read from then on. Sorted, every
//! cube is one stretch of positions, so tiles of any size, at any place, are read from front to
//! back; and the order is a function of the points alone, on which everything that is decided can
//! rest. Points in cells of a grid on disk would be found without a sort, but how fine the grid
//! must be is known only when all points are.

mod block;
mod cursor;
mod cutting;
mod emit;
mod fetch;
mod gather;
mod intake;
mod kept;
mod key;
mod levels;
mod manifest;
mod merge;
mod order;
pub(crate) mod pieces;
mod record;
mod sealed;
pub(crate) mod spill;
mod tournament;

pub use crate::geom::morton::morton_cmp;
pub use block::{BLOCK, Block, first_of_each};
pub use cutting::CutError;
pub use fetch::Fetch;
pub use intake::{Intake, TileStore};
pub use kept::{KeptPoints, KeptReader};
pub use key::{TileKey, split_level};
pub use levels::Levels;
pub use merge::{merge_bytes, seal};
pub use pieces::{PIECE, Pieces};
pub use record::{
    ASIDE, CHOSEN, CLASSED_INPUTS, FATE_BYTES, RecordState, SELECTIONS, TAGGED_INPUTS, Tag,
    ref_bytes,
};
pub use sealed::{Reader, SealedTiles};
pub use spill::{Folder, Spill, SpillArea, StoredStretch};
