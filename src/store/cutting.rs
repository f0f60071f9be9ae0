//! The scan as octree nodes that fit.
//!
//! Nodes are found from above, by halving those that are too heavy. How many positions a box holds
//! is answered by the index of the sealed scan, which knows the counts of whole blocks, so only
//! blocks at the faces of a box are unpacked. Counting while the scan is decoded would need the
//! sizes of tiles before the memory for them is known.

use super::TileKey;
use super::sealed::{Reader, SealedTiles};
use crate::Error;

impl SealedTiles {
    /// Cuts the scan into octree nodes, in Morton order, none without a position: nodes whose cube
    /// grown by `reach` has at most `wanted` positions; or at most `most`, where the side is
    /// 2^`good` or less, so that smaller nodes would be mostly zone. None has a side below
    /// 2^`lowest`.
    ///
    /// If nodes of that side have more, the error names the one that has most and its count.
    pub fn cut(
        &self,
        wanted: u64,
        most: u64,
        reach: i64,
        (good, lowest): (u32, u32),
    ) -> Result<Vec<TileKey>, CutError> {
        let mut tiles = Vec::new();
        if self.positions() == 0 {
            return Ok(tiles);
        }
        let mut reader = Reader::default();
        let mut heaviest: Option<(u64, TileKey)> = None;
        let mut open = vec![TileKey::holding(&self.bounds())];
        while let Some(key) = open.pop() {
            if !self.holds_more(&key.cube(), 0, &mut reader)? {
                continue;
            }
            let zone = key.cube().grown(reach);
            let smallest = key.level <= lowest || key.level == 0;
            let is_good = smallest || key.level <= good;
            let limit = if is_good { most } else { wanted.min(most) };
            if !self.holds_more(&zone, limit, &mut reader)? {
                tiles.push(key);
                continue;
            }
            match key.children().filter(|_| !smallest) {
                Some(children) => open.extend(children.iter().rev()),
                None => {
                    let positions = self.count(&zone, &mut reader)?;
                    if heaviest.is_none_or(|(most, _)| positions > most) {
                        heaviest = Some((positions, key));
                    }
                }
            }
        }
        match heaviest {
            Some((positions, key)) => Err(CutError::TooHeavy { key, positions }),
            None => Ok(tiles),
        }
    }
}

/// Why a scan could not be cut.
#[derive(Debug)]
pub enum CutError {
    /// A cube of the smallest side holds more positions than fit.
    TooHeavy {
        /// The cube.
        key: TileKey,
        /// Positions in it and what is around it that its cells need.
        positions: u64,
    },
    /// The spill could not be read.
    Read(Error),
}

impl From<Error> for CutError {
    fn from(error: Error) -> Self {
        CutError::Read(error)
    }
}
