//! The last walk over the decoded scan: what the reduction did to each report tile and to all.
//!
//! Figures of a report must be the same for every memory and number of threads, so they are not
//! gathered while the mill works on tiles of its own: states and fates are stored, and walked once
//! more over report tiles that follow from the scan alone. Sums are the same in whatever order
//! parts of the scan are merged, so each thread keeps one of all that it walked.
//!
//! The walk is made in two phases, since distances to a plane can be summed only when the plane is
//! fitted. Their items are ranges of blocks; a report tile belongs to the range that it begins in.

use bytemuck::pod_read_unaligned;

use super::job::Job;
use super::lines::{LINES_AT_ONCE, RangeLines, TileLines};
use super::moved::is_still;
use crate::budget::Bytes;
use crate::geom::lattice::Lattice;
use crate::point::{Position, SHIFT};
use crate::report::{DeviationBin, FittedScan, Lot, ScanSurvey, Totals, Walked, report_tile_level};
use crate::store::{
    BLOCK, FATE_BYTES, PIECE, Pieces, Reader, RecordState, SealedTiles, Spill, StoredStretch,
    TileKey,
};
use crate::tile::{Fate, Sieve};
use crate::{Error, Result};

const KEPT: f32 = -1.0;
const KEPT_ONCE: f32 = -2.0;
const REMOVED: f32 = -3.0;
/// Blocks that a thread surveys at once.
const BLOCKS: usize = 256;

/// A fate as stored: the deviation, or a negative number for what is kept.
pub(crate) fn fate_code(fate: Fate) -> [u8; FATE_BYTES] {
    match fate {
        Fate::Kept => KEPT,
        Fate::KeptOnce => KEPT_ONCE,
        Fate::Removed => REMOVED,
        Fate::Represented { deviation } => deviation,
    }
    .to_le_bytes()
}

/// The stored fate of a position whose records are up to `apart` steps from each other, because the
/// lattice rounds: where one of them is kept, that is how far the others deviate. Stored as the
/// negative of it, which is never one of the codes above.
pub(crate) fn apart_code(code: [u8; FATE_BYTES], apart: f64) -> [u8; FATE_BYTES] {
    if f32::from_le_bytes(code) != KEPT_ONCE {
        return code;
    }
    let apart = (apart as f32).max(f32::MIN_POSITIVE);
    let taken = [KEPT, KEPT_ONCE, REMOVED].contains(&-apart);
    (if taken { -apart.next_up() } else { -apart }).to_le_bytes()
}

/// How far the removed records of a position are from the surface, by its stored fate: copies of a
/// kept one are on it, unless the lattice rounds; None where nothing stands for them, as for those
/// that took no part.
fn deviation_of(code: [u8; FATE_BYTES]) -> Option<f32> {
    match f32::from_le_bytes(code) {
        REMOVED | KEPT => None,
        KEPT_ONCE => Some(0.0),
        apart if apart < 0.0 => Some(-apart),
        deviation => Some(deviation),
    }
}

/// What was measured.
pub(crate) struct Measured {
    /// Side of the report tiles in world units.
    pub tile_side: f64,
    /// Figures of the scan.
    pub totals: Totals,
    /// Deviations of its removed records.
    pub deviations: Vec<DeviationBin>,
    /// Lines of the report's tiles, in order.
    pub tiles: TileLines,
}

/// Bytes that a thread of a survey holds.
pub(crate) fn survey_bytes() -> Bytes {
    Bytes(2 * (ScanSurvey::BYTES + LINES_AT_ONCE as u64) + KeptBlocks::BYTES)
}

/// Measures, on all threads, the reduction of `tiles` whose positions have the stored fates and
/// whose records have the stored states of `sieve`.
pub(crate) fn survey(
    job: &Job<'_>,
    lattice: &Lattice,
    tiles: &SealedTiles,
    sieve: &Sieve,
) -> Result<Measured> {
    let level = report_tile_level(tiles.levels());
    let missing = || Error::internal("a scan is surveyed that no pass went over");
    let shifts = sieve.columns.iter().find(|(kind, _)| *kind == SHIFT.kind());
    let walk = ScanWalk {
        tiles,
        fates: sieve.fates.as_ref().ok_or_else(missing)?,
        states: sieve.states.as_ref().ok_or_else(missing)?,
        shifts: shifts.map(|(_, pieces)| &**pieces),
        step: lattice.step,
        level,
    };
    let all_threads = survey_bytes() * job.threads.count() as u64;
    let _working = job.budget.lease(all_threads.0, "survey")?;
    let spill = Spill::new(&job.area, "report");
    let (scan, lines) = walk.tally(job, lattice, &spill)?;
    let fitted = walk.measure(job, scan)?;
    Ok(Measured {
        tile_side: (level as f64).exp2() * lattice.step,
        deviations: fitted.bins(lattice),
        totals: fitted.finish(lattice)?,
        tiles: TileLines::new(spill, lines),
    })
}

struct ScanWalk<'a> {
    tiles: &'a SealedTiles,
    fates: &'a Pieces,
    states: &'a Pieces,
    /// How far stages moved each position, if any does.
    shifts: Option<&'a Pieces>,
    /// World units of a lattice step.
    step: f64,
    level: u32,
}

/// A block with the lots of its positions.
#[derive(Default)]
struct Seen {
    block: Option<usize>,
    reader: Reader,
    lots: Vec<Lot>,
    /// Where stages moved the positions; empty if none does.
    moved: Vec<Position>,
}

impl Seen {
    fn walked(&self) -> Walked<'_> {
        let before = self.reader.positions();
        let after = if self.moved.is_empty() { before } else { &self.moved };
        Walked { before, after, lots: &self.lots }
    }

    fn load(&mut self, walk: &ScanWalk<'_>, block: usize, columns: &mut StoredFates) -> Result<()> {
        self.block = None;
        let (positions, copies) = walk.tiles.read(block, &mut self.reader)?;
        let records = copies.iter().map(|&n| u64::from(n)).sum::<u64>();
        let StoredFates { fates, states, shifts, buffer } = columns;
        let first = walk.tiles.block(block).first_position;
        walk.fates.collect(first, positions.len() as u64, buffer, fates)?;
        let fates = fates.as_chunks().0.iter().copied().map(deviation_of);
        self.moved.clear();
        if let Some(pieces) = walk.shifts {
            pieces.collect(first, positions.len() as u64, buffer, shifts)?;
            let each = shifts.chunks_exact(size_of::<[f64; 3]>()).map(pod_read_unaligned);
            self.moved.extend(positions.iter().zip(each).map(|(&p, by)| walk.moved(p, by)));
        }
        let rank = walk.tiles.rank_of_block(block);
        self.lots.clear();
        if records == positions.len() as u64 {
            walk.states.collect(rank, records, buffer, states)?;
            self.lots.extend(fates.zip(&*states).map(|(deviation, &state)| {
                let kept = RecordState(state).is_alive().into();
                Lot { copies: 1, kept, deviation }
            }));
        } else {
            let unkept = |(&copies, deviation)| Lot { copies, kept: 0, deviation };
            self.lots.extend(copies.iter().zip(fates).map(unkept));
            let (mut lots, mut left) = (self.lots.iter_mut(), 0);
            let mut lot = lots.next();
            walk.states.each(rank, records, states, |_, states| {
                for &state in states {
                    if lot.as_ref().is_some_and(|lot| lot.copies == left) {
                        (lot, left) = (lots.next(), 0);
                    }
                    left += 1;
                    if let Some(lot) = &mut lot {
                        lot.kept += u32::from(RecordState(state).is_alive());
                    }
                }
                Ok(())
            })?;
        }
        self.block = Some(block);
        Ok(())
    }
}

/// Memory for what is stored of a block.
#[derive(Default)]
struct StoredFates {
    fates: Vec<u8>,
    states: Vec<u8>,
    shifts: Vec<u8>,
    buffer: Vec<u8>,
}

/// Blocks that a walk keeps: a tile is walked twice.
const KEPT_BLOCKS: usize = 64;

/// The blocks last seen.
struct KeptBlocks {
    kept: Vec<Seen>,
    columns: StoredFates,
}

impl KeptBlocks {
    /// Bytes that they hold.
    const BYTES: u64 = (KEPT_BLOCKS * BLOCK * (3 * size_of::<Position>() + size_of::<Lot>() + 4)
        + 3 * PIECE
        + BLOCK * (FATE_BYTES + size_of::<[f64; 3]>())) as u64;

    fn new(blocks: usize) -> Self {
        let kept = (0..blocks).map(|_| Seen::default()).collect();
        KeptBlocks { kept, columns: StoredFates::default() }
    }

    /// The positions of a block and what became of them.
    fn of(&mut self, walk: &ScanWalk<'_>, block: usize) -> Result<Walked<'_>> {
        let slot = block % self.kept.len();
        let stretch = &mut self.kept[slot];
        if stretch.block != Some(block) {
            stretch.load(walk, block, &mut self.columns)?;
        }
        Ok(stretch.walked())
    }
}

impl ScanWalk<'_> {
    /// Where a position that is moved by so many world units comes to lie.
    fn moved(&self, position: Position, shift: [f64; 3]) -> Position {
        let shift = if is_still(shift) { [0.0; 3] } else { shift };
        let steps = shift.map(|v| (v / self.step).round_ties_even() as i64);
        let scan = self.tiles.bounds();
        std::array::from_fn(|axis| {
            let moved = position[axis].saturating_add(steps[axis]);
            moved.clamp(scan.lo[axis], scan.hi[axis])
        })
    }

    /// Ranges of blocks, the items of both phases.
    fn ranges(&self) -> usize {
        self.tiles.blocks().div_ceil(BLOCKS)
    }

    /// The first phase: planes of the scan and of the report's tiles, whose lines go to the spill.
    fn tally(
        &self,
        job: &Job<'_>,
        lattice: &Lattice,
        spill: &Spill,
    ) -> Result<(ScanSurvey, Vec<StoredStretch>)> {
        let mut stored = Vec::new();
        let empty = || ScanSurvey::new(&self.tiles.bounds());
        let scans = job.items(self.ranges()).run(
            || (empty(), KeptBlocks::new(KEPT_BLOCKS)),
            |(scan, stretches), range| {
                let mut lines = RangeLines::new(spill);
                let positions = self.tiles_from(range, lattice, scan, stretches, &mut lines)?;
                job.advance(positions)?;
                lines.finish()
            },
            |stretches| stored.extend(stretches),
            |(scan, _)| Ok(scan),
        )?;
        let mut all = empty();
        scans.iter().for_each(|scan| all.merge(scan));
        Ok((all, stored))
    }

    /// The second phase: how far the points are from the planes that the first one fitted.
    fn measure(&self, job: &Job<'_>, scan: ScanSurvey) -> Result<FittedScan> {
        let mut fitted = scan.fit();
        let parts = job.items(self.ranges()).run(
            || (fitted.part(), KeptBlocks::new(1)),
            |(part, stretches), range| {
                let mut positions = 0;
                for block in range * BLOCKS..((range + 1) * BLOCKS).min(self.tiles.blocks()) {
                    let walked = stretches.of(self, block)?;
                    part.measure_all(walked);
                    positions += walked.before.len() as u64;
                }
                job.advance(positions)
            },
            |()| {},
            |(part, _)| Ok(*part.sums()),
        )?;
        parts.iter().for_each(|part| fitted.merge(part));
        Ok(fitted)
    }

    /// Surveys the report tiles that begin in a range of blocks; returns how many positions they
    /// have.
    fn tiles_from(
        &self,
        range: usize,
        lattice: &Lattice,
        scan: &mut ScanSurvey,
        stretches: &mut KeptBlocks,
        lines: &mut RangeLines<'_>,
    ) -> Result<u64> {
        let end = ((range + 1) * BLOCKS).min(self.tiles.blocks());
        let mut at = (range * BLOCKS, 0);
        if let Some(before) = at.0.checked_sub(1)
            && let Some(&last) = stretches.of(self, before)?.before.last()
        {
            // The tile that reaches into this range belongs to the one before.
            at = self.end_of(TileKey::around(last, self.level), at.0, stretches)?;
        }
        let mut positions = 0;
        while at.0 < end {
            let key = TileKey::around(stretches.of(self, at.0)?.before[at.1], self.level);
            let mut tile = scan.tile(key, self.shifts.is_some());
            let (next, seen) = self.visit(stretches, at, key, |walked| {
                tile.add_all(walked);
                scan.add_all(walked);
            })?;
            let mut fitted = tile.fit();
            self.visit(stretches, at, key, |walked| fitted.measure_all(walked))?;
            lines.add(&fitted.finish(lattice, scan)?)?;
            positions += seen;
            at = next;
        }
        Ok(positions)
    }

    /// The first position behind the cube of `key`, which reaches to the beginning of block `from`
    /// or into it.
    fn end_of(
        &self,
        key: TileKey,
        from: usize,
        stretches: &mut KeptBlocks,
    ) -> Result<(usize, usize)> {
        let cube = key.cube();
        let (mut inside, mut behind) = (from, self.tiles.blocks());
        while inside < behind {
            let middle = inside + (behind - inside) / 2;
            match cube.contains(self.tiles.block(middle).first) {
                true => inside = middle + 1,
                false => behind = middle,
            }
        }
        if inside == from {
            return Ok((from, 0));
        }
        // The last block that begins in the cube may end behind it.
        let positions = stretches.of(self, inside - 1)?.before;
        let end = positions.partition_point(|p| cube.contains(*p));
        let whole = end == positions.len();
        Ok(if whole { (inside, 0) } else { (inside - 1, end) })
    }

    /// Visits the positions of the cube of `key` from block and index `at` on, block by block;
    /// returns where they end and how many there were.
    fn visit(
        &self,
        stretches: &mut KeptBlocks,
        mut at: (usize, usize),
        key: TileKey,
        mut visit: impl FnMut(Walked<'_>),
    ) -> Result<((usize, usize), u64)> {
        let cube = key.cube();
        let mut seen = 0;
        while at.0 < self.tiles.blocks() {
            let Walked { before, after, lots } = stretches.of(self, at.0)?;
            let rest = &before[at.1..];
            let count = match rest.last() {
                Some(&last) if cube.contains(last) => rest.len(),
                _ => rest.partition_point(|p| cube.contains(*p)),
            };
            let these = at.1..at.1 + count;
            visit(Walked {
                before: &rest[..count],
                after: &after[these.clone()],
                lots: &lots[these],
            });
            seen += count as u64;
            if count < rest.len() {
                return Ok(((at.0, at.1 + count), seen));
            }
            at = (at.0 + 1, 0);
        }
        Ok((at, seen))
    }
}
