//! How a run divides its memory: what it can tell before any work, as a pure function.

use super::by_rank::ordering_bytes;
use super::filtering::Filtering;
use super::pass::decides_by_normals;
use super::product::Product;
use super::survey::survey_bytes;
use crate::budget::{at_least_mebibytes, at_most_mebibytes, whole_mebibytes};
use crate::geom::nearest::Nearest;
use crate::point::Position;
use crate::report::{Baseline, Grouped};
use crate::stage::{ChunkSize, Needs, Source};
use crate::store::{
    FATE_BYTES, FIGURE_BYTES, Fetch, Intake, NORMAL_BYTES, Pieces, Tag, index_bytes, merge_bytes,
};
use crate::tile::{Loader, Remote};
use crate::{Error, Result};

/// Records that a batch of the decode takes.
pub const BATCH: usize = 8192;
/// Positions or records that a thread must be able to hold: with fewer, rims outweigh tiles.
const FEWEST: usize = 16_384;
/// Working memory that a thread makes use of; more goes to keeping the scan in memory.
const THREAD_MOST: u64 = 192 << 20;
/// Records that a run has at most, unless the scan then has more runs than a merge likes.
const RUN_MOST: u64 = 1 << 19;
const RUNS: u64 = 64;
/// Stacks, allocator slack and decoder tables of a thread, and the same for the process.
const THREAD_OVERHEAD: u64 = 3 << 20;
const PROCESS_OVERHEAD: u64 = 6 << 20;
/// What tiles larger than planned leave for the list of all tiles.
pub const MILL_SPARE: u64 = 1 << 20;
/// By how much what is resident before a run differs from process to process: a budget that is named
/// must do in the next.
const RESIDENT_VARIES: u64 = 1 << 20;

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
    pub lists: u64,
    /// True if the run needs tiles; else it streams.
    pub mills: bool,
    /// True if records have tags.
    pub tagged: bool,
    /// True if an output wants the order of the inputs.
    pub ranked: bool,
    /// Records that a run has at most, if something other than the memory bounds it.
    pub run_most: Option<u64>,
    /// True if stages stream behind stages that work on tiles.
    pub filters: bool,
    /// Outcomes of passes that are there at once: states and fates.
    pub standings: usize,
    /// True if a stage decides by figures of the whole scan, which are kept until it does.
    pub gathers: bool,
    /// True if a stage decides about cells together: how many points those have only the decode
    /// tells.
    pub has_cells: bool,
    /// What the stages of each pass need.
    pub passes: Vec<Vec<Needs>>,
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
            lists: 0,
            mills: false,
            tagged: false,
            ranked: false,
            run_most: None,
            standings: 2,
            filters: false,
            gathers: false,
            has_cells: false,
            passes: Vec::new(),
        }
    }

    fn base(&self) -> u64 {
        let threads = (self.threads as u64).saturating_mul(THREAD_OVERHEAD);
        let fixed = self.resident.saturating_add(self.lists);
        fixed.saturating_add(PROCESS_OVERHEAD).saturating_add(threads)
    }

    /// Bytes that a thread holds while it decodes, besides its run.
    fn decode_fixed(&self) -> u64 {
        let placed = size_of::<Position>() + size_of::<Tag>() + size_of::<usize>();
        let batch =
            (BATCH as u64).saturating_mul((self.stride as u64).saturating_add(placed as u64));
        self.part_bytes.saturating_add(batch).saturating_add(Intake::fixed_bytes(self.stride))
    }

    /// Bytes that a thread holds while it merges runs of `run_records`.
    fn merge(&self, run_records: u64) -> u64 {
        let runs = (self.points / run_records.max(1)).saturating_add(self.threads as u64);
        merge_bytes(runs, self.stride)
    }

    /// Bytes that an intake holds for each record.
    fn intake(&self) -> u64 {
        Intake::bytes_per_record(self.stride, self.tagged, self.ranked).max(1)
    }

    /// Records of a run for which neither the decode, which holds one, nor the merge, which holds a
    /// bit of each, takes more than they must.
    fn fewest_records(&self) -> u64 {
        let run = merge_bytes(1, self.stride).saturating_sub(merge_bytes(0, self.stride));
        let balanced = (self.points.saturating_mul(run) / self.intake()).isqrt();
        balanced.max(FEWEST as u64).min(self.most_records())
    }

    /// Records of a run beyond which a larger one gains nothing: it is sorted and gathered outside of
    /// the caches, and its memory is written to for the first time.
    fn most_records(&self) -> u64 {
        RUN_MOST.max(self.points / RUNS).min(self.run_most.unwrap_or(u64::MAX)).max(1)
    }

    /// Bytes that a thread holds in the mill, besides its tile: one chunk that it encodes and one
    /// that waits (of each position: first record, number of records, normal), one that is open for
    /// every other sink, and the records of the first with their numbers and normals.
    fn mill_fixed(&self) -> u64 {
        let ChunkSize { points, bytes } = self.chunk;
        let points = points as u64;
        let batch = points.saturating_mul((self.stride as u64).saturating_add(8 + 12));
        let waiting = points.saturating_mul(28);
        let open = (self.sinks.saturating_sub(1) as u64).saturating_mul(waiting);
        let chunks = bytes.saturating_add(waiting).saturating_mul(2);
        let fetch = Fetch::bytes(points, self.stride);
        let by_normals = self.passes.iter().flatten().any(decides_by_normals);
        let baseline = if by_normals { Baseline::BYTES } else { 0 };
        let filters = if self.filters { Filtering::bytes(self.stride) } else { 0 };
        [baseline, chunks, open, batch, fetch, filters]
            .into_iter()
            .fold(Remote::BYTES, u64::saturating_add)
    }

    /// Bytes that a thread of a stream holds: batches read and waiting for their turn, chunks filled,
    /// waiting, being encoded and encoded.
    fn stream(&self) -> u64 {
        let records = (self.chunk.points as u64).saturating_mul(self.stride as u64);
        let open = (self.sinks.saturating_sub(1) as u64).saturating_mul(records);
        let batches = (3 * BATCH as u64).saturating_mul(self.stride as u64);
        let (full, encoded) = (records.saturating_mul(3), self.chunk.bytes.saturating_mul(2));
        [batches, full, open, encoded].into_iter().fold(self.part_bytes, u64::saturating_add)
    }

    /// Bytes of a tile per position it holds, the product that it leaves behind included.
    fn tile_bytes_per_point(&self) -> u64 {
        let of = |pass: &Vec<Needs>| {
            let looks = pass.iter().any(|n| n.neighbors > 0);
            let search = if looks { Nearest::BYTES_PER_POINT } else { 0 };
            pass.iter().fold(search, |sum, n| sum.saturating_add(n.bytes_per_point))
        };
        let stages = self.passes.iter().map(of).max().unwrap_or(0);
        let sieved = self.tagged || self.passes.len() > 1;
        let sieve = if sieved { Loader::SIEVE_BYTES_PER_POINT } else { 0 };
        let product = Product::BYTES_PER_POINT + if self.ranked { Product::PLACE_BYTES } else { 0 };
        let own = Loader::BYTES_PER_POINT + sieve + 2 * product;
        own.saturating_add(stages) as u64
    }

    fn index(&self) -> u64 {
        // That of the runs and that of the merged scan exist side by side for a moment.
        match self.mills {
            true => index_bytes(self.points).saturating_mul(2).saturating_add(self.tables()),
            false => 0,
        }
    }

    /// Bytes of the tables of all that is stored by number; that of the order has gaps.
    fn tables(&self) -> u64 {
        let order = if self.tagged { 12 } else { 8 };
        let states_and_fates = [1, FATE_BYTES].repeat(self.standings);
        let places = self.ranked.then_some(size_of::<u64>());
        let stores = [self.stride, order, order, NORMAL_BYTES, FIGURE_BYTES];
        let all = stores.into_iter().chain(states_and_fates).chain(places);
        all.map(|stride| Pieces::table_bytes(self.points, stride)).fold(0, u64::saturating_add)
    }

    /// Bytes that all threads hold at once where each holds `each`.
    fn by_threads(&self, each: u64) -> u64 {
        (self.threads as u64).saturating_mul(each)
    }

    fn work(&self, run_records: u64, tile_positions: u64) -> u64 {
        let run = run_records.saturating_mul(self.intake());
        let decode = self.decode_fixed().saturating_add(run);
        let each = decode.max(self.merge(run_records)).max(survey_bytes());
        let ordering = match self.ranked {
            true => self.mill_fixed().saturating_add(ordering_bytes(self.points)),
            false => 0,
        };
        let each = each.max(ordering);
        self.by_threads(each).max(self.mill_bytes(self.threads, tile_positions))
    }

    /// Bytes that the mill holds where `millers` of the threads have tiles of `positions` positions,
    /// rim included.
    pub fn mill_bytes(&self, millers: usize, positions: u64) -> u64 {
        let tiles = (millers as u64).saturating_mul(positions);
        let tiles = tiles.saturating_mul(self.tile_bytes_per_point());
        self.by_threads(self.mill_fixed()).saturating_add(tiles)
    }

    /// Positions that the tile of each of `millers` threads may hold where the mill has `bytes`.
    pub fn tile_positions(&self, millers: usize, bytes: u64) -> usize {
        let tiles = bytes.saturating_sub(self.by_threads(self.mill_fixed()));
        let share = tiles / (millers as u64).max(1) / self.tile_bytes_per_point().max(1);
        usize::try_from(share).unwrap_or(usize::MAX)
    }

    fn least(&self) -> u64 {
        match self.mills {
            true => self.work(self.fewest_records(), FEWEST as u64),
            false => self.by_threads(self.stream()),
        }
    }

    /// The least limit in whole mebibytes with which `millers` of the threads have tiles of
    /// `positions` positions, rim included, whatever of the scan is kept in memory by then.
    pub fn limit_for_tile(&self, millers: usize, positions: u64) -> u64 {
        let needed = self.mill_bytes(millers, positions);
        let does = |mebibytes: u64| {
            let demands = Demands { limit: mebibytes << 20, ..self.clone() };
            demands.divide().is_ok_and(|shares| demands.free(&shares) >= needed)
        };
        // More of a limit never leaves the mill less.
        let (mut less, mut enough) = (0, 1 << 43);
        while less + 1 < enough {
            let between = less + (enough - less) / 2;
            if does(between) { enough = between } else { less = between }
        }
        (enough << 20).saturating_add(RESIDENT_VARIES)
    }

    /// Bytes of memory that first phases of stages leave at most, while the mill has its tiles.
    pub fn gathered(&self, shares: &Shares) -> u64 {
        let each = if self.gathers { GATHERED_BYTES } else { 0 };
        shares.kept_in_memory.min(self.points.saturating_mul(each))
    }

    /// Bytes that `shares` leave the mill at least.
    fn free(&self, shares: &Shares) -> u64 {
        let each = (self.stride as u64).saturating_add(KEPT_BYTES);
        let each = each.saturating_add(if self.ranked { 8 } else { 0 });
        let more = self.standings.saturating_sub(2) as u64;
        let each = each.saturating_add(more.saturating_mul(STANDING_BYTES));
        let kept = shares.kept_in_memory.min(self.points.saturating_mul(each));
        let kept = kept.saturating_add(self.gathered(shares)).min(shares.kept_in_memory);
        let taken = shares.base.saturating_add(shares.index).saturating_add(kept);
        self.limit.saturating_sub(taken).saturating_sub(MILL_SPARE)
    }

    fn most_work(&self, least: u64) -> u64 {
        self.by_threads(THREAD_MOST).max(least)
    }

    /// Divides the limit; an error names the one that would do.
    pub fn divide(&self) -> Result<Shares> {
        let (base, index, least) = (self.base(), self.index(), self.least());
        let needed = base.saturating_add(index).saturating_add(least);
        // A sum that reached the end of the numbers is more than any memory.
        let spare = self.limit.checked_sub(needed).filter(|_| needed < u64::MAX);
        let Some(spare) = spare else {
            return Err(self.refusal(needed));
        };
        if !self.mills {
            let (run_records, tile_positions) = (0, 0);
            let kept_in_memory = 0;
            return Ok(Shares {
                base,
                work: least,
                index,
                kept_in_memory,
                run_records,
                tile_positions,
            });
        }
        let work = (least + spare / SPARE.1 * SPARE.0).min(self.most_work(least));
        let share = work / (self.threads as u64).max(1);
        let records = share.saturating_sub(self.decode_fixed()) / self.intake();
        let records = records.min(self.most_records());
        Ok(Shares {
            base,
            work,
            index,
            kept_in_memory: least + spare - work,
            run_records: usize::try_from(records).unwrap_or(usize::MAX),
            tile_positions: self.tile_positions(self.threads, work),
        })
    }

    fn refusal(&self, needed: u64) -> Error {
        let Demands { threads, stride, points, .. } = self;
        let index = match self.mills {
            true => format!(" and an index of {} points", Grouped(*points)),
            false => String::new(),
        };
        let least = if self.has_cells { "at least " } else { "" };
        let needed = needed.saturating_add(RESIDENT_VARIES);
        let (needed, enough) = (at_least_mebibytes(needed), whole_mebibytes(needed));
        let threads_are =
            if *threads == 1 { "1 thread".to_owned() } else { format!("{threads} threads") };
        let error = Error::memory(format!(
            "a memory budget of {} is too small: {threads_are} on records of {stride} bytes{index} \
             need {least}{needed}",
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
/// position in a run and in the merged scan, its copies, its state, its fate; tags included.
const KEPT_BYTES: u64 = 12 + 28 + 24 + 4 + 1 + 4;

/// The same of the outcome of a pass that is kept beside two others: states, fates, columns.
const STANDING_BYTES: u64 = (1 + FATE_BYTES + NORMAL_BYTES + FIGURE_BYTES) as u64;

/// The same of what a first phase leaves: a normal, a figure, and two entries of what it found.
const GATHERED_BYTES: u64 = (NORMAL_BYTES + FIGURE_BYTES + 2 * size_of::<[u64; 2]>()) as u64;

#[cfg(test)]
mod tests;
