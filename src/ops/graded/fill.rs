//! FILL: keeps positions until none is farther than a distance from one that is kept, and no two of
//! those that it adds are nearer.
//!
//! Positions are visited cube by cube, the cubes by the colours of a checkerboard, in a cube by a
//! hash of the position, and one is kept if nothing kept before is nearer than the distance: dart
//! throwing (Cook 1986) in an order that bounds how far a decision reaches, as
//! `ops/sample/disc.rs` explains. Here the cubes are octree nodes, so the positions of a cube are
//! one stretch of Morton order, and there are points that earlier rounds kept.

use std::collections::HashMap;
use std::ops::Range;

use super::sides::{occupied, share_of};
use crate::geom::hash::{PlaceHashes, of_position};
use crate::point::Position;
use crate::stage::{RoundFound, RoundTile, SoFar};

/// The order of colours: see `ops/sample/disc.rs`.
const COLORS: [usize; 8] = [0b000, 0b010, 0b011, 0b111, 0b110, 0b100, 0b101, 0b001];
/// Sides of cubes from a position to what its fate does not depend on.
const REACHED_CUBES: i64 = 4;

/// A distance to fill to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Filling {
    /// Lattice steps, at least 1 and at most 2^60.
    pub apart: i64,
    /// In which order positions of a cube are visited.
    pub seed: u64,
}

/// Positions that a filling looks at for each cube of its distance that is occupied; all where
/// there are fewer.
const FILLED_FROM: f64 = 64.0;

impl Filling {
    /// The part of all positions that it looks at.
    pub fn looks_at(self, so_far: &SoFar<'_>) -> f64 {
        share_of(FILLED_FROM * occupied(so_far.levels, self.apart as f64), so_far)
    }

    /// Side of the cubes: the power of two that is no smaller than the distance.
    fn side(self) -> i64 {
        1 << self.level()
    }

    fn level(self) -> u32 {
        self.apart.unsigned_abs().next_power_of_two().ilog2()
    }

    /// How far from a tile's cube positions decide about those in it.
    pub fn reach(self) -> i64 {
        REACHED_CUBES.saturating_mul(self.side())
    }

    /// The same of points that are kept.
    pub fn kept_reach(self) -> i64 {
        self.reach().saturating_add(self.apart)
    }

    /// Fills the cube of a tile.
    pub fn fill(self, tile: &RoundTile<'_>, found: &mut RoundFound) {
        let mut filled = Filled::of(self, tile);
        for color in COLORS {
            for cube in 0..filled.cubes.len() {
                if color_of(filled.cubes[cube].place) == color {
                    filled.visit(cube, tile, self.seed);
                }
            }
        }
        filled.keep.retain(|&i| tile.cube.contains(tile.positions[i as usize]));
        filled.keep.sort_unstable();
        found.keep = filled.keep;
    }
}

/// An octree node with positions, and those that are kept of it, new ones behind those of earlier
/// rounds.
struct Cube {
    place: [i64; 3],
    positions: Range<usize>,
    kept: Vec<[f64; 3]>,
}

/// The cubes of a tile on their way.
struct Filled {
    cubes: Vec<Cube>,
    numbers: HashMap<[i64; 3], u32, PlaceHashes>,
    side: i64,
    /// The squared distance.
    apart2: f64,
    keep: Vec<u32>,
    /// Memory to work in: hashes and indices; kept points of the cubes around.
    order: Vec<(u64, u32)>,
    near: Vec<[f64; 3]>,
}

impl Filled {
    fn of(filling: Filling, tile: &RoundTile<'_>) -> Filled {
        let side = filling.side();
        let apart = filling.apart as f64;
        let mut filled = Filled {
            cubes: Vec::new(),
            numbers: HashMap::default(),
            side,
            apart2: apart * apart,
            keep: Vec::new(),
            order: Vec::new(),
            near: Vec::new(),
        };
        let level = filling.level();
        let place = |p: &Position| p.map(|v| v >> level);
        let mut begin = 0;
        for stretch in tile.positions.chunk_by(|a, b| place(a) == place(b)) {
            let positions = begin..begin + stretch.len();
            begin = positions.end;
            let cube = filled.enter(place(&stretch[0]));
            filled.cubes[cube].positions = positions;
        }
        for p in tile.kept {
            let at = place(p);
            let cube = filled.enter(at);
            let offset = filled.offset(at, *p);
            filled.cubes[cube].kept.push(offset);
        }
        filled
    }

    /// The number of the cube at `place`, which it gets if it has none.
    fn enter(&mut self, place: [i64; 3]) -> usize {
        let next = self.cubes.len() as u32;
        let number = *self.numbers.entry(place).or_insert(next);
        if number == next {
            self.cubes.push(Cube { place, positions: 0..0, kept: Vec::new() });
        }
        number as usize
    }

    /// From the corner of the cube at `place`: differences of such offsets are those of the
    /// positions, rounded in the same way for whoever looks.
    fn offset(&self, place: [i64; 3], p: Position) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let corner = place[axis].saturating_mul(self.side);
            p[axis].saturating_sub(corner) as f64
        })
    }

    /// Keeps positions of a cube. Of cubes that are not visited yet only points of earlier rounds
    /// are kept.
    fn visit(&mut self, cube: usize, tile: &RoundTile<'_>, seed: u64) {
        let Cube { place, ref positions, .. } = self.cubes[cube];
        if positions.is_empty() {
            return;
        }
        self.near.clear();
        for by in AROUND {
            let other: [i64; 3] = std::array::from_fn(|axis| place[axis] + by[axis]);
            let Some(&other) = self.numbers.get(&other) else { continue };
            let shift = by.map(|cubes| (cubes * self.side) as f64);
            let kept = &self.cubes[other as usize].kept;
            self.near
                .extend(kept.iter().map(|q| std::array::from_fn(|axis| q[axis] + shift[axis])));
        }
        let own = self.near.len();
        self.near.extend(&self.cubes[cube].kept);
        let there = self.near.len();
        self.order.clear();
        for i in positions.clone() {
            let p = self.offset(place, tile.positions[i]);
            if !self.is_near(p) {
                self.order.push((of_position(seed, tile.positions[i]), i as u32));
            }
        }
        self.order.sort_unstable();
        for at in 0..self.order.len() {
            let i = self.order[at].1;
            let p = self.offset(place, tile.positions[i as usize]);
            // Those that were there are far enough.
            if self.near[there..].iter().all(|q| distance2(*q, p) >= self.apart2) {
                self.near.push(p);
                self.keep.push(i);
            }
        }
        self.cubes[cube].kept = self.near.split_off(own);
    }

    fn is_near(&self, p: [f64; 3]) -> bool {
        self.near.iter().any(|q| distance2(*q, p) < self.apart2)
    }
}

fn distance2(a: [f64; 3], b: [f64; 3]) -> f64 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    x * x + y * y + z * z
}

fn color_of(place: [i64; 3]) -> usize {
    let [x, y, z] = place.map(|index| (index & 1) as usize);
    x | y << 1 | z << 2
}

/// The steps from a cube to those around it.
const AROUND: [[i64; 3]; 26] = {
    let (mut all, mut n, mut at) = ([[0; 3]; 26], 0, 0);
    while n < 27 {
        if n != 13 {
            all[at] = [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1];
            at += 1;
        }
        n += 1;
    }
    all
};
