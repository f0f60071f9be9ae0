//! What a voxel grid of as many points would have left, where what is removed is measured by the
//! surface of the nearest kept points: the same distances to the surface of the grid's points, of
//! each cube the position nearest to the centre.
//!
//! A grid of any side is chosen from a look at all positions of its cubes, so it is measured in
//! some octree nodes, a few sides wide, which are chosen by their corners alone. Around each lie
//! the cubes that its positions ask, so a node tells the same whatever else is measured. How many
//! points a side leaves is known at powers of two; between them it follows from the same nodes, in
//! which both are counted.

use serde::{Deserialize, Serialize};

use super::deviations::MeasuredDeviations;
use super::figures::{BaselineFigures, world_length};
use crate::geom::hash::of_position;
use crate::geom::lattice::Lattice;
use crate::geom::nearest::Nearest;
use crate::geom::simd::Simd;
use crate::geom::surface::{ASKED_RADII, ask_surface};
use crate::point::{Bounds, Position, center_distance2};
use crate::store::{Levels, TileKey, morton_cmp};

/// Sides of the grid that a node is wide at least; less than twice as many at most.
const ACROSS: f64 = 6.0;
/// Positions in the nodes that are looked at, and such nodes, that are enough for figures of the
/// whole scan.
const ENOUGH: (f64, f64) = (262_144.0, 512.0);
/// For so many nodes no more is looked at than this part of a large scan, or so many positions.
const MOST: (f64, f64) = (0.25, 1_048_576.0);
/// Nodes at most.
const MOST_NODES: f64 = 8192.0;
/// Positions that are enough to measure.
const MEASURED: f64 = 131_072.0;
/// By which hashes nodes and positions are chosen.
const SEEDS: (u64, u64) = (0x6e6f_6465, 0x706f_696e);
/// The side that is told by the nodes is not farther from the one between powers of two.
const CORRECTED: f64 = 1.25;
/// Sides around a node in which its positions' grid points are, each with all of its cube.
const REACH: i64 = ASKED_RADII + 1;
/// Positions that are measured together.
const TOGETHER: usize = 4096;

/// Which octree nodes and positions are looked at: a function of the scan's positions.
#[derive(Debug, Clone, Copy)]
pub struct VoxelSample {
    /// Binary logarithm of the side of the nodes.
    pub level: u32,
    /// Hashes of nodes, and of the positions that are measured in them, up to these.
    nodes: u64,
    positions: u64,
}

impl VoxelSample {
    /// For a grid of about `side` steps, at least 1, over positions that occupy these `levels`.
    pub fn of(side: f64, levels: &Levels) -> VoxelSample {
        let wide = (side * ACROSS).clamp(1.0, (1u64 << 62) as f64) as u64;
        let level = wide.next_power_of_two().ilog2();
        let positions = levels.positions().max(1) as f64;
        let occupied = levels.occupied(level).max(1) as f64;
        let most = MOST.0.max(MOST.1 / positions);
        let nodes = (ENOUGH.1 / occupied).min(most).max(ENOUGH.0 / positions);
        let nodes = nodes.min(MOST_NODES / occupied).min(1.0);
        let share = MEASURED / (positions * nodes);
        VoxelSample { level, nodes: most_of(nodes), positions: most_of(share) }
    }

    /// True if the node is looked at.
    pub fn takes(&self, node: &TileKey) -> bool {
        of_position(SEEDS.0, node.corner) <= self.nodes
    }
}

/// The largest hash of that share of all.
fn most_of(share: f64) -> u64 {
    if share >= 1.0 { u64::MAX } else { (share * 2f64.powi(64)) as u64 }
}

/// How many cubes are occupied in nodes: of the powers of two on both sides of a grid's, and of the
/// grid.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct VoxelCounts {
    below: u64,
    above: u64,
    grid: u64,
}

impl VoxelCounts {
    /// Those of a node that has so many points of the grid.
    pub fn of_grid(grid: u64) -> VoxelCounts {
        VoxelCounts { grid, ..VoxelCounts::default() }
    }

    /// Counts the cubes for a grid of about `side` steps that position `p` of a node is the first
    /// of, where `before` is the one before it in Morton order.
    pub fn take(&mut self, side: i64, before: Option<Position>, p: Position) {
        let power = side.unsigned_abs().max(1).ilog2();
        let is_first = |level: u32| {
            let cube = TileKey::around(p, level);
            before.is_none_or(|before| TileKey::around(before, level) != cube)
        };
        self.below += u64::from(is_first(power));
        self.above += u64::from(is_first(power + 1));
    }

    /// Adds those of other nodes.
    pub fn add(&mut self, other: VoxelCounts) {
        self.below += other.below;
        self.above += other.above;
        self.grid += other.grid;
    }

    /// The side in steps of the grid that keeps `keeps` of all positions, where these counts are
    /// for the side `about`: what it keeps of the scan lies between the powers of two as it does in
    /// the nodes.
    pub fn side(&self, about: i64, keeps: u64, levels: &Levels) -> i64 {
        let log = |count: u64| libm::log(count as f64);
        let power = about.unsigned_abs().max(1).ilog2();
        let (most, fewest) = (levels.occupied(power), levels.occupied(power + 1));
        if self.grid == 0 || self.below <= self.above || most <= fewest || keeps == 0 {
            return about;
        }
        let part = (log(self.below) - log(self.grid)) / (log(self.below) - log(self.above));
        let octave = log(most) - log(fewest);
        let grid = log(most) - part * octave;
        let by = libm::exp2((grid - log(keeps)) / octave).clamp(1.0 / CORRECTED, CORRECTED);
        ((about as f64 * by).round() as i64).max(1)
    }
}

/// A node and the points of the grid in it and around it; its memory stays from node to node.
#[derive(Debug, Default)]
pub struct VoxelNode {
    node: Bounds,
    side: i64,
    /// Along each axis the first cube and how many there are.
    first: [i64; 3],
    across: [usize; 3],
    /// For each cube the number of its point and 1, or 0.
    slots: Vec<u32>,
    points: Vec<Position>,
    /// Positions that wait to be measured, and how many records each has.
    asking: Vec<Position>,
    copies: Vec<u32>,
}

/// Cubes along each axis in a node and around it, at most: of the shortest side for the widest
/// node, and one that a face cuts.
const MOST_ACROSS: usize = (2.0 * ACROSS * CORRECTED) as usize + 2 * REACH as usize + 1;

impl VoxelNode {
    /// Bytes that it holds at most: for each cube a slot and a point, which grow by doubling, as
    /// they are searched; and positions that wait.
    pub const BYTES: usize = MOST_ACROSS.pow(3)
        * (size_of::<u32>() + 3 * size_of::<Position>() / 2 + Nearest::BYTES_PER_POINT)
        + TOGETHER * (2 * size_of::<Position>() + 4 * size_of::<u32>() + Nearest::BYTES_PER_POINT)
        + Nearest::FIXED_BYTES;

    /// Begins with a node and the cubes of `side` steps of which it holds something, or those with
    /// what its positions ask if it `measures`. Where their positions are.
    pub fn begin(&mut self, node: &TileKey, side: i64, measures: bool) -> Bounds {
        let side = side.max(1);
        let reach = if measures { REACH } else { 1 };
        (self.node, self.side) = (node.cube(), side);
        let around = self.node.grown(side.saturating_mul(reach));
        self.first = around.lo.map(|v| v.div_euclid(side));
        self.across = std::array::from_fn(|axis| {
            (around.hi[axis].div_euclid(side) - self.first[axis]) as usize + 1
        });
        self.slots.clear();
        self.slots.resize(self.across.iter().product(), 0);
        self.points.clear();
        around
    }

    /// Takes a position around the node; all come in Morton order, once each.
    pub fn take(&mut self, p: Position) {
        let cube: [i64; 3] = p.map(|v| v.div_euclid(self.side));
        let [x, y, z] = [0, 1, 2].map(|axis| (cube[axis] - self.first[axis]) as usize);
        let slot = &mut self.slots[(z * self.across[1] + y) * self.across[0] + x];
        let corner = cube.map(|v| v * self.side);
        let from_center = |p: Position| center_distance2(p, corner, self.side);
        match slot.checked_sub(1) {
            None => {
                self.points.push(p);
                *slot = self.points.len() as u32;
            }
            Some(there) => {
                let there = &mut self.points[there as usize];
                if from_center(p) < from_center(*there) {
                    *there = p;
                }
            }
        }
    }

    /// All positions were taken. How many of the grid's points are in the node.
    pub fn end(&mut self) -> u64 {
        self.points.sort_unstable_by(morton_cmp);
        self.points.iter().filter(|p| self.node.contains(**p)).count() as u64
    }

    /// Measures a position of the node with so many records behind [`end`](VoxelNode::end), or lets
    /// it wait for others, if it is one of the sample.
    pub fn ask(
        &mut self,
        sample: &VoxelSample,
        (p, copies): (Position, u32),
        simd: Simd,
        sum: &mut MeasuredDeviations,
    ) {
        if of_position(SEEDS.1, p) <= sample.positions {
            self.asking.push(p);
            self.copies.push(copies);
            if self.asking.len() >= TOGETHER {
                self.flush(simd, sum);
            }
        }
    }

    /// Measures those that wait.
    pub fn flush(&mut self, simd: Simd, sum: &mut MeasuredDeviations) {
        let within = self.side.saturating_mul(ASKED_RADII);
        ask_surface(simd, &self.points, &self.asking, within, |i, told| {
            // Copies of what is kept are on it.
            let removed = self.copies[i].saturating_sub(u32::from(told.distance2 == 0));
            sum.add(told.off as f32, self.asking[i], removed);
        });
        self.asking.clear();
        self.copies.clear();
    }
}

/// The figures of a grid of `side` steps, of what it removes; none if nothing was measured.
pub fn grid_figures(
    measured: &MeasuredDeviations,
    side: i64,
    lattice: &Lattice,
) -> Option<BaselineFigures> {
    let percentile = |percent: u32| Some(world_length(measured.percentile(percent)?, lattice));
    Some(BaselineFigures {
        side: side as f64 * lattice.step,
        points: measured.deviations.count(),
        rms: measured.deviations.rms()? * lattice.step,
        p50: percentile(50)?,
        p95: percentile(95)?,
        p99: percentile(99)?,
    })
}
