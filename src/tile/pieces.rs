//! Items of one size in a spill, found by number.

use std::sync::{Arc, PoisonError, RwLock};

use super::spill::{Address, Spill, SpillArea};
use crate::{Error, Result};

/// Items of one size, stored in pieces and found by number.
///
/// Writers reserve a stretch of numbers, which begins a new piece, and store its pieces in any
/// order; numbers between two stretches name nothing.
#[derive(Debug)]
pub struct Pieces {
    spill: Spill,
    stride: usize,
    table: RwLock<Vec<Option<(Address, u32)>>>,
}

/// Items in a piece.
pub const PIECE: usize = 4096;

impl Pieces {
    /// No items yet, each `stride` bytes.
    pub fn new(area: &Arc<SpillArea>, name: &'static str, stride: usize) -> Self {
        Pieces { spill: Spill::new(area, name), stride, table: RwLock::default() }
    }

    /// Reserves `items` numbers and returns the first.
    pub fn reserve(&self, items: u64) -> u64 {
        let mut table = self.table.write().unwrap_or_else(PoisonError::into_inner);
        let first = table.len() as u64;
        let pieces = items.div_ceil(PIECE as u64) as usize;
        table.resize(first as usize + pieces, None);
        first * PIECE as u64
    }

    /// Reserves all numbers below `end`, if they are not yet.
    pub fn reserve_below(&self, end: u64) {
        let mut table = self.table.write().unwrap_or_else(PoisonError::into_inner);
        let pieces = end.div_ceil(PIECE as u64) as usize;
        if table.len() < pieces {
            table.resize(pieces, None);
        }
    }

    /// How many numbers are reserved so far.
    pub fn reserved(&self) -> u64 {
        let table = self.table.read().unwrap_or_else(PoisonError::into_inner);
        table.len() as u64 * PIECE as u64
    }

    /// Stores the items from number `first` on, a multiple of [`PIECE`]: one piece, full or the
    /// last of its stretch.
    pub fn put(&self, first: u64, bytes: &[u8]) -> Result<()> {
        let address = self.spill.append(bytes)?;
        let mut table = self.table.write().unwrap_or_else(PoisonError::into_inner);
        let piece = (first / PIECE as u64) as usize;
        let slot = table
            .get_mut(piece)
            .ok_or_else(|| Error::internal("a piece was stored that nobody reserved"))?;
        *slot = Some((address, (bytes.len() / self.stride) as u32));
        Ok(())
    }

    /// Fills `into` with the items from number `first` on, all of one piece.
    pub fn read(&self, first: u64, into: &mut [u8]) -> Result<()> {
        let (address, _) = self.piece(first)?;
        self.spill.read(address.plus(first % PIECE as u64 * self.stride as u64), into)
    }

    /// Fills `into` with the items from number `first` on, of one stretch of numbers.
    pub fn fill(&self, mut first: u64, mut into: &mut [u8]) -> Result<()> {
        while !into.is_empty() {
            let in_piece = (PIECE - (first % PIECE as u64) as usize) * self.stride;
            let (now, later) = into.split_at_mut(in_piece.min(into.len()));
            self.read(first, now)?;
            first += (now.len() / self.stride) as u64;
            into = later;
        }
        Ok(())
    }

    /// How many items are stored from number `first` to the end of its piece.
    pub fn stored_in(&self, first: u64) -> Result<usize> {
        let (_, items) = self.piece(first)?;
        Ok((items as usize).saturating_sub((first % PIECE as u64) as usize))
    }

    fn piece(&self, item: u64) -> Result<(Address, u32)> {
        let table = self.table.read().unwrap_or_else(PoisonError::into_inner);
        let piece = table.get((item / PIECE as u64) as usize).copied().flatten();
        piece.ok_or_else(|| Error::internal("read of a piece that was never stored"))
    }

    /// Calls `visit` for the items numbered `first..first + count`, piece by piece: the number of
    /// the first of each stretch and its bytes.
    pub fn each(
        &self,
        first: u64,
        count: u64,
        buffer: &mut Vec<u8>,
        mut visit: impl FnMut(u64, &[u8]) -> Result<()>,
    ) -> Result<()> {
        let mut at = first;
        while at < first + count {
            let in_piece = (PIECE as u64 - at % PIECE as u64).min(first + count - at);
            buffer.resize(in_piece as usize * self.stride, 0);
            self.read(at, buffer)?;
            visit(at, buffer)?;
            at += in_piece;
        }
        Ok(())
    }
}
