//! How far the positions of the original are from the surface of the reduced scan, tile by tile.
//!
//! A tile asks the surface points around it. How far around is enough is not known before they are
//! found: whoever finds its last one farther away than the nearest place that was not looked at
//! asks again, farther around.

use std::sync::{Arc, Mutex};

use super::planes::{RemovedPoint, SurfacePlanes};
use super::reduced::Reduced;
use crate::geom::morton::morton_cmp;
use crate::geom::nearest::NearestAmong;
use crate::geom::simd::Simd;
use crate::host::lock;
use crate::point::{Bounds, Position, distance2, names};
use crate::quantity::Length;
use crate::report::Tally;
use crate::report::deviations::MeasuredDeviations;
use crate::stage::{Lattice, Needs, ScanFacts, TileOp};
use crate::tile::Tile;
use crate::{Error, Result};

/// The surface at a position is the plane of so many surface points, the nearest; those that are as
/// near as the last are among them.
const SURFACE: usize = 8;
/// Surface points that are asked first: one more than those whose plane is the surface tells
/// whether others are as near as the last.
const ASKED: usize = SURFACE + 1;
/// Points of a block of the surface.
const BLOCK: usize = 256;
/// Bytes a position of a tile.
const BYTES: usize = 160;
/// Removed positions are within so many of the largest spacing of the points that they ask.
const SPACINGS: f64 = 4.0;

/// DistanceFigures of removed positions, in lattice steps.
#[derive(Debug, Clone, Default)]
pub(super) struct SurfaceMeasured {
    pub surface: MeasuredDeviations,
    pub nearest: MeasuredDeviations,
    /// Positions that are farther from the surface than the tolerance, or from the nearest point
    /// than the largest spacing.
    pub beyond: u64,
    pub apart: u64,
    /// What was asked for, in the scan's unit.
    pub tolerance: Option<f64>,
    pub max_spacing: Option<f64>,
    /// Where the scan is.
    pub lattice: Option<Lattice>,
}

impl SurfaceMeasured {
    fn merge(&mut self, other: &SurfaceMeasured) {
        self.surface.merge(&other.surface);
        self.nearest.merge(&other.nearest);
        self.beyond += other.beyond;
        self.apart += other.apart;
    }
}

/// Measures every position of the original that the reduced scan does not have.
pub(super) struct MeasureSurface {
    pub reduced: Arc<Reduced>,
    pub tolerance: Option<Length>,
    pub max_spacing: Option<Length>,
    pub measured: Arc<Mutex<SurfaceMeasured>>,
    pub known: Option<KnownSurface>,
}

/// The reduced scan on the lattice of the original.
pub(super) struct KnownSurface {
    /// All positions of it, in Morton order.
    kept: Vec<Position>,
    /// Those of surface points, and the boxes of every 256 of them.
    surface: Vec<Position>,
    boxes: Vec<Bounds>,
    bounds: Bounds,
    /// About how far from each other they are.
    spacing: i64,
    /// In lattice steps.
    tolerance: f64,
    max_spacing: f64,
}

impl KnownSurface {
    fn of(stage: &MeasureSurface, scan: &ScanFacts<'_>) -> Result<KnownSurface> {
        let place = |world: [f64; 3]| {
            let misplaced = || Error::internal("a reduced point has no place on the lattice");
            scan.lattice.nearest(world).ok_or_else(misplaced)
        };
        let (mut kept, mut surface) = (Vec::new(), Vec::new());
        for (world, is_surface) in &stage.reduced.points {
            let p = place(*world)?;
            kept.push(p);
            if *is_surface {
                surface.push(p);
            }
        }
        for positions in [&mut kept, &mut surface] {
            positions.sort_unstable_by(morton_cmp);
            positions.dedup();
        }
        let boxes: Vec<Bounds> =
            surface.chunks(BLOCK).map(|block| Bounds::of(block.iter().copied())).collect();
        let bounds = boxes.iter().fold(Bounds::EMPTY, |all, one| all.union(one));
        let longest = scan.bounds.extent().into_iter().max().unwrap_or(0) as f64;
        let spacing = longest / (surface.len() as f64).sqrt().max(1.0);
        let steps = |length: Option<Length>| {
            length.map_or(f64::INFINITY, |length| length.value() / scan.lattice.step)
        };
        Ok(KnownSurface {
            kept,
            surface,
            boxes,
            bounds,
            spacing: spacing.min(1e17) as i64 + 1,
            tolerance: steps(stage.tolerance),
            max_spacing: steps(stage.max_spacing),
        })
    }

    /// The surface points in `region`.
    fn near(&self, region: &Bounds, near: &mut Vec<Position>) {
        near.clear();
        for (block, bounds) in self.surface.chunks(BLOCK).zip(&self.boxes) {
            if region.holds(bounds) {
                near.extend_from_slice(block);
            } else if region.meets(bounds) {
                near.extend(block.iter().filter(|p| region.contains(**p)));
            }
        }
    }

    /// The positions of `core`, in Morton order, that are not kept.
    fn removed(&self, core: &[Position]) -> Vec<Position> {
        let Some(first) = core.first() else { return Vec::new() };
        let begin = self.kept.partition_point(|p| morton_cmp(p, first).is_lt());
        let mut kept = self.kept[begin..].iter().peekable();
        let mut removed = Vec::new();
        for p in core {
            while kept.next_if(|q| morton_cmp(q, p).is_lt()).is_some() {}
            if kept.peek() != Some(&p) {
                removed.push(*p);
            }
        }
        removed
    }

    /// Measures positions around `cube`.
    fn measure(
        &self,
        cube: &Bounds,
        mut asking: Vec<Position>,
        simd: Simd,
        measured: &mut SurfaceMeasured,
    ) {
        let (mut around, mut asked) = (self.spacing.saturating_mul(4), ASKED);
        let within = SPACINGS * self.max_spacing;
        let (mut near, mut nearest) = (Vec::new(), NearestAmong::with(simd));
        let mut planes = SurfacePlanes::with(simd);
        let mut enter = |asked: RemovedPoint, off: f64| self.enter(asked, off, measured);
        while !asking.is_empty() {
            let region = cube.grown(around);
            self.near(&region, &mut near);
            let is_all = region.holds(&self.bounds);
            let to_edge = (around.unsigned_abs() as u128).pow(2);
            let enough = asked.min(self.surface.len());
            // What was too little: as many points, or how far around they were looked for.
            let (mut open, mut is_tied, mut is_near) = (Vec::new(), false, false);
            nearest.search(&near, &asking, asked, |i, found| {
                let p = asking[i];
                let at = |j: &u32| near[*j as usize];
                let last = found.last().map_or(u128::MAX, |j| distance2(at(j), p));
                let is_proven = is_all || found.len() == enough && last < to_edge;
                // As near as the last of those whose plane it is.
                let tied = found
                    .iter()
                    .skip(SURFACE)
                    .take_while(|j| distance2(at(j), p) == distance2(at(&found[SURFACE - 1]), p));
                let used = found.len().min(SURFACE + tied.count());
                let may_be_more = used == asked && asked < self.surface.len();
                if may_be_more || !is_proven {
                    is_tied |= may_be_more;
                    is_near |= !is_proven;
                    open.push(p);
                    return;
                }
                let far = |j: &u32| (distance2(at(j), p) as f64).sqrt();
                let to_nearest = found.first().map_or(f64::INFINITY, far);
                let used = match within.is_finite() {
                    true => found[..used].partition_point(|j| far(j) <= within),
                    false => used,
                };
                planes.push((p, to_nearest), found[..used].iter().map(at), &mut enter);
            });
            open.sort_unstable_by(morton_cmp);
            asking = open;
            around = if is_near { around.saturating_mul(3) } else { around };
            asked = if is_tied { 4 * asked } else { asked };
        }
        planes.flush(enter);
    }

    /// Enters how far a position is from the surface.
    fn enter(&self, (p, nearest): RemovedPoint, off: f64, measured: &mut SurfaceMeasured) {
        measured.beyond += u64::from(off > self.tolerance);
        measured.apart += u64::from(nearest > self.max_spacing);
        if nearest.is_finite() {
            measured.surface.add(off as f32, p, 1);
            measured.nearest.add(nearest as f32, p, 1);
        }
    }
}

impl TileOp for MeasureSurface {
    fn needs(&self) -> Needs {
        Needs::none().looks_at(names::XYZ).bytes_per_point(BYTES)
    }

    fn convert(&mut self, units: &crate::point::Units) -> Result<()> {
        for (length, key) in [
            (&mut self.tolerance, "verify.tolerance"),
            (&mut self.max_spacing, "verify.max_spacing"),
        ] {
            *length = length.map(|length| length.in_scan(units, key)).transpose()?;
        }
        Ok(())
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        self.known = Some(KnownSurface::of(self, scan)?);
        let mut measured = lock(&self.measured);
        measured.lattice = Some(scan.lattice.clone());
        measured.tolerance = self.tolerance.map(Length::value);
        measured.max_spacing = self.max_spacing.map(Length::value);
        Ok(())
    }

    fn run(&self, tile: &mut Tile, _: &mut Tally) -> Result<()> {
        let early = || Error::internal("a surface is measured before it is known");
        let known = self.known.as_ref().ok_or_else(early)?;
        let mut measured = SurfaceMeasured::default();
        let removed = known.removed(&tile.positions[tile.core.clone()]);
        known.measure(&tile.cube, removed, tile.simd(), &mut measured);
        lock(&self.measured).merge(&measured);
        Ok(())
    }
}
