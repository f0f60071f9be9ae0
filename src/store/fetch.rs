//! Looking up where records are stored, and what is held to fetch them.
//!
//! Records lie in the order in which runs were sorted and are asked for in canonical order, so
//! those of one chunk are spread over many runs. They are sorted by where they are stored, read in
//! stretches that are in one piece, and put to their slots: a read for each record would be a
//! system call for each.

use super::pieces::{PIECE, Pieces};
use super::record::ref_bytes;
use crate::Result;
use crate::budget::Bytes;

/// Stretches of sorted `sources` that are in one piece, each with its first and last number.
pub(crate) fn groups(sources: &[(u64, u32)]) -> impl Iterator<Item = (&[(u64, u32)], (u64, u64))> {
    let same_piece = |a: &(u64, u32), b: &(u64, u32)| a.0 / PIECE as u64 == b.0 / PIECE as u64;
    sources.chunk_by(same_piece).filter_map(|group| {
        let (first, last) = group.first().zip(group.last())?;
        Some((group, (first.0, last.0)))
    })
}

/// What fetching records needs and keeps from call to call.
#[derive(Debug, Default)]
pub struct Fetch {
    /// Where records are stored, each with its slot.
    pub(crate) sources: Vec<(u64, u32)>,
    pub(crate) records: Vec<u8>,
    refs: Vec<u8>,
    refs_piece: Option<u64>,
}

impl Fetch {
    /// Bytes that fetching `count` records of `stride` bytes holds.
    pub fn bytes(count: u64, stride: usize) -> Bytes {
        let each = size_of::<(u64, u32)>() + size_of::<&mut [u8]>();
        let piece = Bytes::from(stride) + Bytes::from(ref_bytes(false));
        Bytes::of(count, each) + piece * PIECE as u64
    }

    /// Where the record numbered `number` in canonical order is stored.
    pub(crate) fn ref_of(&mut self, refs: &Pieces, tagged: bool, number: u64) -> Result<u64> {
        const WINDOW: u64 = 256;
        let each = ref_bytes(tagged);
        let window = number / WINDOW;
        if self.refs_piece != Some(window) {
            let first = window * WINDOW;
            let stored = refs.stored_in(first)?.min(WINDOW as usize) as u64;
            refs.collect(first, stored, &mut self.records, &mut self.refs)?;
            self.refs_piece = Some(window);
        }
        let at = (number % WINDOW) as usize * each;
        let mut bytes = [0; 8];
        bytes.copy_from_slice(&self.refs[at..at + 8]);
        Ok(u64::from_le_bytes(bytes))
    }
}
