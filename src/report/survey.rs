//! The pass over all positions, after the last stage, that measures what the reduction did: planes
//! per report tile and over the scan, and deviations of what was removed.
//!
//! A tile is walked twice, and so is the scan: moments first, then distances to the fitted planes.
//!
//! ```text
//! ScanSurvey::new(bounds)                     per thread; merged
//!   per tile: ScanSurvey::tile(key) ─ add… ─ fit ─ FittedTile ─ measure… ─ finish ─ TileFigures
//!   and ScanSurvey::add for the same positions
//! ScanSurvey::fit ─ FittedScan ─ part ─ measure… ─ merge ─ finish ─ Totals
//! ```

use serde::{Deserialize, Serialize};

use super::deviations::{Deviations, Histogram};
use super::figures::{
    DeviationBin, DeviationFigures, DeviationTotals, Pair, PlaneFigures, TileFigures, Totals,
    world_length, world_point,
};
use super::lot::{Lot, Walked};
use super::moments::{Moments, Plane};
use super::sums::Distances;
use crate::geom::lattice::Lattice;
use crate::point::{Bounds, Position};
use crate::store::{Levels, TileKey};
use crate::{Error, Result};

/// Positions that an occupied report tile holds on average, at least.
const POSITIONS_PER_TILE: u64 = 4096;

/// Positions whose distances are summed together.
const AT_ONCE: usize = 4096;

/// Binary logarithm of the side of report tiles in lattice steps: the smallest for which an
/// occupied one holds 4,096 positions on average. Where none does, the smallest for which they are
/// fewest.
pub fn report_tile_level(levels: &Levels) -> u32 {
    let level = levels.smallest_side(POSITIONS_PER_TILE);
    let fewest = levels.occupied(level);
    (0..level).find(|&j| levels.occupied(j) == fewest).unwrap_or(level)
}

fn no_moments(bounds: &Bounds) -> Pair<Moments> {
    let moments = Moments::for_bounds(bounds);
    Pair { before: moments.clone(), after: moments }
}

fn add_moments(moments: &mut Pair<Moments>, walked: Walked<'_>) {
    let Walked { before, after, lots } = walked;
    moments.before.add_all(before, |i| lots[i].copies);
    moments.after.add_all(after, |i| lots[i].kept);
}

/// The first walk over a report tile: moments of its records before and after the reduction.
#[derive(Debug, Clone)]
pub struct TileSurvey {
    key: TileKey,
    moments: Pair<Moments>,
    deviations: Deviations,
}

impl TileSurvey {
    fn new(key: TileKey, bounds: &Bounds) -> Self {
        TileSurvey { key, moments: no_moments(bounds), deviations: Deviations::default() }
    }

    /// Adds the records at `position`, which is in the cube.
    pub fn add(&mut self, position: Position, lot: Lot) {
        self.add_all(Walked::still(&[position], &[lot]));
    }

    /// Adds the records at `positions`, which are in the cube, each with its lot.
    pub fn add_all(&mut self, walked: Walked<'_>) {
        add_moments(&mut self.moments, walked);
        self.deviations.add_all(walked.before, walked.lots);
    }

    /// Adds what another walk over other records of the same tile saw.
    pub fn merge(&mut self, other: &TileSurvey) {
        self.moments.before.merge(&other.moments.before);
        self.moments.after.merge(&other.moments.after);
        self.deviations.merge(&other.deviations);
    }

    /// Ends the first walk: fits the planes.
    pub fn fit(self) -> FittedTile {
        FittedTile {
            key: self.key,
            distances: PlaneDistances::to(&self.moments),
            moments: self.moments,
            deviations: self.deviations,
        }
    }
}

/// The second walk over a report tile: distances of the same records to its planes.
#[derive(Debug, Clone)]
pub struct FittedTile {
    key: TileKey,
    moments: Pair<Moments>,
    distances: PlaneDistances,
    deviations: Deviations,
}

impl FittedTile {
    /// Adds the records at `position`, as in the first walk.
    pub fn measure(&mut self, position: Position, lot: Lot) {
        self.measure_all(Walked::still(&[position], &[lot]));
    }

    /// Adds the records at `positions`, as in the first walk.
    pub fn measure_all(&mut self, walked: Walked<'_>) {
        self.distances.measure_all(walked);
    }

    /// The tile's figures in world units; its sums go into the totals of `scan`.
    ///
    /// Fails with [`ErrorKind::Internal`](crate::ErrorKind::Internal) if the two walks did not see
    /// the same number of records.
    pub fn finish(self, lattice: &Lattice, scan: &mut ScanSurvey) -> Result<TileFigures> {
        let points = counts(&self.moments);
        check_walks(points, &self.distances.sums)?;
        scan.tiles += 1;
        scan.deviations.merge(&self.deviations);
        if scan.takes_moments_from_tiles() {
            scan.moments.before.absorb(&self.moments.before);
            scan.moments.after.absorb(&self.moments.after);
        }
        scan.tile_distances.before.merge(&self.distances.sums.before);
        scan.tile_distances.after.merge(&self.distances.sums.after);
        Ok(TileFigures {
            corner: lattice.world(self.key.corner),
            points,
            plane: plane_figures(&self.distances.sums, lattice),
            deviation: deviation_figures(&self.deviations, lattice),
        })
    }
}

/// What is summed over the whole scan in its first walk. Surveys of parts of the scan are merged,
/// in any order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScanSurvey {
    bounds: Bounds,
    moments: Pair<Moments>,
    /// Those of the tiles.
    deviations: Deviations,
    /// The same deviations, as the walk over the scan saw them.
    histogram: Histogram,
    /// Removed records that nothing stands for.
    unrepresented: u64,
    tiles: u64,
    tile_distances: Pair<Distances>,
}

impl ScanSurvey {
    /// Bytes that a survey holds, whatever the scan.
    pub const BYTES: u64 = Histogram::BYTES + size_of::<ScanSurvey>() as u64;

    /// A survey of a scan, or of a part of it; `bounds` is the box of the *whole* scan.
    pub fn new(bounds: &Bounds) -> Self {
        ScanSurvey {
            bounds: *bounds,
            moments: no_moments(bounds),
            deviations: Deviations::default(),
            histogram: Histogram::default(),
            unrepresented: 0,
            tiles: 0,
            tile_distances: Pair::default(),
        }
    }

    /// A survey of the report tile `key`; where stages `moved` points, some may have left it.
    pub fn tile(&self, key: TileKey, moved: bool) -> TileSurvey {
        let mut bounds = if moved { self.bounds } else { key.cube() };
        for axis in 0..3 {
            bounds.lo[axis] = bounds.lo[axis].max(self.bounds.lo[axis]);
            bounds.hi[axis] = bounds.hi[axis].min(self.bounds.hi[axis]);
        }
        TileSurvey::new(key, &bounds)
    }

    /// Adds the records at `position`, which is in the bounds and also added to its tile.
    pub fn add(&mut self, position: Position, lot: Lot) {
        self.add_all(Walked::still(&[position], &[lot]));
    }

    /// Adds the records at `positions`, which are in the bounds and also added to their tile.
    pub fn add_all(&mut self, walked: Walked<'_>) {
        if !self.takes_moments_from_tiles() {
            add_moments(&mut self.moments, walked);
        }
        for lot in walked.lots {
            match (lot.removed(), lot.deviation) {
                (0, _) => {}
                (removed, None) => self.unrepresented += u64::from(removed),
                (removed, Some(deviation)) => self.histogram.add(deviation, removed),
            }
        }
    }

    /// Exact moments of tiles are those of the scan but for the origin, which saves a sum per
    /// record. Where the scan is so large that its moments are rounded, every position adds its
    /// own.
    fn takes_moments_from_tiles(&self) -> bool {
        self.moments.before.is_exact()
    }

    /// Adds what was summed over another part of the scan.
    pub fn merge(&mut self, other: &ScanSurvey) {
        self.moments.before.merge(&other.moments.before);
        self.moments.after.merge(&other.moments.after);
        self.deviations.merge(&other.deviations);
        self.histogram.merge(&other.histogram);
        self.unrepresented += other.unrepresented;
        self.tiles += other.tiles;
        self.tile_distances.before.merge(&other.tile_distances.before);
        self.tile_distances.after.merge(&other.tile_distances.after);
    }

    /// Ends the first walk: fits the planes of the scan.
    pub fn fit(self) -> FittedScan {
        let distances = PlaneDistances::to(&self.moments);
        FittedScan { survey: self, distances }
    }
}

/// The scan after its first walk. The second is made in parts, one for each thread, that are
/// merged.
#[derive(Debug, Clone)]
pub struct FittedScan {
    survey: ScanSurvey,
    distances: PlaneDistances,
}

impl FittedScan {
    /// An empty part of the second walk.
    pub fn part(&self) -> PlaneDistances {
        PlaneDistances { planes: self.distances.planes, sums: Pair::default() }
    }

    /// Adds the sums of a part of the second walk.
    pub fn merge(&mut self, part: &Pair<Distances>) {
        self.distances.sums.before.merge(&part.before);
        self.distances.sums.after.merge(&part.after);
    }

    /// The deviations of all removed records in world units, in ascending order.
    pub fn bins(&self, lattice: &Lattice) -> Vec<DeviationBin> {
        let bin = |(to, points)| DeviationBin { to: world_length(to, lattice), points };
        self.survey.histogram.eighths().map(bin).collect()
    }

    /// The totals in world units, but for the baseline, which a pass measures.
    ///
    /// Fails with [`ErrorKind::Internal`](crate::ErrorKind::Internal) if the walks over the scan
    /// and its tiles did not see the same number of records, or a stage reported a deviation that
    /// is no number.
    pub fn finish(self, lattice: &Lattice) -> Result<Totals> {
        let FittedScan { survey, distances } = self;
        let points = counts(&survey.moments);
        check_walks(points, &distances.sums)?;
        check_walks(points, &survey.tile_distances)?;
        check_removed(points, &survey)?;
        Ok(Totals {
            tiles: survey.tiles,
            points,
            tile_plane: plane_figures(&survey.tile_distances, lattice),
            scan_plane: plane_figures(&distances.sums, lattice),
            deviation: deviation_totals(&survey.deviations, &survey.histogram, lattice),
            baseline: None,
        })
    }
}

/// Distances of records to the planes fitted before and after the reduction.
#[derive(Debug, Clone)]
pub struct PlaneDistances {
    planes: Pair<Option<Plane>>,
    sums: Pair<Distances>,
}

impl PlaneDistances {
    fn to(moments: &Pair<Moments>) -> Self {
        let planes =
            Pair { before: Plane::fit(&moments.before), after: Plane::fit(&moments.after) };
        PlaneDistances { planes, sums: Pair::default() }
    }

    /// What was measured.
    pub fn sums(&self) -> &Pair<Distances> {
        &self.sums
    }

    /// Adds the records at `position`, as in the first walk.
    pub fn measure(&mut self, position: Position, lot: Lot) {
        self.measure_all(Walked::still(&[position], &[lot]));
    }

    /// Adds the records at `positions`, as in the first walk.
    pub fn measure_all(&mut self, walked: Walked<'_>) {
        let lots = walked.lots.chunks(AT_ONCE);
        let places = walked.before.chunks(AT_ONCE).zip(walked.after.chunks(AT_ONCE));
        for ((before, after), lots) in places.zip(lots) {
            if let Some(plane) = &self.planes.before {
                let each = before.iter().zip(lots);
                self.sums.before.add_all(each.map(|(&p, lot)| (plane.distance(p), lot.copies)));
            }
            if let Some(plane) = &self.planes.after {
                let kept = after.iter().zip(lots).filter(|(_, lot)| lot.kept > 0);
                self.sums.after.add_all(kept.map(|(&p, lot)| (plane.distance(p), lot.kept)));
            }
        }
    }
}

fn counts(moments: &Pair<Moments>) -> Pair<u64> {
    Pair { before: moments.before.count(), after: moments.after.count() }
}

fn check_walks(points: Pair<u64>, measured: &Pair<Distances>) -> Result<()> {
    let second = Pair { before: measured.before.count(), after: measured.after.count() };
    if second == points {
        return Ok(());
    }
    Err(Error::internal(format!(
        "the walks of the survey differ: {} records before and {} after the reduction in the \
         first, {} and {} in the second",
        points.before, points.after, second.before, second.after
    )))
}

fn check_removed(points: Pair<u64>, survey: &ScanSurvey) -> Result<()> {
    let undefined = survey.deviations.undefined();
    if undefined > 0 {
        return Err(Error::internal(format!(
            "{undefined} removed records have a deviation that is no number"
        )));
    }
    let removed = survey.histogram.count() + survey.unrepresented;
    if points.after.checked_add(removed) == Some(points.before) {
        return Ok(());
    }
    Err(Error::internal(format!(
        "the survey of the scan and those of its tiles differ: {} records before and {} after the \
         reduction, but {removed} removed",
        points.before, points.after
    )))
}

fn plane_figures(sums: &Pair<Distances>, lattice: &Lattice) -> Pair<Option<PlaneFigures>> {
    let figures = |sums: &Distances| {
        Some(PlaneFigures { rms: sums.rms()? * lattice.step, mean: sums.mean()? * lattice.step })
    };
    Pair { before: figures(&sums.before), after: figures(&sums.after) }
}

fn deviation_figures(deviations: &Deviations, lattice: &Lattice) -> Option<DeviationFigures> {
    let (largest, at) = deviations.largest()?;
    Some(DeviationFigures {
        points: deviations.count(),
        rms: deviations.rms()? * lattice.step,
        max: world_length(largest, lattice),
        at: world_point(at, lattice),
    })
}

fn deviation_totals(
    deviations: &Deviations,
    histogram: &Histogram,
    lattice: &Lattice,
) -> Option<DeviationTotals> {
    let DeviationFigures { points, rms, max, at } = deviation_figures(deviations, lattice)?;
    // The upper edge of the last bin lies beyond the largest deviation.
    let percentile = |percent| Some(world_length(histogram.percentile(percent)?, lattice).min(max));
    Some(DeviationTotals {
        points,
        rms,
        p50: percentile(50)?,
        p95: percentile(95)?,
        p99: percentile(99)?,
        max,
        at,
    })
}
