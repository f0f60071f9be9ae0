//! Filling a tile: its core, its zone, and a rim wide enough to prove most neighbourhoods.

use std::sync::Arc;

use super::sealed::{Reader, SealedTiles};
use super::{Fate, Tile, TileKey};
use crate::Result;
use crate::point::Bounds;

/// Loads tiles into one arena that it reuses; one a thread.
#[derive(Debug)]
pub struct Loader {
    tiles: Arc<SealedTiles>,
    reader: Reader,
    /// Positions up to which a tile gets a rim.
    rim_limit: usize,
    tile: Tile,
    /// For each position of the core, the number of its first record.
    first_records: Vec<u64>,
}

impl Loader {
    /// Bytes that a loader holds for each position of its capacity, columns included.
    pub const BYTES_PER_POINT: usize = 24 + 4 + 12 + size_of::<Fate>() + 8;

    /// A loader for tiles of up to `capacity` positions, rim included.
    pub fn new(tiles: &Arc<SealedTiles>, capacity: usize) -> Self {
        Loader {
            tiles: tiles.clone(),
            reader: Reader::default(),
            rim_limit: capacity,
            tile: Tile::with_capacity(capacity),
            first_records: Vec::with_capacity(capacity),
        }
    }

    /// Gives no tile a rim that makes it more than `positions`; what that leaves unproven is searched
    /// for in the whole scan.
    pub fn limit_rim(&mut self, positions: usize) {
        self.rim_limit = self.rim_limit.min(positions);
    }

    /// Loads the positions of `key`'s cube, of the `reach` around it that later stages look at
    /// together with it, and a rim in which to find the `neighbors` nearest of those.
    pub fn load(&mut self, key: TileKey, reach: i64, neighbors: usize) -> Result<&mut Tile> {
        let cube = key.cube();
        let zone = cube.grown(reach);
        let loaded = self.rim(&zone, neighbors)?;
        let tile = &mut self.tile;
        tile.clear(cube, zone);
        self.first_records.clear();
        let tiles = self.tiles.clone();
        tiles.blocks_meeting(&loaded, |b| {
            let block = tiles.block(b);
            let (positions, copies) = tiles.read(b, &mut self.reader)?;
            let mut record = block.first_record;
            for (&p, &n) in positions.iter().zip(copies) {
                if loaded.contains(p) {
                    if cube.contains(p) {
                        self.first_records.push(record);
                    } else if self.first_records.is_empty() {
                        tile.core.start = tile.positions.len() + 1;
                    }
                    tile.positions.push(p);
                    tile.copies.push(n);
                }
                record += u64::from(n);
            }
            Ok(())
        })?;
        tile.core.end = tile.core.start + self.first_records.len();
        tile.normals.resize(tile.positions.len(), [f32::NAN; 3]);
        tile.fates.resize(tile.positions.len(), Fate::Kept);
        tile.surround(&tiles, loaded);
        Ok(tile)
    }

    /// The tile last loaded and the number of the first record of each core position.
    pub fn tile(&mut self) -> (&mut Tile, &[u64]) {
        (&mut self.tile, &self.first_records)
    }

    /// The zone grown by a few times the distance at which its positions have their neighbours,
    /// less where that would not fit. What the rim does not prove is searched for elsewhere, so
    /// its width decides speed alone.
    fn rim(&mut self, zone: &Bounds, neighbors: usize) -> Result<Bounds> {
        if neighbors == 0 {
            return Ok(*zone);
        }
        let mut spacings = Vec::new();
        self.tiles.blocks_meeting(zone, |b| {
            let block = self.tiles.block(b);
            spacings.push(spacing(&block.bounds, block.len()));
            Ok(())
        })?;
        let typical = spacings.len() * 3 / 4;
        let spacing = match spacings.len() {
            0 => 0.0,
            _ => *spacings.select_nth_unstable_by(typical, f64::total_cmp).1,
        };
        let mut width = (1.5 * (neighbors as f64).sqrt() * spacing).min(4e18) as i64 + 1;
        let limit = self.rim_limit as u64;
        loop {
            let region = zone.grown(width);
            if width == 0 || !self.tiles.holds_more(&region, limit, &mut self.reader)? {
                return Ok(region);
            }
            width /= 2;
        }
    }
}

/// Mean distance of neighbours in a block, taken as a piece of surface: the square root of its
/// largest face per position.
fn spacing(bounds: &Bounds, positions: usize) -> f64 {
    let mut side = bounds.extent().map(|v| v as f64);
    side.sort_unstable_by(f64::total_cmp);
    let n = positions as f64;
    (side[2] * side[1] / n).sqrt().max(side[2] / n)
}
