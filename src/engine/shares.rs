//! How a run divides its memory: what it can tell before any work, as a pure function.
//!
//! A division that is computed, and not found by trying, can be told by `plan` before anything is
//! read, and a budget that is too small is refused with the one that would do. A sum that 64 bits
//! do not hold is refused like any that is too large ([`Bytes`]).

use super::pass::ColumnBytes;
use crate::budget::{Bytes, Holders, at_least_mebibytes, at_most_mebibytes, whole_mebibytes};
use crate::report::Grouped;
use crate::stage::{ChunkSize, Needs, Source};
use crate::store::{Block, FATE_BYTES, RecordState, ref_bytes};
use crate::{Error, Result};

/// Working memory that a thread makes use of; more goes to keeping the scan in memory.
const THREAD_MOST: Bytes = Bytes(192 << 20);
/// Positions of a tile beyond which a larger one gains nothing: its rim is thin beside it.
const TILE_MOST: u64 = 3 << 18;
/// What tiles larger than planned leave for the list of all tiles.
pub const MILL_SPARE: Bytes = Bytes(1 << 20);
/// By how much what is resident before a run differs from process to process, by the pages of the
/// program that the system maps and the counters that it keeps by core: a budget that is
/// named must do in the next.
const RESIDENT_VARIES: Bytes = Bytes(2 << 20);

/// What the division depends on.
#[derive(Debug, Clone)]
pub struct Demands {
    /// Bound of the process's resident memory.
    pub limit: u64,
    /// Resident before the run.
    pub resident: u64,
    /// Worker threads.
    pub threads: usize,
    /// Bytes of a record.
    pub stride: usize,
    /// Points that the headers claim.
    pub points: u64,
    /// Bytes that reading a part holds.
    pub part_bytes: u64,
    /// What the largest chunk of a sink is.
    pub chunk: ChunkSize,
    /// Sinks that are written at once.
    pub sinks: usize,
    /// Bytes of the lists of records by input, where each input has an output of its own.
    pub lists: Bytes,
    /// What open outputs that arrange points hold besides their chunks.
    pub arranging: Arranging,
    /// True if the run needs tiles; else it streams.
    pub mills: bool,
    /// True if records have tags.
    pub tagged: bool,
    /// True if an output wants the order of the inputs.
    pub ranked: bool,
    /// Bytes of the largest mesh that is drawn at once and whose points no stage removes.
    pub connected: Bytes,
    /// Records that a run has at most, if something other than the memory bounds it.
    pub run_most: Option<u64>,
    /// True if stages stream behind stages that work on tiles.
    pub filters: bool,
    /// Outcomes of passes that are there at once: states and fates.
    pub standings: usize,
    /// True if a stage decides by figures of the whole scan, which are kept until it does.
    pub gathers: bool,
    /// True if a stage decides about cells together, or by what is around a tile: how many points
    /// those have only the decode tells.
    pub has_cells: bool,
    /// True if encoded chunks are as large as records are in the output, which no encoder packs.
    pub is_plain: bool,
    /// Bytes that columns take for each position, at most.
    pub columns: ColumnBytes,
    /// What the stages of each pass need.
    pub passes: Vec<Vec<Needs>>,
}

/// Bytes that outputs which arrange points hold besides their chunks while they are open.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Arranging {
    /// All that grow while tiles are milled, and those of the inputs that are written at once.
    pub milled: Bytes,
    /// The files of a split that are written at once.
    pub of_split: Bytes,
}

/// The division.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shares {
    /// The program itself: what it holds already, stacks, the slack of the allocator.
    pub base: u64,
    /// Work of all threads, in one phase after the other: decode, merge, mill; or stream.
    pub work: u64,
    /// The indices of the sorted runs and of the merged scan.
    pub index: u64,
    /// Points that stay in memory.
    pub kept_in_memory: u64,
    /// Records that a thread sorts at once.
    pub run_records: usize,
    /// Positions that a thread's tile holds, rim included.
    pub tile_positions: usize,
}

impl Demands {
    /// The demands of `source` into sinks with these chunks.
    pub fn of(source: &dyn Source, chunks: &[ChunkSize], limit: u64, threads: usize) -> Self {
        let largest = |of: fn(&ChunkSize) -> u64| chunks.iter().map(of).max().unwrap_or(0);
        let chunk = ChunkSize {
            points: largest(|chunk| chunk.points as u64) as usize,
            bytes: largest(|chunk| chunk.bytes),
        };
        Demands {
            limit,
            resident: crate::host::process::resident_now().unwrap_or(8 << 20),
            threads,
            stride: source.schema().stride,
            points: source.points(),
            part_bytes: source.part_bytes(),
            chunk,
            sinks: chunks.len(),
            lists: Bytes(0),
            arranging: Arranging::default(),
            mills: false,
            tagged: false,
            ranked: false,
            connected: Bytes(0),
            run_most: None,
            standings: 2,
            filters: false,
            gathers: false,
            has_cells: false,
            is_plain: false,
            columns: ColumnBytes::default(),
            passes: Vec::new(),
        }
    }

    /// The least limit in whole mebibytes with which `millers` of the threads have tiles of
    /// `positions` positions, rim included, whatever of the scan is kept in memory by then.
    pub fn limit_for_tile(&self, millers: usize, positions: u64) -> u64 {
        let needed = self.mill(millers, positions).sum();
        self.limit_where(|demands, shares| needed.fit(demands.free(shares)))
    }

    /// The least limit in whole mebibytes that leaves so much behind the mill, though the system
    /// may not have its memory back yet.
    pub fn limit_behind_mill(&self, needed: Bytes) -> u64 {
        self.limit_where(|demands, shares| {
            (needed + demands.retained(shares)).fit(demands.free(shares))
        })
    }

    /// What the mill held at most: all of the scan in the tiles of its threads, and half as many
    /// positions in their rims.
    pub fn retained(&self, shares: &Shares) -> Bytes {
        let share = (self.points / self.threads.max(1) as u64).saturating_mul(3) / 2;
        self.mill(self.threads, share.min(shares.tile_positions as u64)).sum()
    }

    fn limit_where(&self, does_by: impl Fn(&Demands, &Shares) -> bool) -> u64 {
        let does = |mebibytes: u64| {
            let demands = Demands { limit: mebibytes << 20, ..self.clone() };
            demands.divide().is_ok_and(|shares| does_by(&demands, &shares))
        };
        // More of a limit never leaves the mill less.
        let (mut less, mut enough) = (0, 1 << 43);
        while less + 1 < enough {
            let between = less + (enough - less) / 2;
            if does(between) { enough = between } else { less = between }
        }
        (enough << 20) + RESIDENT_VARIES.0
    }

    /// Bytes of memory that first phases of stages leave at most, while the mill has its tiles.
    pub fn gathered(&self, shares: &Shares) -> Bytes {
        let all = Bytes::of(self.points, GATHERED_BYTES + self.columns.stored);
        if self.gathers { all.min(Bytes(shares.kept_in_memory)) } else { Bytes(0) }
    }

    /// Bytes that `shares` leave the mill at least.
    fn free(&self, shares: &Shares) -> u64 {
        let place = if self.ranked { size_of::<u64>() } else { 0 };
        // Two outcomes of passes are there in any run.
        let more = self.standings.saturating_sub(2) as u64;
        let each = Bytes::from(self.stride) + Bytes::from(KEPT_BYTES + place);
        let standing = Bytes::from(STANDING_BYTES + self.columns.stored);
        let each = each + standing * more;
        let kept = each * self.points + self.gathered(shares);
        let kept = kept.min(Bytes(shares.kept_in_memory));
        let taken = Bytes(shares.base) + Bytes(shares.index) + kept + MILL_SPARE;
        self.limit.saturating_sub(taken.0)
    }

    /// Divides the limit; an error names the one that would do.
    pub fn divide(&self) -> Result<Shares> {
        let [base, index, least] = [self.base(), self.index(), self.least()].map(|part| part.sum());
        let needed = base + index + least;
        if !needed.fit(self.limit) {
            return Err(self.refusal());
        }
        let (base, index, least, spare) = (base.0, index.0, least.0, self.limit - needed.0);
        let shares = Shares {
            base,
            work: least,
            index,
            kept_in_memory: 0,
            run_records: 0,
            tile_positions: 0,
        };
        if !self.mills {
            return Ok(shares);
        }
        let useful = self.mill(self.threads, TILE_MOST);
        let useful = useful.larger(self.decode(self.most_records())).sum();
        let most = self.by_threads(THREAD_MOST).min(useful).0.max(least);
        let work = (least + spare / SPARE.1 * SPARE.0).min(most);
        let runs = work.saturating_sub(self.decode(0).sum().0) / (self.threads as u64).max(1);
        let records = (runs / self.intake().0).min(self.most_records());
        Ok(Shares {
            work,
            kept_in_memory: least + spare - work,
            run_records: usize::try_from(records).unwrap_or(usize::MAX),
            tile_positions: self.tile_positions(self.threads, work),
            ..shares
        })
    }

    fn refusal(&self) -> Error {
        let Demands { threads, stride, points, .. } = self;
        let index = match self.mills {
            true => format!(" and an index of {} points", Grouped(*points)),
            false => String::new(),
        };
        let least = if self.has_cells { "at least " } else { "" };
        let varies = Holders::of([("program", RESIDENT_VARIES)]);
        let parts = varies.with(&self.base()).with(&self.index()).with(&self.least());
        let needed = parts.sum().0;
        let (needed, enough) = (at_least_mebibytes(needed), whole_mebibytes(needed));
        let threads_are =
            if *threads == 1 { "1 thread".to_owned() } else { format!("{threads} threads") };
        let error = Error::memory(format!(
            "a memory budget of {} is too small: {threads_are} on records of {stride} bytes{index} \
             need {least}{needed} ({parts})",
            at_most_mebibytes(self.limit),
        ));
        let fewer = if self.threads > 1 { ", or fewer `run.threads`" } else { "" };
        let later = match self.has_cells {
            true => "; how much the fullest cells need is known when the points are read",
            false => "",
        };
        error.help(format!("give `run.memory = \"{enough}\"` or more{fewer}{later}"))
    }
}

/// The part of the memory to spare that goes to work, up to what it makes use of: 3 of 4.
const SPARE: (u64, u64) = (3, 4);
/// Bytes that a record kept in memory takes at most besides its own: its place in the order, its
/// position and its copies in a run and in the merged scan, its state, its fate; tags included.
const KEPT_BYTES: usize =
    ref_bytes(true) + 2 * Block::BYTES_PER_POSITION + size_of::<RecordState>() + FATE_BYTES;

/// The same of the outcome of a pass that is kept beside two others, columns aside: states, fates.
const STANDING_BYTES: usize = size_of::<RecordState>() + FATE_BYTES;

/// The same of what a first phase leaves beside columns: about two pairs of numbers.
const GATHERED_BYTES: usize = 2 * size_of::<[u64; 2]>();

#[cfg(test)]
mod tests;
