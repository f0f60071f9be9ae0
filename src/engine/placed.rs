//! The records of a batch on their way from the decode to the store, with their positions.
//!
//! A whole batch is placed before any of its records is handed on. So records go to the intake in
//! stretches that end only where one is left out, and not one by one. Batches are refilled, and a
//! thread holds one, whatever the size of the scan.

use std::collections::BTreeMap;

use crate::point::Position;
use crate::store::Tag;

/// What of a batch goes to the intake; keeps its memory.
#[derive(Default)]
pub(crate) struct Placed {
    pub positions: Vec<Position>,
    pub tags: Vec<Tag>,
    /// Place in the input of the batch's first record.
    pub first: u64,
    /// Indices of records that do not go there.
    pub left_out: Vec<usize>,
    /// How many of them the scan itself says are of no use, by reason.
    pub useless: BTreeMap<&'static str, u64>,
}

impl Placed {
    /// Bytes that it holds for each record of a batch.
    pub const BYTES_PER_RECORD: usize =
        size_of::<Position>() + size_of::<Tag>() + size_of::<usize>();
}
