//! What the first phase leaves of a tile: every division that could be made.
//!
//! Their ranges of angles are kept as numbers that compare as the ranges do, so that the second
//! phase finds a threshold among billions of divisions by counting, and never sorts them.

use bytemuck::{Pod, Zeroable};

use crate::point::Position;
use crate::stage::{Gathered, Summary};
use crate::{Error, Result};

/// The sign of an f64.
const SIGN: u64 = 1 << 63;

/// The divisions of a tile's cells.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TileDivisions {
    /// Records that are kept whatever is divided.
    pub(super) kept: u64,
    /// The initial cells that can be divided, in the order of their first positions.
    pub(super) cells: Vec<DividedCell>,
    /// Their divisions, cell after cell; every part's come before those of its own parts.
    pub(super) divisions: Vec<PartDivision>,
}

/// An initial cell that can be divided.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct DividedCell {
    /// Its Morton-first position.
    pub(super) first: Position,
    /// How many divisions it has.
    pub(super) divisions: u64,
}

/// One division of a cell or a part of it.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PartDivision {
    /// Its range of angles, the widest first: see [`key`].
    pub(super) key: u64,
    /// How many parts more it makes.
    pub(super) parts: u64,
}

/// Numbers that compare as the cosines do: ranges of angles from the widest to the narrowest.
pub(super) fn key(cosine: f64) -> u64 {
    let bits = (cosine + 0.0).to_bits(); // −0 + 0 = 0
    if bits & SIGN == 0 { bits | SIGN } else { !bits }
}

/// The cosine that has this key.
pub(super) fn cosine(key: u64) -> f64 {
    f64::from_bits(if key & SIGN == 0 { !key } else { key & !SIGN })
}

impl TileDivisions {
    /// The cells, each with its divisions.
    pub(super) fn each(&self) -> impl Iterator<Item = (Position, &[PartDivision])> {
        let mut rest = &self.divisions[..];
        self.cells.iter().map(move |cell| {
            let (own, later) = rest.split_at(rest.len().min(cell.divisions as usize));
            rest = later;
            (cell.first, own)
        })
    }
}

impl Summary for TileDivisions {
    fn store(&self, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(bytemuck::bytes_of(&[self.kept, self.cells.len() as u64]));
        self.cells.store(bytes);
        self.divisions.store(bytes);
    }

    fn load(bytes: &[u8]) -> Result<Self> {
        let cut_off = || Error::internal("the divisions of a tile are cut off");
        let (head, rest) = bytes.split_at_checked(size_of::<[u64; 2]>()).ok_or_else(cut_off)?;
        let [kept, cells]: [u64; 2] = bytemuck::pod_read_unaligned(head);
        let cells = (cells as usize).checked_mul(size_of::<DividedCell>()).ok_or_else(cut_off)?;
        let (cells, divisions) = rest.split_at_checked(cells).ok_or_else(cut_off)?;
        Ok(TileDivisions { kept, cells: Vec::load(cells)?, divisions: Vec::load(divisions)? })
    }
}

/// Calls `visit` with every division of every tile, in order.
pub(super) fn each(
    gathered: &dyn Gathered<TileDivisions>,
    mut visit: impl FnMut(&PartDivision),
) -> Result<()> {
    gathered.each(&mut |tile| {
        tile.divisions.iter().for_each(&mut visit);
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_compare_as_cosines_and_give_them_back() {
        let cosines =
            [-1.5, -1.0, -0.5, -1e-300, 0.0, 1e-300, 0.5, 1.0 - f64::EPSILON, 1.0, f64::INFINITY];
        assert!(cosines.map(key).is_sorted_by(|a, b| a < b));
        assert_eq!(cosines.map(|c| cosine(key(c))), cosines);
        assert_eq!(key(-0.0), key(0.0));
    }

    #[test]
    fn what_is_stored_comes_back_and_is_refused_where_it_is_cut_off() {
        let division = |cosine, parts| PartDivision { key: key(cosine), parts };
        let tile = TileDivisions {
            kept: 12,
            cells: vec![
                DividedCell { first: [-1, i64::MIN, 1 << 62], divisions: 2 },
                DividedCell { first: [1 << 62, -(2 << 61), i64::MAX], divisions: 1 },
            ],
            divisions: vec![division(-0.25, 7), division(0.25, 1), division(1.0, 3)],
        };
        let mut bytes = Vec::new();
        tile.store(&mut bytes);
        assert_eq!(TileDivisions::load(&bytes).unwrap(), tile);
        let each: Vec<_> = tile.each().map(|(first, own)| (first[0], own.len())).collect();
        assert_eq!(each, [(-1, 2), (1 << 62, 1)]);
        for len in [0, 15, 16 + 31, bytes.len() - 1] {
            assert!(TileDivisions::load(&bytes[..len]).is_err(), "{len} bytes");
        }
    }
}
