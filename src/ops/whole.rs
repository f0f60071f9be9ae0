//! What a stage knows of all positions at once: for methods that follow points from one end of the
//! scan to the other, and that no tile can do alone.
//!
//! The first phase gathers a value of each position, tile by tile; what is concluded from all of
//! them is found again by the position when tiles come by once more, however they are cut then. All
//! of it is in memory, which the stage declares by [`Needs::holds`](crate::stage::Needs::holds), so
//! that a scan that is too large is refused before any work.

use bytemuck::Pod;

use super::removal::{keep_once, represent_at};
use crate::geom::morton::morton_cmp;
use crate::point::Position;
use crate::report::Tally;
use crate::stage::{Gathered, Summary};
use crate::tile::Tile;
use crate::{Error, Result};

/// Positions in Morton order, each with a value.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows<T> {
    pub positions: Vec<Position>,
    pub values: Vec<T>,
}

impl<T> Default for Rows<T> {
    fn default() -> Self {
        Rows { positions: Vec::new(), values: Vec::new() }
    }
}

impl<T: Pod> Rows<T> {
    /// Bytes that they take for each position.
    pub const BYTES: usize = size_of::<Position>() + size_of::<T>();

    /// Those of a tile's core that the stage decides about, with their values.
    pub fn of_core(tile: &Tile, value: impl Fn(usize) -> T) -> Self {
        Rows::of_core_where(tile, |_| true, value)
    }

    /// Those of them for which a condition holds.
    pub fn of_core_where(
        tile: &Tile,
        holds: impl Fn(usize) -> bool,
        value: impl Fn(usize) -> T,
    ) -> Self {
        let mut rows = Rows::default();
        let chosen = || tile.core.clone().filter(|&i| tile.is_chosen(i) && holds(i));
        rows.reserve(chosen().count());
        for i in chosen() {
            rows.positions.push(tile.positions[i]);
            rows.values.push(value(i));
        }
        rows
    }

    /// Those of all tiles.
    pub fn of_scan(gathered: &dyn Gathered<Self>) -> Result<Self> {
        let mut all = Rows::default();
        // Memory that is reserved and not used is not resident.
        all.reserve(gathered.records() as usize);
        gathered.each(&mut |tile| {
            all.positions.extend_from_slice(&tile.positions);
            all.values.extend_from_slice(&tile.values);
            Ok(())
        })?;
        match u32::try_from(all.positions.len()) {
            Ok(_) => Ok(all),
            Err(_) => {
                let told = "a stage that needs the whole scan takes no more than 2^32 positions";
                Err(Error::memory(told))
            }
        }
    }

    fn reserve(&mut self, count: usize) {
        self.positions.reserve_exact(count);
        self.values.reserve_exact(count);
    }

    /// Calls `visit` with the tile, the index in it, and that among these rows, of each position of
    /// its core that the stage decides about.
    pub fn each_of_core(
        &self,
        tile: &mut Tile,
        mut visit: impl FnMut(&mut Tile, usize, usize),
    ) -> Result<()> {
        let mut next = None;
        for i in tile.core.clone() {
            if !tile.is_chosen(i) {
                continue;
            }
            let p = tile.positions[i];
            let found = || self.positions.partition_point(|q| morton_cmp(q, &p).is_lt());
            let at = next.unwrap_or_else(found);
            if self.positions.get(at) != Some(&p) {
                return Err(Error::internal("a stage decides about what it did not gather"));
            }
            visit(tile, i, at);
            next = Some(at + 1);
        }
        Ok(())
    }

    /// The value of a position, if it has one.
    pub fn value(&self, p: Position) -> Option<T> {
        let at = self.positions.partition_point(|q| morton_cmp(q, &p).is_lt());
        (self.positions.get(at) == Some(&p)).then(|| self.values[at])
    }

    /// The same positions with other values, one for each.
    pub fn with<U>(self, values: Vec<U>) -> Rows<U> {
        debug_assert_eq!(self.positions.len(), values.len(), "a value for each position");
        Rows { positions: self.positions, values }
    }
}

impl Rows<f32> {
    /// Removes from the core of a tile what goes, as `stage`: a value is how far a position is from
    /// what stands for it, in steps, and NaN where it stays.
    pub fn thin(&self, tile: &mut Tile, stage: &'static str, tally: &mut Tally) -> Result<()> {
        let (mut coincident, mut represented) = (0, 0);
        self.each_of_core(tile, |tile, i, at| match self.values[at] {
            deviation if deviation.is_nan() => coincident += keep_once(tile, i),
            deviation => represented += represent_at(tile, i, deviation),
        })?;
        tally.remove(stage, "coincident", coincident);
        tally.remove(stage, "represented", represented);
        Ok(())
    }
}

impl<T: Pod> Summary for Rows<T> {
    fn store(&self, bytes: &mut Vec<u8>) {
        // No more than is declared, which growing by itself would be.
        bytes.reserve_exact(self.positions.len() * Self::BYTES);
        self.positions.store(bytes);
        self.values.store(bytes);
    }

    fn load(bytes: &[u8]) -> Result<Self> {
        let cut_off = || Error::internal("what a stage gathered of a tile is cut off");
        let count = bytes.len() / Self::BYTES;
        if count * Self::BYTES != bytes.len() {
            return Err(cut_off());
        }
        let positions = count * size_of::<Position>();
        let (positions, values) = bytes.split_at_checked(positions).ok_or_else(cut_off)?;
        let values = match size_of::<T>() {
            0 => vec![T::zeroed(); count],
            _ => Vec::load(values)?,
        };
        Ok(Rows { positions: Vec::load(positions)?, values })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_back_and_are_found_by_their_positions() {
        let positions: Vec<Position> = (0..10).map(|x| [x, 0, 0]).collect();
        let mut tile = Tile::of(positions.clone());
        tile.core = 3..8;
        tile.copies[5] = 0;
        let rows = Rows::of_core(&tile, |i| i as u64);
        assert_eq!(rows.values, [3, 4, 6, 7]);
        let mut bytes = Vec::new();
        rows.store(&mut bytes);
        assert_eq!(Rows::<u64>::load(&bytes).unwrap(), rows);
        for cut in [1, 8, 31, bytes.len() - 1] {
            assert!(Rows::<u64>::load(&bytes[..cut]).is_err(), "{cut} bytes");
        }
        tile.core = 6..8;
        let mut found = Vec::new();
        rows.each_of_core(&mut tile, |_, i, at| found.push((i, rows.values[at]))).unwrap();
        assert_eq!(found, [(6, 6), (7, 7)]);
        tile.core = 7..9;
        assert!(rows.each_of_core(&mut tile, |_, _, _| ()).is_err(), "the eighth was not gathered");
    }
}
