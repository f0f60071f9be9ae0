//! What a voxel grid of as many points would have done: the deviation of a plain alternative,
//! measured like that of the reduction, so that everyone sees what the method gave.
//!
//! The cubes of octree levels are grids of every second power of a side; the figures of a grid of
//! any number of points lie between those of two levels. How many points a run keeps is known when
//! it is over, so all levels that may be needed are measured on the way: in some of the cubes of
//! the coarsest one, chosen by their corners alone, which is enough for figures of the whole scan.

use serde::{Deserialize, Serialize};

use std::ops::Range;

use super::deviations::{Deviations, Histogram};
use super::figures::{BaselineFigures, world_length};
use crate::geom::angle::is_known;
use crate::geom::lattice::Lattice;
use crate::point::{NORMAL, Position, center_distance2};
use crate::store::{Levels, TileKey};
use crate::tile::Tile;

/// Levels that are measured at most.
const LEVELS: usize = 6;
/// Positions, and cubes of the coarsest level, that are enough for figures of the whole scan.
const ENOUGH: (u64, u64) = (1 << 17, 1 << 12);

/// Grids of several octree levels, of each cube the position nearest to the centre standing for the
/// others. Merged in any order they are the same, however the scan is cut into tiles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Baseline {
    /// Binary logarithm of the side of the coarsest level.
    top: u32,
    /// One of 2^`thinned` of its cubes is measured.
    thinned: u32,
    /// Records in those.
    records: u64,
    /// From the coarsest on, each of half the side.
    levels: Vec<GridLevel>,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
struct GridLevel {
    cubes: u64,
    deviations: Deviations,
    histogram: Histogram,
}

impl Baseline {
    /// Bytes that it holds at most.
    pub const BYTES: u64 = LEVELS as u64 * (Histogram::BYTES + size_of::<GridLevel>() as u64);

    /// Measures levels down from the one whose cubes are twice as wide as the power of two that is
    /// at least `side` steps: no grid of fewer points is asked for where one point stays of every
    /// cube of that side. Ends where cubes hold hardly more than one position.
    pub fn new(side: i64, levels: &Levels) -> Self {
        let top = ((side.max(1) as u64).next_power_of_two().ilog2() + 1).min(62);
        let few = |level: &u32| levels.occupied(*level) <= levels.positions() / 4 * 3;
        let count = 1 + (0..top).rev().take_while(few).count().min(LEVELS - 1);
        let spare = (levels.positions() / ENOUGH.0).min(levels.occupied(top) / ENOUGH.1);
        Baseline {
            top,
            thinned: spare.max(1).ilog2(),
            records: 0,
            levels: vec![GridLevel::default(); count],
        }
    }

    /// Adds what stages decide about in the core of a tile that has normals. No cube of the
    /// coarsest level may cross its faces.
    pub fn add(&mut self, tile: &Tile) {
        let Some(normals) = tile.columns.find(&NORMAL) else { return };
        let measured = MeasuredTile { tile, normals };
        let Range { mut start, end } = tile.core;
        while start < end {
            let first = tile.positions[start];
            let count = run(&tile.positions[start..end], self.top);
            if self.takes(first) {
                let chosen = (start..start + count).filter(|&i| tile.is_chosen(i));
                self.records += chosen.map(|i| u64::from(tile.copies[i])).sum::<u64>();
                for (level, side) in self.levels.iter_mut().zip((0..=self.top).rev()) {
                    level.add(&measured, start..start + count, side);
                }
            }
            start += count;
        }
    }

    /// True if the coarsest cube of a position is measured: by a mix of its corner's bits.
    fn takes(&self, p: Position) -> bool {
        let mixed = p.iter().fold(0u64, |mixed, &v| {
            let part = mixed ^ (v >> self.top) as u64;
            let part = (part ^ part >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            part ^ part >> 32
        });
        mixed.trailing_zeros() >= self.thinned
    }

    /// Adds what another one measured.
    pub fn merge(&mut self, other: &Baseline) {
        self.records += other.records;
        for (mine, theirs) in self.levels.iter_mut().zip(&other.levels) {
            mine.cubes += theirs.cubes;
            mine.deviations.merge(&theirs.deviations);
            mine.histogram.merge(&theirs.histogram);
        }
    }

    /// The figures of a grid that keeps `kept` of `decided` records; none where no two levels lie
    /// on both sides of it, or nothing was measured.
    pub fn figures(&self, kept: u64, decided: u64, lattice: &Lattice) -> Option<BaselineFigures> {
        let wanted = kept as f64 * (self.records as f64 / decided as f64);
        let fits =
            |pair: &[GridLevel]| pair[0].cubes as f64 <= wanted && wanted <= pair[1].cubes as f64;
        let at = self.levels.windows(2).position(fits)?;
        let [coarse, fine] = [&self.levels[at], &self.levels[at + 1]];
        let log = |count: f64| libm::log(count);
        let span = log(fine.cubes as f64) - log(coarse.cubes as f64);
        let share = if span > 0.0 { (log(wanted) - log(coarse.cubes as f64)) / span } else { 0.0 };
        // Figures go by powers of the side, as the side does between the levels.
        let between = |a: f64, b: f64| match a > 0.0 && b > 0.0 {
            true => a * libm::pow(b / a, share),
            false => a + (b - a) * share,
        };
        let percentile = |percent: u32| {
            let of = |level: &GridLevel| level.histogram.percentile(percent);
            Some(between(world_length(of(coarse)?, lattice), world_length(of(fine)?, lattice)))
        };
        Some(BaselineFigures {
            side: libm::exp2(f64::from(self.top - at as u32) - share) * lattice.step,
            points: coarse.deviations.count().min(fine.deviations.count()),
            rms: between(coarse.deviations.rms()?, fine.deviations.rms()?) * lattice.step,
            p50: percentile(50)?,
            p95: percentile(95)?,
            p99: percentile(99)?,
        })
    }
}

/// A tile with its normals.
struct MeasuredTile<'a> {
    tile: &'a Tile,
    normals: &'a [[f32; 3]],
}

impl GridLevel {
    /// Adds the cubes of side 2^`level` among positions that follow one another.
    fn add(&mut self, tile: &MeasuredTile<'_>, Range { mut start, end }: Range<usize>, level: u32) {
        while start < end {
            let count = run(&tile.tile.positions[start..end], level);
            self.add_cube(tile, start..start + count, level);
            start += count;
        }
    }

    fn add_cube(
        &mut self,
        MeasuredTile { tile, normals }: &MeasuredTile<'_>,
        cube: Range<usize>,
        level: u32,
    ) {
        let corner = TileKey::around(tile.positions[cube.start], level).corner;
        let from_center = |i: usize| center_distance2(tile.positions[i], corner, 1 << level);
        let chosen = || cube.clone().filter(|&i| tile.is_chosen(i));
        let Some(kept) = chosen().min_by_key(|&i| (from_center(i), i)) else { return };
        self.cubes += 1;
        self.measure(kept, 0.0, tile, tile.copies[kept].saturating_sub(1));
        if is_known(normals[kept]) {
            let normal = normals[kept].map(f64::from);
            let q = tile.positions[kept];
            for i in chosen().filter(|&i| i != kept) {
                let p = tile.positions[i];
                let [x, y, z]: [f64; 3] =
                    std::array::from_fn(|axis| (p[axis] - q[axis]) as f64 * normal[axis]);
                self.measure(i, (x + y + z).abs() as f32, tile, tile.copies[i]);
            }
        }
    }

    fn measure(&mut self, i: usize, deviation: f32, tile: &Tile, records: u32) {
        if records > 0 {
            self.deviations.add(deviation, tile.positions[i], records);
            self.histogram.add(deviation, records);
        }
    }
}

/// How many of the positions, from the first on, are in its cube of side 2^`level`.
fn run(positions: &[Position], level: u32) -> usize {
    let first = positions[0];
    let same = |p: &&Position| (0..3).all(|axis| (p[axis] ^ first[axis]) >> level == 0);
    positions.iter().take_while(same).count()
}
