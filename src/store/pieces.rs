//! Items of one size in a spill, found by number.
//!
//! An address for each item would take more memory than many of the items. With 4,096 of them to a
//! piece the table is small, and an item is found by a division. Pieces may be stored in any order,
//! so all threads write at once.

use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use super::spill::{Address, Checksum, Spill, SpillArea};
use crate::budget::{Bytes, Lease};
use crate::{Error, Result};

/// Items of one size, stored in pieces and found by number.
///
/// Writers reserve a stretch of numbers, which begins a new piece, and store its pieces in any
/// order; numbers between two stretches name nothing.
#[derive(Debug)]
pub struct Pieces {
    spill: Spill,
    stride: usize,
    table: RwLock<PieceTable>,
}

/// Items in a piece.
pub const PIECE: usize = 4096;
/// Bytes that are verified together, at least, where a piece is in a file: so much is read
/// for one item, and a checksum of four bytes is held for it.
const UNIT_BYTES: usize = 4096;

/// Where the pieces are.
#[derive(Debug)]
struct PieceTable {
    places: Vec<PiecePlace>,
    /// Those of the units of each piece; none as long as all pieces are in memory.
    checksums: Vec<Checksum>,
    lease: Lease,
}

/// Where a piece is, and how many items it has: none until it is stored.
#[derive(Debug, Clone, Copy, Default)]
struct PiecePlace {
    address: Address,
    items: u32,
}

impl PieceTable {
    /// Leases memory for `pieces` more places.
    fn reserve(&mut self, pieces: u64) -> Result<()> {
        self.lease.grow(Bytes::of(pieces, size_of::<PiecePlace>()).0)
    }
}

/// Items of `stride` bytes that are verified together.
fn unit_of(stride: usize) -> usize {
    UNIT_BYTES.div_ceil(stride.max(1)).next_power_of_two().min(PIECE)
}

impl Pieces {
    /// No items yet, each `stride` bytes.
    pub fn new(area: &Arc<SpillArea>, name: &'static str, stride: usize) -> Self {
        let lease = area.budget().open("table of stored pieces");
        let table = PieceTable { places: Vec::new(), checksums: Vec::new(), lease };
        Pieces { spill: Spill::new(area, name), stride, table: RwLock::new(table) }
    }

    /// Bytes of memory that the table of `items` items of `stride` bytes takes, for a plan.
    pub fn table_bytes(items: u64, stride: usize) -> Bytes {
        let checksums = PIECE / unit_of(stride) * size_of::<Checksum>();
        Bytes::of(items.div_ceil(PIECE as u64), size_of::<PiecePlace>() + checksums)
    }

    /// Reserves `items` numbers and returns the first; fails if there is no memory for their table.
    pub fn reserve(&self, items: u64) -> Result<u64> {
        let mut table = self.change();
        let first = table.places.len();
        let pieces = items.div_ceil(PIECE as u64);
        table.reserve(pieces)?;
        table.places.resize(first + pieces as usize, PiecePlace::default());
        Ok((first * PIECE) as u64)
    }

    /// Reserves all numbers below `end`, if they are not yet.
    pub fn reserve_below(&self, end: u64) -> Result<()> {
        let mut table = self.change();
        let pieces = end.div_ceil(PIECE as u64) as usize;
        if let Some(more) = pieces.checked_sub(table.places.len()).filter(|&more| more > 0) {
            table.reserve(more as u64)?;
            table.places.resize(pieces, PiecePlace::default());
        }
        Ok(())
    }

    /// Stores the items from number `first` on, a multiple of [`PIECE`]: one piece, full or the
    /// last of its stretch.
    pub fn put(&self, first: u64, bytes: &[u8]) -> Result<()> {
        let address = self.spill.append(bytes)?;
        let unit = unit_of(self.stride);
        let parts = bytes.chunks((unit * self.stride).max(1));
        let starts = (0..).step_by((unit * self.stride).max(1));
        let sums = parts.zip(starts).map(|(part, at)| address.plus(at).checksum(part));
        let sums: Vec<Checksum> = if address.is_in_file() { sums.collect() } else { Vec::new() };
        let mut table = self.change();
        let piece = (first / PIECE as u64) as usize;
        if !sums.is_empty() {
            let (there, units) = (table.checksums.len(), PIECE / unit);
            let all = table.places.len() * units;
            if let Some(more) = all.checked_sub(there) {
                table.lease.grow(Bytes::of(more as u64, size_of::<Checksum>()).0)?;
                table.checksums.resize(all, Checksum::default());
            }
            let slots = table.checksums.iter_mut().skip(piece * units);
            slots.zip(sums).for_each(|(slot, sum)| *slot = sum);
        }
        let place = table
            .places
            .get_mut(piece)
            .ok_or_else(|| Error::internal("a piece was stored that nobody reserved"))?;
        *place = PiecePlace { address, items: (bytes.len() / self.stride.max(1)) as u32 };
        Ok(())
    }

    /// The `count` items from number `first` on, all of one piece; `buffer` is memory for them and
    /// for those around them that are verified with them.
    pub fn get<'b>(&self, first: u64, count: usize, buffer: &'b mut Vec<u8>) -> Result<&'b [u8]> {
        let (stride, unit) = (self.stride, unit_of(self.stride));
        let (piece, start) = ((first / PIECE as u64) as usize, (first % PIECE as u64) as usize);
        let table = self.table();
        let stored = table.places.get(piece).copied().unwrap_or_default();
        let (items, end) = (stored.items as usize, start + count);
        if end > items {
            return Err(Error::internal("read of a piece that was never stored"));
        }
        let (from, to) = match stored.address.is_in_file() {
            true => (start / unit * unit, end.next_multiple_of(unit).min(items)),
            false => (start, end),
        };
        buffer.resize((to - from) * stride, 0);
        let mut at = stored.address.plus((from * stride) as u64);
        self.spill.read_unverified(at, buffer)?;
        if stored.address.is_in_file() {
            let sums = table.checksums.iter().skip(piece * (PIECE / unit) + from / unit);
            for (part, sum) in buffer.chunks((unit * stride).max(1)).zip(sums) {
                self.spill.verify(at, *sum, part)?;
                at = at.plus(part.len() as u64);
            }
        }
        Ok(&buffer[(start - from) * stride..(end - from) * stride])
    }

    /// Replaces what is in `into` by the `count` items from number `first` on, of one stretch of
    /// numbers; `buffer` is memory to work in.
    pub fn collect(
        &self,
        first: u64,
        count: u64,
        buffer: &mut Vec<u8>,
        into: &mut Vec<u8>,
    ) -> Result<()> {
        into.clear();
        self.each(first, count, buffer, |_, bytes| {
            into.extend_from_slice(bytes);
            Ok(())
        })
    }

    /// How many items are stored from number `first` to the end of its piece.
    pub fn stored_in(&self, first: u64) -> Result<usize> {
        let place = self.table().places.get((first / PIECE as u64) as usize).copied();
        let items = place.map_or(0, |place| place.items as usize);
        match items {
            0 => Err(Error::internal("read of a piece that was never stored")),
            _ => Ok(items.saturating_sub((first % PIECE as u64) as usize)),
        }
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
            visit(at, self.get(at, in_piece as usize, buffer)?)?;
            at += in_piece;
        }
        Ok(())
    }

    /// All that is stored, in parts that are verified together, or in whole pieces where they are
    /// in memory: the number of the first item, how many there are, where they are, and their
    /// checksum.
    pub(super) fn units(&self) -> Vec<(u64, u64, Address, Checksum)> {
        let (table, unit) = (self.table(), unit_of(self.stride));
        let mut all = Vec::new();
        for (piece, place) in table.places.iter().enumerate() {
            let (first, items) = ((piece * PIECE) as u64, place.items as usize);
            if !place.address.is_in_file() {
                let whole = (first, items as u64, place.address, Checksum::default());
                all.extend((items > 0).then_some(whole));
                continue;
            }
            let sums = table.checksums.iter().skip(piece * (PIECE / unit));
            for (start, sum) in (0..items).step_by(unit).zip(sums) {
                let address = place.address.plus((start * self.stride) as u64);
                let count = unit.min(items - start) as u64;
                all.push((first + start as u64, count, address, *sum));
            }
        }
        all
    }

    /// Where they are.
    pub(super) fn spill(&self) -> &Spill {
        &self.spill
    }

    /// Bytes of an item.
    pub(super) fn stride(&self) -> usize {
        self.stride
    }

    fn table(&self) -> RwLockReadGuard<'_, PieceTable> {
        self.table.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self) -> RwLockWriteGuard<'_, PieceTable> {
        self.table.write().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::*;
    use crate::ErrorKind;
    use crate::budget::Budget;
    use crate::store::spill::tests::In;

    fn area(at: &Path, memory: u64) -> Arc<SpillArea> {
        SpillArea::new(Budget::new(1 << 30), memory, Box::new(In(at.to_owned())))
    }

    /// Two full pieces and a part of one, item `i` from byte `i` on of a sequence without a
    /// pattern.
    fn stored(area: &Arc<SpillArea>, stride: usize) -> (Pieces, Vec<u8>) {
        let pieces = Pieces::new(area, "items", stride);
        let items = 2 * PIECE + 1001;
        let byte = |i: usize| ((i as u32).wrapping_mul(2_654_435_761) >> 24) as u8;
        let bytes: Vec<u8> = (0..items * stride).map(byte).collect();
        assert_eq!(pieces.reserve(items as u64).unwrap(), 0);
        let numbers = (0..).step_by(PIECE);
        for (number, piece) in numbers.zip(bytes.chunks(PIECE * stride)) {
            pieces.put(number, piece).unwrap();
        }
        (pieces, bytes)
    }

    #[test]
    fn parts_of_pieces_are_read_alike_from_memory_and_files() {
        let at = tempfile::tempdir().unwrap();
        for stride in [1, 4, 12, 34, 67, 5000] {
            for memory in [0, 1 << 30] {
                let area = area(at.path(), memory);
                let (pieces, bytes) = stored(&area, stride);
                assert_eq!(area.written() > 0, memory == 0);
                let (mut buffer, mut all) = (Vec::new(), Vec::new());
                for (first, count) in [(0, 1), (4095, 1), (17, 300), (4096, 4096), (9000, 193)] {
                    let got = pieces.get(first as u64, count, &mut buffer).unwrap();
                    assert!(got == &bytes[first * stride..(first + count) * stride], "{first}");
                }
                pieces.collect(3000, 6000, &mut buffer, &mut all).unwrap();
                assert!(all == bytes[3000 * stride..9000 * stride]);
                assert_eq!(
                    pieces.get(9000, 194, &mut buffer).unwrap_err().kind(),
                    ErrorKind::Internal
                );
            }
        }
    }

    #[test]
    fn a_flipped_bit_is_told_by_whoever_reads_its_item_and_by_no_one_far_from_it() {
        let at = tempfile::tempdir().unwrap();
        for stride in [1, 8, 34, 5000] {
            let (pieces, bytes) = stored(&area(at.path(), 0), stride);
            let file = at.path().join("items-0");
            let whole = fs::read(&file).unwrap();
            assert!(whole == bytes, "one thread writes to one file");
            let mut buffer = Vec::new();
            for item in [0, 1, 999, 4095, 4096, 6000, 9191, 9192] {
                let mut damaged = whole.clone();
                damaged[item * stride + stride / 2] ^= 4;
                fs::write(&file, &damaged).unwrap();
                let error = pieces.get(item as u64, 1, &mut buffer).unwrap_err();
                assert_eq!(error.kind(), ErrorKind::Io, "{stride} {item}");
                assert_eq!(error.path(), Some(file.as_path()));
                let byte = error.byte().unwrap() as usize;
                let span = byte..byte + unit_of(stride) * stride;
                assert!(span.contains(&(item * stride)), "{stride} {item}: {byte}");
                assert!(error.remedy().unwrap().contains("disk"));
                let far = (item + PIECE) % 9193 / unit_of(stride) * unit_of(stride);
                let there = pieces.get(far as u64, 1, &mut buffer).unwrap();
                assert!(there == &bytes[far * stride..(far + 1) * stride], "{stride} {item}");
            }
            // What belongs elsewhere is noticed, and so is what never arrived.
            let moved = [&whole[..4096 * stride], &whole[..4096 * stride]].concat();
            for wrong in [moved, vec![0; whole.len()]] {
                fs::write(&file, wrong).unwrap();
                assert!(pieces.get(5000, 1, &mut buffer).is_err());
            }
        }
    }

    #[test]
    fn the_table_is_leased_and_as_large_as_planned() {
        let at = tempfile::tempdir().unwrap();
        let area = area(at.path(), 0);
        for stride in [1, 8, 34, 5000] {
            let before = area.budget().used();
            let (pieces, _) = stored(&area, stride);
            let planned = Pieces::table_bytes(2 * PIECE as u64 + 1001, stride);
            assert_eq!(Bytes(area.budget().used() - before), planned, "{stride}");
            drop(pieces);
            assert_eq!(area.budget().used(), before);
        }
        let small = SpillArea::new(Budget::new(100), 0, Box::new(In(at.path().to_owned())));
        let error = Pieces::new(&small, "items", 8).reserve(1 << 20).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Memory);
    }
}
