//! The last walk over the decoded scan: what the reduction did to each report tile and to all.

use std::collections::BTreeMap;
use std::io::Write;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::run::Job;
use crate::geom::lattice::Lattice;
use crate::point::Position;
use crate::report::{ScanSurvey, Totals, report_tile_level};
use crate::tile::{Fate, Pieces, Reader, SealedTiles, TileKey, lock, parallel};
use crate::{Error, Result};

/// Bytes of a stored fate.
pub(super) const FATE_BYTES: usize = size_of::<f32>();
const KEPT: f32 = -1.0;
const KEPT_ONCE: f32 = -2.0;
/// Blocks that a thread surveys at once.
const BLOCKS: usize = 256;

/// A fate as stored: the deviation, or a negative number for what is kept.
pub(super) fn fate_code(fate: Fate) -> [u8; FATE_BYTES] {
    match fate {
        Fate::Kept => KEPT,
        Fate::KeptOnce => KEPT_ONCE,
        Fate::Represented { deviation } => deviation,
    }
    .to_le_bytes()
}

fn fate_of(code: [u8; FATE_BYTES]) -> Fate {
    match f32::from_le_bytes(code) {
        KEPT => Fate::Kept,
        KEPT_ONCE => Fate::KeptOnce,
        deviation => Fate::Represented { deviation },
    }
}

/// What was measured.
pub(super) struct Measured {
    /// Side of the report tiles in world units.
    pub tile_side: f64,
    /// Figures of the scan.
    pub totals: Totals,
    /// Lines of the report's tiles, in order.
    pub tiles: Vec<u8>,
}

/// Measures the reduction of `tiles` whose positions have the given fates, on all threads.
pub(super) fn survey(
    job: &Job<'_>,
    lattice: &Lattice,
    tiles: &SealedTiles,
    fates: &Pieces,
) -> Result<Measured> {
    let level = report_tile_level(tiles.levels());
    let walk = Walk { tiles, fates, level };
    let ranges = tiles.blocks().div_ceil(BLOCKS);
    let _working = job.budget.lease(2 * ScanSurvey::BYTES * job.threads as u64, "the survey")?;
    let all = Mutex::new((ScanSurvey::new(&tiles.bounds()), BTreeMap::new()));
    each_range(job, ranges, |range| {
        let mut scan = ScanSurvey::new(&tiles.bounds());
        let mut lines = Vec::new();
        let positions = walk.tiles_from(range, lattice, &mut scan, &mut lines)?;
        let mut all = lock(&all);
        all.0.merge(&scan);
        all.1.insert(range, lines);
        Ok(positions)
    })?;
    let (scan, lines) =
        std::mem::replace(&mut *lock(&all), (ScanSurvey::new(&tiles.bounds()), BTreeMap::new()));
    let fitted = Mutex::new(scan.fit());
    let empty = lock(&fitted).part();
    each_range(job, ranges, |range| {
        let mut part = empty.clone();
        let mut positions = 0;
        let mut stretch = Stretch::default();
        for block in range * BLOCKS..((range + 1) * BLOCKS).min(tiles.blocks()) {
            stretch.load(&walk, block)?;
            for (&(p, fate), &copies) in stretch.positions.iter().zip(&stretch.copies) {
                part.measure(p, copies, fate);
            }
            positions += stretch.positions.len() as u64;
        }
        lock(&fitted).merge(&part);
        Ok(positions)
    })?;
    let fitted = fitted.into_inner().map_err(|_| Error::internal("a survey thread panicked"))?;
    Ok(Measured {
        tile_side: (level as f64).exp2() * lattice.step,
        totals: fitted.finish(lattice)?,
        tiles: lines.into_values().flatten().collect(),
    })
}

/// Calls `work` for every range, on all threads; it returns how many positions it did.
fn each_range(
    job: &Job<'_>,
    ranges: usize,
    work: impl Fn(usize) -> Result<u64> + Sync,
) -> Result<()> {
    let next = AtomicUsize::new(0);
    parallel(job.threads, |_| {
        loop {
            let range = next.fetch_add(1, Ordering::Relaxed);
            if range >= ranges {
                return Ok(());
            }
            job.advance(work(range)?)?;
        }
    })
}

struct Walk<'a> {
    tiles: &'a SealedTiles,
    fates: &'a Pieces,
    level: u32,
}

/// A block with the fates of its positions.
#[derive(Default)]
struct Stretch {
    block: Option<usize>,
    reader: Reader,
    buffer: Vec<u8>,
    positions: Vec<(Position, Fate)>,
    copies: Vec<u32>,
}

impl Stretch {
    fn load(&mut self, walk: &Walk<'_>, block: usize) -> Result<()> {
        if self.block == Some(block) {
            return Ok(());
        }
        let (positions, copies) = walk.tiles.read(block, &mut self.reader)?;
        self.positions.clear();
        self.positions.extend(positions.iter().map(|&p| (p, Fate::Kept)));
        self.copies.clear();
        self.copies.extend_from_slice(copies);
        let (first, len) = (walk.tiles.block(block).first_position, positions.len() as u64);
        let placed = &mut self.positions;
        walk.fates.each(first, len, &mut self.buffer, |at, bytes| {
            for (n, code) in bytes.chunks_exact(FATE_BYTES).enumerate() {
                let mut stored = [0; FATE_BYTES];
                stored.copy_from_slice(code);
                placed[(at - first) as usize + n].1 = fate_of(stored);
            }
            Ok(())
        })?;
        self.block = Some(block);
        Ok(())
    }
}

impl Walk<'_> {
    /// Surveys the report tiles that begin in a range of blocks; returns how many positions they
    /// have.
    fn tiles_from(
        &self,
        range: usize,
        lattice: &Lattice,
        scan: &mut ScanSurvey,
        lines: &mut Vec<u8>,
    ) -> Result<u64> {
        let end = ((range + 1) * BLOCKS).min(self.tiles.blocks());
        let mut stretch = Stretch::default();
        let mut at = (range * BLOCKS, 0);
        if let Some(before) = at.0.checked_sub(1) {
            stretch.load(self, before)?;
            if let Some(&(last, _)) = stretch.positions.last() {
                // The tile that reaches into this range belongs to the one before.
                at = self
                    .visit(&mut stretch, at, TileKey::around(last, self.level), |_, _, _| {})?
                    .0;
            }
        }
        let mut positions = 0;
        while at.0 < end {
            stretch.load(self, at.0)?;
            let key = TileKey::around(stretch.positions[at.1].0, self.level);
            let mut tile = scan.tile(key);
            let (next, seen) = self.visit(&mut stretch, at, key, |p, copies, fate| {
                tile.add(p, copies, fate);
                scan.add(p, copies, fate);
            })?;
            let mut fitted = tile.fit();
            self.visit(&mut stretch, at, key, |p, copies, fate| fitted.measure(p, copies, fate))?;
            let figures = fitted.finish(lattice, scan)?;
            figures
                .write_line(&mut *lines)
                .and_then(|()| lines.flush())
                .map_err(|e| Error::internal("a report line could not be written").because(e))?;
            positions += seen;
            at = next;
        }
        Ok(positions)
    }

    /// Visits the positions of the cube of `key` from block and index `at` on; returns where they
    /// end and how many there were.
    fn visit(
        &self,
        stretch: &mut Stretch,
        mut at: (usize, usize),
        key: TileKey,
        mut visit: impl FnMut(Position, u32, Fate),
    ) -> Result<((usize, usize), u64)> {
        let cube = key.cube();
        let mut seen = 0;
        while at.0 < self.tiles.blocks() {
            stretch.load(self, at.0)?;
            while let Some(&(p, fate)) = stretch.positions.get(at.1) {
                if !cube.contains(p) {
                    return Ok((at, seen));
                }
                visit(p, stretch.copies[at.1], fate);
                seen += 1;
                at.1 += 1;
            }
            at = (at.0 + 1, 0);
        }
        Ok((at, seen))
    }
}
