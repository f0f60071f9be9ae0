//! Filling a tile: its core, its zone, and a rim wide enough to prove most neighbourhoods.
//!
//! All three lie in one box, which is asked for once, since most blocks of the rim reach into the
//! core. The width of the rim follows from the density of the core, about the square root of the
//! number of neighbours in spacings of the points: a wider one loads positions in vain, a narrower
//! one leaves more of them to be searched for one by one.

mod blocks;

use std::sync::Arc;

use super::only::Only;
use super::sieve::{MoreRuns, RecordRun, Runs, Sieve};
use super::values::DimensionColumns;
use super::{Fate, Tile};
use crate::Result;
use crate::budget::Bytes;
use crate::point::{Bounds, ColumnKind, NORMAL, Position};
use crate::store::FATE_BYTES;
use crate::store::Pieces;
use crate::store::TileKey;
use crate::store::{Reader, SealedTiles, first_of_each};

/// Loads tiles into one arena that it reuses; one a thread.
#[derive(Debug)]
pub struct Loader {
    tiles: Arc<SealedTiles>,
    sieve: Sieve,
    reader: Reader,
    runs: Runs,
    stored: Vec<u8>,
    /// Positions that a tile takes.
    capacity: usize,
    /// Positions up to which a tile gets a rim.
    rim_limit: usize,
    /// True if every tile is to see the whole scan.
    sees_all: bool,
    only: Only,
    tile: Tile,
    core: Core,
    dimensions: Option<DimensionColumns>,
}

/// The records of a tile's core, those that the pass does not see included: what the tile's stages
/// decide is to be entered for all of them.
#[derive(Debug, Default)]
pub struct Core {
    /// Number of the first of its positions.
    pub first_position: u64,
    /// Number of each position's first record: where every record is seen, and this tells all.
    first_records: Vec<u64>,
    /// The runs of its records, where a sieve may hold some back.
    runs: Vec<RecordRun>,
    more: MoreRuns,
    /// Stored fates of its positions; none before the first pass.
    fates: Vec<u8>,
}

impl Core {
    /// Calls `visit` for every position with its runs, which have its index in the tile, and its
    /// stored fate. `copies` are the tile's.
    pub fn each(
        &self,
        tile: &Tile,
        mut visit: impl FnMut(&[RecordRun], Option<[u8; FATE_BYTES]>) -> Result<()>,
    ) -> Result<()> {
        let slots = tile.core.start as u32..;
        for (slot, &number) in slots.zip(&self.first_records) {
            let count = tile.copies[slot as usize];
            visit(
                &[RecordRun { number, count, slot, begins: true, ..RecordRun::default() }],
                None,
            )?;
        }
        let mut stored = self.fates.chunks_exact(FATE_BYTES);
        let mut rest = &self.runs[..];
        while let [_, others @ ..] = rest {
            let count = 1 + others.iter().take_while(|run| !run.begins).count();
            let (position, later) = rest.split_at(count);
            let fate = stored.next().map(|fate| {
                let mut code = [0; FATE_BYTES];
                code.copy_from_slice(fate);
                code
            });
            visit(position, fate)?;
            rest = later;
        }
        Ok(())
    }

    /// Number of each position's first record, if every record is seen, and alike to every stage.
    pub fn first_records(&self) -> Option<&[u64]> {
        self.runs.is_empty().then_some(&self.first_records)
    }

    fn clear(&mut self) {
        self.first_position = 0;
        self.first_records.clear();
        self.more.give_back(&mut self.runs);
        self.fates.clear();
    }
}

impl Loader {
    /// Bytes that a loader holds for each position of its capacity, columns aside.
    pub const BYTES_PER_POINT: usize = size_of::<Position>()
        + size_of::<u32>() // copies
        + size_of::<Fate>()
        + size_of::<u64>(); // first record
    /// Bytes more where a sieve may hold records back.
    pub const SIEVE_BYTES_PER_POINT: usize = size_of::<RecordRun>() + FATE_BYTES + 2;
    /// Bytes more where dimensions of records are columns.
    pub const DIMENSION_BYTES_PER_POINT: usize = size_of::<u64>();

    /// Bytes besides where dimensions of records of `stride` bytes are columns.
    pub(crate) fn dimension_bytes(stride: usize) -> Bytes {
        DimensionColumns::bytes(stride)
    }

    /// A loader for tiles of up to `capacity` positions, rim included, as `sieve` lets them be
    /// seen.
    pub fn new(tiles: &Arc<SealedTiles>, sieve: &Sieve, capacity: usize) -> Self {
        let dimensions = sieve.dimensions.as_ref().map(DimensionColumns::new);
        let mut tile = Tile::with_capacity(capacity);
        let stored: Vec<ColumnKind> = sieve.columns.iter().map(|(kind, _)| *kind).collect();
        let read = dimensions.as_ref().map_or(Vec::new(), DimensionColumns::kinds);
        tile.columns.declare(&stored);
        tile.columns.declare(&sieve.computed);
        tile.columns.declare(&read);
        tile.columns.reserve(capacity);
        Loader {
            tiles: tiles.clone(),
            sieve: sieve.clone(),
            reader: Reader::default(),
            runs: Runs::default(),
            stored: Vec::new(),
            capacity,
            rim_limit: capacity,
            sees_all: false,
            only: Only::All,
            tile,
            core: Core::default(),
            dimensions,
        }
    }

    /// Gives no tile a rim that makes it more than `positions`; what that leaves unproven is
    /// searched for in the whole scan.
    pub fn limit_rim(&mut self, positions: usize) {
        self.rim_limit = self.rim_limit.min(positions);
    }

    /// Makes the whole scan the zone of every tile, whatever that takes: for scans of a few points
    /// and stages of which nobody knows yet whether they look no further than they say.
    pub fn see_all(&mut self) {
        self.sees_all = true;
    }

    /// Takes only some positions from now on. What is left of a tile is not a part of the scan
    /// without gaps, so nothing can be entered for its records.
    pub(crate) fn take_only(&mut self, only: Only) {
        self.only = only;
    }

    /// The scan that it loads from.
    pub fn tiles(&self) -> &SealedTiles {
        &self.tiles
    }

    /// Loads the positions of `key`'s cube, of the `reach` around it that later stages look at
    /// together with it, and a rim in which to find the `neighbors` nearest of those.
    ///
    /// # Errors
    ///
    /// Those of reading the store.
    pub fn load(&mut self, key: TileKey, reach: i64, neighbors: usize) -> Result<&mut Tile> {
        let cube = key.cube();
        let (zone, loaded) = match self.sees_all {
            true => (cube.union(&self.tiles.bounds()), cube.union(&self.tiles.bounds())),
            false => (cube.grown(reach), self.rim(&cube.grown(reach), neighbors)?),
        };
        self.tile.clear(cube, zone);
        self.core.clear();
        if let Some(dimensions) = &mut self.dimensions {
            dimensions.numbers.clear();
        }
        let loads = |column: ColumnKind| self.sieve.columns.iter().any(|(kind, _)| *kind == column);
        self.tile.oriented = loads(NORMAL.kind()) && self.sieve.oriented;
        let tiles = self.tiles.clone();
        let is_fine = self.sieve.is_fine(&tiles);
        tiles.blocks_meeting(&loaded, |b| match is_fine {
            true => self.sift(b, &loaded),
            false => self.take(b, &loaded),
        })?;
        let Tile { positions, columns, fates, core, .. } = &mut self.tile;
        if !is_fine {
            core.end = core.start + self.core.first_records.len();
        }
        if let Some(dimensions) = &mut self.dimensions {
            dimensions.fill(&tiles, columns)?;
        }
        columns.resize(positions.len());
        fates.resize(positions.len(), Fate::Kept);
        self.tile.around.surround(&tiles, &self.sieve, loaded);
        Ok(&mut self.tile)
    }

    /// Takes all positions of block `b` that are in `loaded`.
    fn take(&mut self, b: usize, loaded: &Bounds) -> Result<()> {
        let block = self.tiles.block(b);
        let (positions, copies) = self.tiles.read(b, &mut self.reader)?;
        let (tile, first_records) = (&mut self.tile, &mut self.core.first_records);
        let is_core = tile.cube.holds(&block.bounds);
        if self.only.is_all()
            && loaded.holds(&block.bounds)
            && (is_core || !tile.cube.meets(&block.bounds))
        {
            // Nearly all blocks: no position has to be looked at.
            if is_core && first_records.is_empty() {
                self.core.first_position = block.first_position;
            } else if first_records.is_empty() {
                tile.core.start = tile.positions.len() + positions.len();
            }
            if is_core {
                first_records.extend(first_of_each(block.first_record, copies));
            }
            tile.positions.extend_from_slice(positions);
            tile.copies.extend_from_slice(copies);
            if let Some(dimensions) = &mut self.dimensions {
                dimensions.numbers.extend(first_of_each(block.first_record, copies));
            }
            return Ok(());
        }
        let records = first_of_each(block.first_record, copies);
        for (j, ((&p, &n), record)) in positions.iter().zip(copies).zip(records).enumerate() {
            if loaded.contains(p) && self.only.takes(p) {
                if tile.cube.contains(p) {
                    if first_records.is_empty() {
                        self.core.first_position = block.first_position + j as u64;
                    }
                    first_records.push(record);
                } else if first_records.is_empty() {
                    tile.core.start = tile.positions.len() + 1;
                }
                tile.positions.push(p);
                tile.copies.push(n);
                if let Some(dimensions) = &mut self.dimensions {
                    dimensions.numbers.push(record);
                }
            }
        }
        Ok(())
    }

    /// Takes those positions of block `b` in `loaded` that the pass sees, and the records of those
    /// in the core.
    fn sift(&mut self, b: usize, loaded: &Bounds) -> Result<()> {
        let first = self.tiles.block(b).first_position;
        let (positions, copies) = self.tiles.read(b, &mut self.reader)?;
        self.runs.read(&self.tiles, &self.sieve, b, copies)?;
        let Sieve { seen, decided, classes, .. } = self.sieve;
        let sieve = &self.sieve;
        let (tile, core, only) = (&mut self.tile, &mut self.core, &mut self.only);
        let mut places = Vec::with_capacity(positions.len());
        let mut in_core = 0..0;
        for (j, &p) in positions.iter().enumerate() {
            if !loaded.contains(p) || !only.takes(p) {
                continue;
            }
            let runs = self.runs.of(j);
            let is_core = tile.cube.contains(p);
            let is_seen = runs.iter().any(|run| run.is_in(seen));
            let slot = if is_seen { tile.positions.len() as u32 } else { RecordRun::UNSEEN };
            if is_core {
                if core.runs.is_empty() {
                    core.first_position = first + j as u64;
                    (tile.core.start, tile.core.end) = (tile.positions.len(), tile.positions.len());
                }
                if in_core.is_empty() {
                    in_core = j as u64..j as u64;
                }
                in_core.end = j as u64 + 1;
                core.runs.extend(runs.iter().map(|run| RecordRun { slot, ..*run }));
            }
            if is_seen {
                let alive = runs.iter().filter(|run| run.is_alive());
                tile.selections.push(alive.fold(0, |of, run| of | run.selections()));
                let decided = || runs.iter().filter(|run| run.is_in(decided));
                tile.copies.push(decided().map(|run| run.count).sum());
                let first = RecordRun::first_of(runs, sieve);
                if classes {
                    tile.classes.push(first.map_or(0, |run| run.tag.class()));
                }
                if let (Some(dimensions), Some(first)) = (&mut self.dimensions, first) {
                    dimensions.numbers.push(first.number);
                }
                tile.positions.push(p);
                tile.core.end += usize::from(is_core);
                places.push(j);
            }
        }
        let runs = self.core.runs.len();
        self.core.more.hold(&self.tiles, runs, self.capacity, runs as u64)?;
        self.columns(first, &places, in_core)
    }

    /// Reads what is stored for the positions just taken, at `places` of the block whose first
    /// position has the number `first`, and the fates of those `in_core`.
    fn columns(
        &mut self,
        first: u64,
        places: &[usize],
        in_core: std::ops::Range<u64>,
    ) -> Result<()> {
        let Loader { sieve, tile, core, stored, .. } = self;
        let begin = tile.positions.len() - places.len();
        if let Some(fates) = sieve.fates.as_ref().filter(|_| !in_core.is_empty()) {
            read_column(fates, (first + in_core.start, in_core.end - in_core.start), stored)?;
            core.fates.extend_from_slice(stored);
        }
        let Some((&lowest, &highest)) = places.first().zip(places.last()) else { return Ok(()) };
        let span = (first + lowest as u64, (highest - lowest + 1) as u64);
        for (column, pieces) in &sieve.columns {
            read_column(pieces, span, stored)?;
            let size = column.bytes();
            let value = |places: &[usize]| {
                let (first, count) = (places[0] - lowest, places.len());
                &stored[first * size..(first + count) * size]
            };
            // Positions that follow one another, as nearly all of a block do, have their values so.
            let stretches = places.chunk_by(|a, b| a + 1 == *b);
            tile.columns.append(*column, begin, stretches.map(value));
        }
        Ok(())
    }

    /// The tile last loaded and the records of its core.
    pub fn tile(&mut self) -> (&mut Tile, &Core) {
        (&mut self.tile, &self.core)
    }

    /// The zone grown by about twice the distance at which its positions have their neighbours (k
    /// of them on a plane lie within √(k/π) spacings), less where that would not fit. What the rim
    /// does not prove is searched for elsewhere, so its width decides speed alone.
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
        let mut width = ((neighbors as f64).sqrt() * spacing).min(4e18) as i64 + 1;
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

/// Replaces `stored` by `count` items of `column` from number `first` on.
fn read_column(column: &Pieces, (first, count): (u64, u64), stored: &mut Vec<u8>) -> Result<()> {
    column.collect(first, count, &mut Vec::new(), stored)
}
