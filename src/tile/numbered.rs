//! Positions with the numbers that their records have in an output.
//!
//! What refers to records of an output (the triangles of a mesh to their corners) needs their
//! numbers in it. In canonical order a record's number is how many of those before it are written,
//! so it takes a count for each block of positions, and no table of records: the states in the
//! block tell the rest.

use std::sync::Arc;

use super::sieve::{Runs, Sieve};
use crate::Result;
use crate::point::{Bounds, Position};
use crate::store::{Pieces, Reader, RecordState, SealedTiles};

/// What is left of a scan, as an output in canonical order numbers it.
#[derive(Debug)]
pub struct NumberedPositions {
    tiles: Arc<SealedTiles>,
    sieve: Sieve,
    blocks: Vec<NumberedBlock>,
}

#[derive(Debug, Clone, Copy)]
struct NumberedBlock {
    /// Records that are written before those of the block.
    before: u64,
    /// Records that take part in the scan, at most so many as there are positions.
    alive: u32,
}

/// Memory for reading blocks.
#[derive(Debug, Default)]
pub struct NumberedReader {
    reader: Reader,
    runs: Runs,
}

impl NumberedPositions {
    /// Bytes that it holds for each block of a scan.
    pub const BYTES_PER_BLOCK: usize = size_of::<NumberedBlock>();

    /// Numbers the records of `tiles` that are written by `states`; all are if there are none.
    ///
    /// # Errors
    ///
    /// Those of reading the store, and of `go_on`, which is called now and then.
    pub fn new(
        tiles: &Arc<SealedTiles>,
        states: Option<Arc<Pieces>>,
        go_on: impl Fn() -> Result<()>,
    ) -> Result<Self> {
        let sieve = Sieve { states, ..Sieve::default() };
        let mut blocks = Vec::with_capacity(tiles.blocks());
        let (mut before, mut buffer) = (0, Vec::new());
        for index in 0..tiles.blocks() {
            if index.is_multiple_of(4096) {
                go_on()?;
            }
            let rank = tiles.rank_of_block(index);
            let is_last = index + 1 == tiles.blocks();
            let end = if is_last { tiles.points() } else { tiles.rank_of_block(index + 1) };
            let (mut written, mut alive) = (0, 0);
            match &sieve.states {
                None => (written, alive) = (end - rank, end - rank),
                Some(pieces) => pieces.each(rank, end - rank, &mut buffer, |_, states| {
                    let states = || states.iter().map(|&state| RecordState(state));
                    written += states().filter(|state| state.is_written()).count() as u64;
                    alive += states().filter(|state| state.is_alive()).count() as u64;
                    Ok(())
                })?,
            }
            let alive = alive.min(tiles.block(index).len() as u64) as u32;
            blocks.push(NumberedBlock { before, alive });
            before += written;
        }
        Ok(NumberedPositions { tiles: tiles.clone(), sieve, blocks })
    }

    /// The box of all positions.
    pub fn bounds(&self) -> Bounds {
        self.tiles.bounds()
    }

    /// Positions that take part in all of the scan, at most.
    pub fn most(&self) -> u64 {
        self.blocks.iter().map(|block| u64::from(block.alive)).sum()
    }

    /// Positions that take part in a box, at most: all of the blocks that reach into it.
    ///
    /// # Errors
    ///
    /// Those of reading the store.
    pub fn most_in(&self, region: &Bounds) -> Result<u64> {
        let mut most = 0;
        self.tiles.blocks_meeting(region, |block| {
            most += u64::from(self.blocks[block].alive);
            Ok(())
        })?;
        Ok(most)
    }

    /// Calls `visit` with every position of `region` that takes part in the scan, in Morton order,
    /// and the number of the first of its records that does.
    ///
    /// # Errors
    ///
    /// Those of reading the store.
    pub fn each(
        &self,
        region: &Bounds,
        reader: &mut NumberedReader,
        mut visit: impl FnMut(Position, u64),
    ) -> Result<()> {
        let is_fine = self.sieve.is_fine(&self.tiles);
        self.tiles.blocks_meeting(region, |index| {
            let NumberedBlock { before, alive } = self.blocks[index];
            if alive == 0 {
                return Ok(());
            }
            let (positions, copies) = self.tiles.read(index, &mut reader.reader)?;
            let mut number = before;
            if !is_fine {
                for (&p, &count) in positions.iter().zip(copies) {
                    if region.contains(p) {
                        visit(p, number);
                    }
                    number += u64::from(count);
                }
                return Ok(());
            }
            reader.runs.read(&self.tiles, &self.sieve, index, copies)?;
            for (j, &p) in positions.iter().enumerate() {
                let mut first = None;
                for run in reader.runs.of(j) {
                    if run.is_alive() {
                        first = first.or(Some(number));
                    }
                    number += if run.state.is_written() { u64::from(run.count) } else { 0 };
                }
                if let Some(first) = first.filter(|_| region.contains(p)) {
                    visit(p, first);
                }
            }
            Ok(())
        })
    }
}
