//! From points in Morton order to the nodes of an octree whose every level is a picture of the
//! whole, in one pass and little memory.
//!
//! A node of COPC has points of its own: those that a viewer draws which goes no deeper. They are
//! to be spread evenly, and what is drawn by some levels together, too. The obvious way holds a
//! grid of occupied cells for every node, or goes over the scan once for each level.
//!
//! Here cells hold a contest. A node has 2^7 cells a side; of the points in a cell the one of the
//! smallest rank stands for it: the rank that a reduction gave it, where the records have such, so
//! that a coarse level is a coarse reduction, and behind that a hash of its position. Of the eight
//! cells that make a cell of the next level their winners meet again, so that whoever wins there
//! has won in all cells below. A point belongs to the level whose cells are the largest that it
//! wins. So the levels down to any one together have exactly one point in each occupied cell of
//! that level.
//!
//! In Morton order a cell of any size is a stretch without gaps: it is settled as soon as a point
//! lies outside, so one winner for each size is held, besides the points of the nodes around the
//! present one. Of a surface these are few, as a level more quadruples its points; a scan that is
//! as dense around its scanner on every level fills all of them, and the fullest is stored where
//! they come to more than is held. Nothing that is written depends on that, on tiles, threads or
//! memory.
//!
//! Small nodes cost bytes and requests. A node whose subtree has few points is one leaf, and what
//! would be a node of very few points goes to the one above it.

use super::hierarchy::VoxelKey;
use super::overflow::{NodePiece, Overflow};
use crate::Result;
use crate::geom::morton::morton_cmp;
use crate::io::las::laz::CHUNK_POINTS;
use crate::point::{Bounds, Position};
use crate::store::split_level;

/// Cells along a side of a node, as a power of two: the resolution of viewers.
const CELLS: u32 = 7;
/// Levels below the root at most: places of nodes are counted in 32 bits. Points that are nearer to
/// each other share a node.
const DEEPEST: u32 = 24;
/// A subtree of so many points is one node.
pub const LEAF_POINTS: usize = 1 << 16;
/// Pieces of so many points that the nodes have memory for that may still get points, before the
/// fullest is stored.
const OPEN_PIECES: usize = 7;
/// Pieces that an octree holds at most: those, one that grows, whose memory is there twice for a
/// moment, and nodes that became ripe within a chunk of points, which filled no more than its
/// points do and the doubling of memory leaves empty.
pub const HELD_PIECES: usize = OPEN_PIECES + 1 + 2;
const _: () = assert!(CHUNK_POINTS as usize <= LEAF_POINTS);
/// A node of fewer points below another is part of that.
const FEWEST_POINTS: usize = 1 << 11;

/// The cube of the root.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RootCube {
    /// Its smallest corner.
    pub corner: Position,
    /// Its side is two to this power, in steps of the lattice.
    pub exponent: u32,
}

impl RootCube {
    /// The cube around `bounds`. Its eight children are cubes of Morton order: one cube of the
    /// order around all points might be billions of times as large as they need.
    pub fn around(bounds: &Bounds) -> RootCube {
        let spans =
            |half: u32| (0..3).all(|a| (bounds.hi[a] >> half) - (bounds.lo[a] >> half) <= 1);
        let half = (CELLS..62).find(|half| spans(*half)).unwrap_or(62);
        let corner = bounds.lo.map(|at| (at >> half) << half);
        RootCube { corner, exponent: half + 1 }
    }

    /// True if `position` is inside.
    fn holds(&self, position: Position) -> bool {
        let inside = |axis: usize| (position[axis] - self.corner[axis]) >> self.exponent == 0;
        (0..3).all(inside)
    }

    /// The node of side two to the power `exponent` that holds `position`.
    fn key(&self, exponent: u32, position: Position) -> VoxelKey {
        let at = |axis: usize| ((position[axis] - self.corner[axis]) >> exponent) as i32;
        VoxelKey { level: (self.exponent - exponent) as i32, at: [at(0), at(1), at(2)] }
    }

    /// Steps between the cells of the root.
    pub fn spacing(&self) -> i64 {
        1 << (self.exponent - CELLS)
    }
}

/// A node whose points are known.
#[derive(Debug)]
pub struct RipeNode {
    /// Which node it is.
    pub key: VoxelKey,
    /// Its records, in pieces: all but the last have [`LEAF_POINTS`].
    pub pieces: Vec<NodePiece>,
}

/// The winner of a cell.
#[derive(Debug, Clone, Copy)]
struct Winner {
    rank: u64,
    slot: usize,
}

/// A node that may still get points.
#[derive(Debug, Default)]
struct OpenNode {
    /// Its own points.
    own: NodePiece,
    /// Earlier ones, in whole pieces.
    full: Vec<NodePiece>,
    /// Nodes below it that become part of it if they are few.
    children: Vec<(VoxelKey, NodePiece)>,
    /// Bytes of these.
    below: usize,
    /// True if there are nodes below it.
    is_inner: bool,
}

impl OpenNode {
    /// Bytes of memory that it has.
    fn held(&self) -> usize {
        self.own.held() + self.children.iter().map(|(_, below)| below.held()).sum::<usize>()
    }
}

/// An octree that grows by points in Morton order.
pub struct Octree {
    root: RootCube,
    stride: usize,
    last: Option<Position>,
    /// Winners of the open cells, by the exponents of their sides.
    winners: Vec<Option<Winner>>,
    slots: Vec<u8>,
    free: Vec<usize>,
    /// The exponent of the side of the smallest node.
    smallest: u32,
    /// The nodes around the last point, by the exponents of their sides from the smallest on.
    open: Vec<OpenNode>,
    ripe: Vec<RipeNode>,
    /// Bytes of memory that open nodes have at most.
    most_held: usize,
    overflow: Overflow,
}

impl Octree {
    /// Without a point; records have `stride` bytes, and what is not held goes to `overflow`.
    pub fn new(root: RootCube, stride: usize, overflow: Overflow) -> Self {
        let smallest = root.exponent.saturating_sub(DEEPEST).max(CELLS);
        let nodes = root.exponent - smallest + 1;
        Octree {
            root,
            stride,
            last: None,
            winners: vec![None; (root.exponent - CELLS + 1) as usize],
            slots: Vec::new(),
            free: Vec::new(),
            smallest,
            open: (0..nodes).map(|_| OpenNode::default()).collect(),
            ripe: Vec::new(),
            most_held: OPEN_PIECES * LEAF_POINTS * stride,
            overflow,
        }
    }

    /// Adds a point; it must not come before the last in Morton order. In contests the smallest
    /// rank wins.
    pub fn push(&mut self, position: Position, rank: u64, record: &[u8]) -> Result<()> {
        if let Some(last) = self.last {
            self.close(split_level(last, position).map_or(0, |bit| bit + 1))?;
        }
        self.last = Some(position);
        let slot = self.free.pop().unwrap_or_else(|| {
            self.slots.resize(self.slots.len() + self.stride, 0);
            self.slots.len() / self.stride - 1
        });
        self.slots[slot * self.stride..(slot + 1) * self.stride].copy_from_slice(record);
        self.contest(0, Winner { rank, slot }, 0)
    }

    /// True if no point was added.
    pub fn is_empty(&self) -> bool {
        self.last.is_none()
    }

    /// True if a point may come here: inside of the root, and not before the last.
    pub fn takes(&self, position: Position) -> bool {
        let inside = self.root.holds(position);
        inside && self.last.is_none_or(|last| morton_cmp(&last, &position).is_le())
    }

    /// The nodes that became ripe since this was asked last, in an order that the points decide.
    pub fn ripe(&mut self) -> Vec<RipeNode> {
        std::mem::take(&mut self.ripe)
    }

    /// Closes all nodes.
    pub fn finish(&mut self) -> Result<()> {
        self.close(u64::BITS)?;
        self.close_node(self.open.len() - 1)
    }

    /// Settles cells and nodes with a side below two to the power `bits`: the next point lies
    /// outside.
    fn close(&mut self, bits: u32) -> Result<()> {
        let top = self.winners.len() - 1;
        for cell in 0..(bits as usize).min(top + 1) {
            let Some(winner) = self.winners[cell].take() else { continue };
            let exponent = cell as u32 + CELLS;
            match cell == top {
                true => self.give(winner, exponent)?,
                false => self.contest(cell + 1, winner, exponent)?,
            }
        }
        let closed = bits.saturating_sub(self.smallest) as usize;
        let below_root = self.open.len() - 1;
        (0..closed.min(below_root)).try_for_each(|node| self.close_node(node))
    }

    /// A winner comes to a cell; who loses goes to the node of side two to the power `exponent`.
    fn contest(&mut self, cell: usize, winner: Winner, exponent: u32) -> Result<()> {
        match self.winners[cell] {
            None => {
                self.winners[cell] = Some(winner);
                Ok(())
            }
            // The earlier one where both have a position.
            Some(other) if other.rank <= winner.rank => self.give(winner, exponent),
            Some(other) => {
                self.winners[cell] = Some(winner);
                self.give(other, exponent)
            }
        }
    }

    /// Gives a point to the open node of side two to the power `exponent`.
    fn give(&mut self, winner: Winner, exponent: u32) -> Result<()> {
        let at = winner.slot * self.stride;
        let number = exponent.saturating_sub(self.smallest) as usize;
        let record = &self.slots[at..at + self.stride];
        let grew = self.open[number].own.extend(record, LEAF_POINTS * self.stride);
        self.free.push(winner.slot);
        self.store_full(number, grew)
    }

    /// Closes the open node of this number.
    fn close_node(&mut self, number: usize) -> Result<()> {
        let node = &self.open[number];
        let is_root = number + 1 == self.open.len();
        let bytes = node.own.len() + node.below;
        let is_leaf = !node.is_inner && node.full.is_empty() && bytes <= LEAF_POINTS * self.stride;
        if is_leaf && !is_root && bytes < FEWEST_POINTS * self.stride {
            // The children of so small a node are smaller, and in it already.
            return if bytes == 0 { Ok(()) } else { self.merge_up(number) };
        }
        let Some(last) = self.last else { return Ok(()) };
        let key = self.root.key(number as u32 + self.smallest, last);
        if !is_leaf {
            self.become_inner(number);
        }
        let OpenNode { own, mut full, children, .. } = std::mem::take(&mut self.open[number]);
        let mut records = own;
        records.shrink();
        children.into_iter().for_each(|(_, below)| records.append(below));
        if is_leaf && !is_root {
            self.hand_up(number + 1, key, records);
            return Ok(());
        }
        if !records.is_empty() || full.is_empty() {
            full.push(records);
        }
        self.ripe.push(RipeNode { key, pieces: full });
        if !is_root {
            self.become_inner(number + 1);
        }
        Ok(())
    }

    /// Gives the points of a small leaf to the node above, whose own they become: as a node of
    /// theirs they would cost more than they tell.
    fn merge_up(&mut self, number: usize) -> Result<()> {
        let mut own = std::mem::take(&mut self.open[number].own);
        let above = &mut self.open[number + 1].own;
        if above.is_empty() {
            std::mem::swap(above, &mut own);
        } else {
            let room = LEAF_POINTS * self.stride - above.len();
            let is_held = own.held() >= own.len();
            let records = own.records()?;
            let (first, rest) = records.split_at(records.len().min(room));
            for some in [first, rest] {
                let above = &mut self.open[number + 1].own;
                let grew = above.extend(some, LEAF_POINTS * self.stride);
                self.store_full(number + 1, grew)?;
            }
            own = if is_held { NodePiece::of(records) } else { NodePiece::default() };
        }
        // Keeps its memory for the next.
        own.clear();
        self.open[number].own = own;
        Ok(())
    }

    /// Hands a leaf to the node above, which may take it for its own.
    fn hand_up(&mut self, number: usize, key: VoxelKey, records: NodePiece) {
        let node = &mut self.open[number];
        if node.is_inner {
            self.ripe.push(RipeNode { key, pieces: vec![records] });
            return;
        }
        node.below += records.len();
        node.children.push((key, records));
        if node.below + node.own.len() > LEAF_POINTS * self.stride {
            self.become_inner(number);
        }
    }

    /// The open node of this number has nodes below it: those that waited are such.
    fn become_inner(&mut self, number: usize) {
        let node = &mut self.open[number];
        node.is_inner = true;
        node.below = 0;
        let children = std::mem::take(&mut node.children).into_iter();
        self.ripe.extend(children.map(|(key, below)| RipeNode { key, pieces: vec![below] }));
    }

    /// Stores the points of an open node that has as many as a piece; where its memory `grew`, too,
    /// those of the fullest nodes, as long as all have more than they may.
    fn store_full(&mut self, number: usize, grew: bool) -> Result<()> {
        let node = &mut self.open[number];
        if node.own.len() >= LEAF_POINTS * self.stride {
            let mut piece = std::mem::take(&mut node.own);
            self.overflow.store(&mut piece)?;
            node.full.push(piece);
        }
        while grew && self.open.iter().map(OpenNode::held).sum::<usize>() > self.most_held {
            let Some(fullest) = self.open.iter_mut().max_by_key(|node| node.held()) else { break };
            let children = fullest.children.iter_mut().map(|(_, below)| below);
            [&mut fullest.own]
                .into_iter()
                .chain(children)
                .try_for_each(|piece| self.overflow.store(piece))?;
        }
        Ok(())
    }
}

/// What decides contests: the rank that a reduction gave the point, if it did, and what is as good
/// as random and of a position alone.
pub fn rank(kept: Option<u16>, position: Position) -> u64 {
    let chance = chance(position);
    kept.map_or(chance, |kept| u64::from(kept) << 48 | chance >> 16)
}

fn chance(position: Position) -> u64 {
    let mut z = 0u64;
    for at in position {
        z = (z ^ at as u64).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
    }
    z
}

#[cfg(test)]
mod tests;
