//! Looking up where records are stored, and what is held to fetch them.

use super::pieces::{PIECE, Pieces};
use crate::Result;

/// Bytes of a record's entry in the canonical order: its number in the store and, if records have
/// them, its tag.
pub(super) fn ref_bytes(tagged: bool) -> usize {
    if tagged { 12 } else { 8 }
}

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
    pub fn bytes(count: u64, stride: usize) -> u64 {
        let each = size_of::<(u64, u32)>() + size_of::<&mut [u8]>();
        let piece = (PIECE as u64).saturating_mul((stride as u64).saturating_add(8));
        count.saturating_mul(each as u64).saturating_add(piece)
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
