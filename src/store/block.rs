//! Blocks: up to 256 positions that follow each other in Morton order, packed relative to their
//! box.
//!
//! Neighbours in Morton order are neighbours in space, so offsets from the smallest corner of their
//! box need one or two bytes where positions need eight: about 6 bytes a position instead of 24 on
//! scans of some metres in millimetres. A block is small enough to be unpacked for one box query,
//! and large enough that its entry in the index is half a byte a position. Its box is tight, which
//! makes the index prune well and costs nothing, as it is known when the block is packed.

use serde::{Deserialize, Serialize};

use super::spill::{Address, Checksum, Spill};
use crate::Result;
use crate::point::{Bounds, Position};

/// Positions in a block.
pub const BLOCK: usize = 256;

/// Where a block is and what it spans.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Block {
    /// Tight box of the positions.
    pub bounds: Bounds,
    /// The first of them in Morton order.
    pub first: Position,
    /// Number of the first position among all of the scan.
    pub first_position: u64,
    /// Number of the first position's first record among all (see
    /// [`SealedTiles`](super::SealedTiles)).
    pub first_record: u64,
    address: Address,
    checksum: Checksum,
    len: u16,
    width: u8,
    has_copies: bool,
}

impl Block {
    /// Bytes that a position takes at most where it is packed, the number of its copies included.
    pub const BYTES_PER_POSITION: usize = size_of::<Position>() + size_of::<u32>();

    /// How many positions it has: at least one.
    pub fn len(&self) -> usize {
        usize::from(self.len)
    }

    fn bytes(&self) -> usize {
        self.len() * (3 * usize::from(self.width) + if self.has_copies { 4 } else { 0 })
    }

    /// Where it is, the checksum of what is there, and how many bytes that is.
    pub(super) fn stored(&self) -> (Address, Checksum, u64) {
        (self.address, self.checksum, self.bytes() as u64)
    }

    /// Packs positions in Morton order onto `out`, each with its copies; no `copies` are one each.
    /// The address is that of the stretch which `out` will become, once [`placed`](Block::placed).
    pub fn pack(positions: &[Position], copies: &[u32], out: &mut Vec<u8>) -> (Block, usize) {
        let bounds = Bounds::of(positions.iter().copied());
        let extent = bounds.extent().into_iter().max().unwrap_or(0);
        let width = match extent {
            0..=0xff => 1,
            0x100..=0xffff => 2,
            0x1_0000..=0xffff_ffff => 4,
            _ => 8,
        };
        let start = out.len();
        match width {
            1 => pack_as::<1>(positions, bounds.lo, out),
            2 => pack_as::<2>(positions, bounds.lo, out),
            4 => pack_as::<4>(positions, bounds.lo, out),
            _ => pack_as::<8>(positions, bounds.lo, out),
        }
        let has_copies = copies.iter().any(|&n| n != 1);
        if has_copies {
            copies.iter().for_each(|n| out.extend_from_slice(&n.to_le_bytes()));
        }
        let block = Block {
            bounds,
            first: positions[0],
            first_position: 0,
            first_record: 0,
            address: Address::default(),
            checksum: Checksum::default(),
            len: positions.len() as u16,
            width: width as u8,
            has_copies,
        };
        (block, start)
    }

    /// Gives a packed block its address: `start` bytes into the stretch at `stretch`, which is
    /// `packed`.
    pub fn placed(&mut self, stretch: Address, start: usize, packed: &[u8]) {
        self.address = stretch.plus(start as u64);
        self.checksum = self.address.checksum(&packed[start..start + self.bytes()]);
    }

    /// Appends the positions to `positions` and, if asked, how many records share each.
    pub fn read(
        &self,
        spill: &Spill,
        buffer: &mut Vec<u8>,
        positions: &mut Vec<Position>,
        copies: Option<&mut Vec<u32>>,
    ) -> Result<()> {
        buffer.resize(self.bytes(), 0);
        spill.read(self.address, self.checksum, buffer)?;
        let width = usize::from(self.width);
        let (packed, counts) = buffer.split_at(self.len() * 3 * width);
        match width {
            1 => self.unpack::<1>(packed, positions),
            2 => self.unpack::<2>(packed, positions),
            4 => self.unpack::<4>(packed, positions),
            _ => self.unpack::<8>(packed, positions),
        }
        if let Some(copies) = copies {
            if self.has_copies {
                copies.extend(
                    counts.chunks_exact(4).map(|c| u32::from_le_bytes([c[0], c[1], c[2], c[3]])),
                );
            } else {
                copies.resize(copies.len() + self.len(), 1);
            }
        }
        Ok(())
    }

    fn unpack<const W: usize>(&self, packed: &[u8], positions: &mut Vec<Position>) {
        let lo = self.bounds.lo;
        positions.extend(packed.chunks_exact(3 * W).map(|p| {
            std::array::from_fn(|axis| {
                let mut offset = [0; 8];
                offset[..W].copy_from_slice(&p[axis * W..(axis + 1) * W]);
                lo[axis].wrapping_add(u64::from_le_bytes(offset) as i64)
            })
        }));
    }
}

/// Packs the offsets of `positions` from `lo`, `W` bytes an axis.
fn pack_as<const W: usize>(positions: &[Position], lo: Position, out: &mut Vec<u8>) {
    let start = out.len();
    out.resize(start + positions.len() * 3 * W, 0);
    for (p, packed) in positions.iter().zip(out[start..].chunks_exact_mut(3 * W)) {
        for axis in 0..3 {
            let offset = p[axis].wrapping_sub(lo[axis]).to_le_bytes();
            packed[axis * W..(axis + 1) * W].copy_from_slice(&offset[..W]);
        }
    }
}

/// The number of the first record of each position, where positions have so many `copies` each and
/// the first of all is `record`.
pub fn first_of_each(mut record: u64, copies: &[u32]) -> impl Iterator<Item = u64> + '_ {
    copies.iter().map(move |&n| {
        record += u64::from(n);
        record - u64::from(n)
    })
}
