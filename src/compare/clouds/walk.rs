//! The nearest points of one scan for all points of another.
//!
//! Points that ask go by stretches of blocks, which lie together. What is asked is loaded from a
//! box around them, as wide as about thrice the distance that points have from each other there; a
//! set of neighbours is proven as that of a tile is, by what of the scan is not loaded. Where the
//! proof fails, the box grows; where it would hold too much, points search for themselves in the
//! index of the whole scan. So the cut into stretches decides about speed alone.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::measured::MeasuredKind;
use super::normals::{MeasuredNormals, NormalPairs};
use crate::Result;
use crate::compare::planes::{RemovedPoint, SurfacePlanes};
use crate::geom::nearest::NearestAmong;
use crate::geom::simd::Simd;
use crate::point::{Bounds, Position, distance2};
use crate::store::{BLOCK, Reader, SealedTiles, first_of_each, morton_cmp};
use crate::tile::{LoadedBox, Remote};

/// The surface at a position is the plane of so many points, the nearest.
const SURFACE: usize = 8;
/// Blocks whose positions ask together.
pub const STRETCH: usize = 64;
/// Positions that are loaded to be asked, at most.
const LOADED: u64 = 1 << 16;
/// How often a box grows.
const GROWN: usize = 12;

/// Distances of the points of a scan, in lattice steps.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasuredCloud {
    /// From the nearest point.
    pub nearest: MeasuredKind,
    /// From the plane of the nearest ones.
    pub plane: MeasuredKind,
    /// Angles between normals; none where they are not compared.
    pub normals: Option<MeasuredNormals>,
}

impl MeasuredCloud {
    /// Adds the distances of other points.
    pub fn merge(&mut self, other: &MeasuredCloud) {
        self.nearest.merge(&other.nearest);
        self.plane.merge(&other.plane);
        if let Some(normals) = &other.normals {
            self.normals.get_or_insert_default().merge(normals);
        }
    }

    /// Enters positions with how far they are from the nearest point, and from a surface.
    fn enter(&mut self, (p, nearest): RemovedPoint, plane: f64, repeated: &[(Position, u32)]) {
        let place = repeated.binary_search_by(|(q, _)| morton_cmp(q, &p));
        let copies = place.map_or(1, |place| repeated[place].1);
        self.nearest.add(nearest, p, copies);
        self.plane.add(plane, p, copies);
    }
}

/// What a thread works with.
pub struct WalkArena {
    measured: MeasuredCloud,
    reader: Reader,
    remote: Remote,
    nearest: NearestAmong,
    planes: SurfacePlanes,
    near: Vec<Position>,
    asking: Vec<Position>,
    /// Positions that ask and have several records.
    repeated: Vec<(Position, u32)>,
    normals: Option<NormalPairs>,
}

impl WalkArena {
    /// Bytes that it holds.
    pub fn bytes(has_normals: bool) -> u64 {
        let positions = LOADED as usize + STRETCH * BLOCK;
        let normals = match has_normals {
            true => NormalPairs::bytes(LOADED as usize, STRETCH * BLOCK),
            false => 0,
        };
        let search = NearestAmong::bytes(LOADED as usize, STRETCH * BLOCK, SURFACE);
        let own = (2 * positions * size_of::<Position>() + search) as u64;
        own + Remote::BYTES + normals + (1 << 20)
    }

    /// All that was measured.
    pub fn all(self) -> MeasuredCloud {
        MeasuredCloud { normals: self.normals.map(|pairs| pairs.measured), ..self.measured }
    }

    /// For searches by this instruction set.
    pub fn with(simd: Simd, has_normals: bool) -> WalkArena {
        WalkArena {
            measured: MeasuredCloud::default(),
            reader: Reader::default(),
            remote: Remote::default(),
            nearest: NearestAmong::with(simd),
            planes: SurfacePlanes::with(simd),
            near: Vec::new(),
            asking: Vec::new(),
            repeated: Vec::new(),
            normals: has_normals.then(NormalPairs::new),
        }
    }
}

/// Two scans on one lattice, of which one is asked for the nearest of its points.
pub struct CloudWalk<'a> {
    pub asking: &'a SealedTiles,
    pub asked: &'a SealedTiles,
}

impl CloudWalk<'_> {
    /// Measures the positions of `blocks`.
    pub fn measure(&self, blocks: Range<usize>, arena: &mut WalkArena) -> Result<()> {
        let all = blocks.clone().map(|block| self.asking.block(block).bounds);
        let bounds = all.fold(Bounds::EMPTY, |all, one| all.union(&one));
        let mut around = self.around(&bounds)?;
        let is_too_much =
            |region: &Bounds, reader: &mut Reader| self.asked.holds_more(region, LOADED, reader);
        let mut region = bounds.grown(around);
        let is_far = is_too_much(&region, &mut arena.reader)?;
        if is_far && blocks.len() > 1 {
            let middle = blocks.start + blocks.len() / 2;
            self.measure(blocks.start..middle, arena)?;
            return self.measure(middle..blocks.end, arena);
        }
        self.ask(blocks, arena)?;
        if !is_far {
            self.search(&region, arena)?;
            for _ in 0..GROWN {
                around = around.saturating_mul(3);
                region = bounds.grown(around);
                if arena.asking.is_empty() || is_too_much(&region, &mut arena.reader)? {
                    break;
                }
                self.search(&region, arena)?;
            }
        }
        self.search_remotely(arena)?;
        let WalkArena { planes, measured, repeated, normals, .. } = arena;
        planes.flush(|asked, plane| measured.enter(asked, plane, repeated));
        normals.iter_mut().try_for_each(|pairs| pairs.measure(self.asking, self.asked))
    }

    /// Has the positions of `blocks` ask.
    fn ask(&self, blocks: Range<usize>, arena: &mut WalkArena) -> Result<()> {
        arena.asking.clear();
        arena.repeated.clear();
        arena.normals.iter_mut().for_each(NormalPairs::begin);
        for block in blocks {
            let first = self.asking.block(block).first_record;
            let (positions, copies) = self.asking.read(block, &mut arena.reader)?;
            arena.normals.iter_mut().for_each(|pairs| pairs.ask(positions, copies, first));
            arena.asking.extend_from_slice(positions);
            let repeated = positions.iter().zip(copies).filter(|(_, copies)| **copies != 1);
            arena.repeated.extend(repeated.map(|(p, copies)| (*p, *copies)));
        }
        Ok(())
    }

    /// Thrice the distance that asked points within `bounds` have from each other, about.
    fn around(&self, bounds: &Bounds) -> Result<i64> {
        let mut spacings = Vec::new();
        self.asked.blocks_meeting(bounds, |block| {
            let block = self.asked.block(block);
            let mut side = block.bounds.extent().map(|v| v as f64);
            side.sort_unstable_by(f64::total_cmp);
            let n = block.len() as f64;
            spacings.push((side[2] * side[1] / n).sqrt().max(side[2] / n));
            Ok(())
        })?;
        let middle = spacings.len() / 2;
        let spacing = match spacings.len() {
            0 => bounds.extent().into_iter().max().unwrap_or(0) as f64,
            _ => *spacings.select_nth_unstable_by(middle, f64::total_cmp).1,
        };
        Ok((3.0 * spacing).min(1e17) as i64 + 1)
    }

    /// Measures those that ask whose neighbours are in `region` for certain; the others go on
    /// asking.
    fn search(&self, region: &Bounds, arena: &mut WalkArena) -> Result<()> {
        let WalkArena {
            measured, reader, nearest, planes, near, asking, repeated, normals, ..
        } = arena;
        near.clear();
        normals.iter_mut().for_each(|pairs| pairs.near.clear());
        self.asked.blocks_meeting(region, |block| {
            let is_whole = region.holds(&self.asked.block(block).bounds);
            let (positions, copies) = self.asked.read(block, reader)?;
            if let Some(pairs) = normals {
                let records = first_of_each(self.asked.block(block).first_record, copies);
                let near = positions.iter().zip(records);
                let near = near.filter(|(p, _)| is_whole || region.contains(**p));
                pairs.near.extend(near.map(|(_, record)| record));
            }
            match is_whole {
                true => near.extend_from_slice(positions),
                false => near.extend(positions.iter().filter(|p| region.contains(**p))),
            }
            Ok(())
        })?;
        let scan = self.asked.bounds();
        let (loaded, is_all) = (LoadedBox::of(&scan, *region), region.holds(&scan));
        let mut open = Vec::new();
        nearest.search(near, asking, SURFACE, |i, found| {
            let p = asking[i];
            let at = |j: &u32| near[*j as usize];
            let farthest = found.last().map_or(u128::MAX, |j| distance2(at(j), p));
            // Where it is itself, nothing else is looked at.
            let is_shared = found.first().is_some_and(|j| at(j) == p);
            if is_shared || is_all || found.len() == SURFACE && loaded.proves(p, farthest) {
                if let (Some(pairs), Some(j)) = (normals.as_mut(), found.first()) {
                    pairs.enter(p, pairs.near[*j as usize]);
                }
                let mut enter = |asked, plane| measured.enter(asked, plane, repeated);
                measure(p, found.iter().map(at), planes, &mut enter);
            } else {
                open.push(p);
            }
        });
        open.sort_unstable_by(morton_cmp);
        *asking = open;
        Ok(())
    }

    /// Measures those that still ask, one by one.
    fn search_remotely(&self, arena: &mut WalkArena) -> Result<()> {
        let WalkArena { measured, remote, planes, near, asking, repeated, normals, .. } = arena;
        for &p in asking.iter() {
            let found = remote.nearest_to(self.asked, p, SURFACE, near)?;
            let mut enter = |asked, plane| measured.enter(asked, plane, repeated);
            measure(p, found.iter().copied(), planes, &mut enter);
            if let Some(pairs) = normals
                && let Some(record) = remote.record_of_nearest(self.asked)?
            {
                pairs.enter(p, record);
            }
        }
        asking.clear();
        Ok(())
    }
}

/// Calls `enter` for positions that are measured, here or before: with how far they are from the
/// nearest of the points found, and from the plane of all.
fn measure(
    p: Position,
    mut found: impl ExactSizeIterator<Item = Position> + Clone,
    planes: &mut SurfacePlanes,
    mut enter: impl FnMut(RemovedPoint, f64),
) {
    let all = found.clone();
    let Some(first) = found.next() else { return };
    match first == p {
        true => enter((p, 0.0), 0.0),
        false => planes.push((p, (distance2(first, p) as f64).sqrt()), all, enter),
    }
}
