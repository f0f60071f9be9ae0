//! How a run divides its memory: what it can tell before any work, as a pure function.

use super::passes::decides_by_normals;
use super::product::Product;
use crate::budget::{Bytes, whole_mebibytes};
use crate::point::Position;
use crate::report::Baseline;
use crate::stage::{ChunkSize, Needs, Source};
use crate::tile::{Fetch, Intake, Loader, Remote, Tag, index_bytes, merge_bytes};
use crate::{Error, Result, geom::nearest::Nearest};

/// Records that a batch of the decode takes.
pub const BATCH: usize = 8192;
/// Positions or records that a thread must be able to hold for the mill to be worth its name.
const FEWEST: usize = 16_384;
/// Working memory that a thread makes use of; more goes to keeping the scan in memory.
const THREAD_MOST: u64 = 192 << 20;
/// Records that a run has at most, unless the scan then has more runs than a merge likes.
const RUN_MOST: u64 = 1 << 19;
const RUNS: u64 = 64;
/// Stacks, allocator slack and decoder tables of a thread, and the same for the process.
const THREAD_OVERHEAD: u64 = 3 << 20;
const PROCESS_OVERHEAD: u64 = 6 << 20;

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
    /// What the stages of each pass need.
    pub passes: Vec<Vec<Needs>>,
}

/// The division.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shares {
    /// Not leased to anyone: the program itself.
    pub base: u64,
    /// Work of all threads: decode first, then the merge, then the mill.
    pub work: u64,
    /// The index of the scan.
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
            resident: crate::report::resident_now().unwrap_or(8 << 20),
            threads,
            stride: source.schema().stride,
            points: source.points(),
            part_bytes: source.part_bytes(),
            chunk,
            sinks: chunks.len(),
            lists: 0,
            mills: false,
            tagged: false,
            passes: Vec::new(),
        }
    }

    fn base(&self) -> u64 {
        self.resident + self.lists + PROCESS_OVERHEAD + self.threads as u64 * THREAD_OVERHEAD
    }

    /// Bytes that a thread holds while it decodes, besides its run.
    fn decode_fixed(&self) -> u64 {
        let placed = BATCH * (size_of::<Position>() + size_of::<Tag>() + size_of::<usize>());
        let batch = BATCH * self.stride + placed;
        self.part_bytes + (batch + Intake::fixed_bytes(self.stride)) as u64
    }

    /// Bytes that a thread holds while it merges runs of `run_records`.
    fn merge(&self, run_records: u64) -> u64 {
        let runs = self.points / run_records.max(1) + self.threads as u64;
        merge_bytes(usize::try_from(runs).unwrap_or(usize::MAX), self.stride)
    }

    /// Records of a run for which neither the decode, which holds one, nor the merge, which holds a
    /// bit of each, takes more than they must.
    fn fewest_records(&self) -> u64 {
        let each = Intake::bytes_per_record(self.stride, self.tagged).max(1) as u64;
        let run = merge_bytes(1, self.stride) - merge_bytes(0, self.stride);
        (self.points.saturating_mul(run) / each).isqrt().max(FEWEST as u64)
    }

    /// Records of a run beyond which a larger one gains nothing: it is sorted and gathered outside of
    /// the caches, and its memory is written to for the first time.
    fn most_records(&self) -> u64 {
        RUN_MOST.max(self.points / RUNS)
    }

    /// Bytes that a thread holds in the mill, besides its tile: one chunk that it encodes and one
    /// that waits (of each position: first record, number of records, normal), one that is open for
    /// every other sink, and the records of the first with their numbers and normals.
    fn mill_fixed(&self) -> u64 {
        let ChunkSize { points, bytes } = self.chunk;
        let batch = points as u64 * (self.stride as u64 + 8 + 12);
        let open = self.sinks.saturating_sub(1) as u64 * points as u64 * 28;
        let chunks = 2 * (bytes + points as u64 * 28);
        let by_normals = self.passes.iter().flatten().any(decides_by_normals);
        let baseline = if by_normals { Baseline::BYTES } else { 0 };
        Remote::BYTES + baseline + chunks + open + batch + Fetch::bytes(points, self.stride)
    }

    /// Bytes that a thread of a stream holds: batches read and waiting for their turn, chunks filled,
    /// waiting, being encoded and encoded.
    fn stream(&self) -> u64 {
        let records = self.chunk.points as u64 * self.stride as u64;
        let open = self.sinks.saturating_sub(1) as u64 * records;
        self.part_bytes
            + 3 * (BATCH * self.stride) as u64
            + 3 * records
            + open
            + 2 * self.chunk.bytes
    }

    /// Bytes of a tile per position it holds, the product that it leaves behind included.
    pub fn tile_bytes_per_point(&self) -> usize {
        let of = |pass: &Vec<Needs>| {
            let looks = pass.iter().any(|n| n.neighbors > 0);
            let search = if looks { Nearest::BYTES_PER_POINT } else { 0 };
            search + pass.iter().map(|n| n.bytes_per_point).sum::<usize>()
        };
        let stages = self.passes.iter().map(of).max().unwrap_or(0);
        let sieved = self.tagged || self.passes.len() > 1;
        let sieve = if sieved { Loader::SIEVE_BYTES_PER_POINT } else { 0 };
        Loader::BYTES_PER_POINT + sieve + stages + 2 * Product::BYTES_PER_POINT
    }

    fn index(&self) -> u64 {
        // That of the runs and that of the merged scan exist side by side for a moment.
        if self.mills { 2 * index_bytes(self.points) } else { 0 }
    }

    fn work(&self, run_records: u64, tile_positions: u64) -> u64 {
        let decode = self.decode_fixed()
            + run_records * Intake::bytes_per_record(self.stride, self.tagged) as u64;
        let each = decode.max(self.merge(run_records));
        (self.threads as u64 * each).max(self.mill_bytes(tile_positions))
    }

    /// Bytes that the threads hold in the mill with tiles of `positions` positions, rim included.
    pub fn mill_bytes(&self, positions: u64) -> u64 {
        let tile = positions.saturating_mul(self.tile_bytes_per_point() as u64);
        (self.threads as u64).saturating_mul(self.mill_fixed().saturating_add(tile))
    }

    /// Positions that each thread's tile may hold where the mill has `bytes`.
    pub fn tile_positions(&self, bytes: u64) -> usize {
        let share = (bytes / self.threads as u64).saturating_sub(self.mill_fixed());
        (share / self.tile_bytes_per_point() as u64) as usize
    }

    fn least(&self) -> u64 {
        match self.mills {
            true => self.work(self.fewest_records(), FEWEST as u64),
            false => self.threads as u64 * self.stream(),
        }
    }

    /// A limit that does for tiles of `positions` positions, rim included.
    pub fn limit_for_tile(&self, positions: u64) -> u64 {
        let (least, mill) = (self.least(), self.mill_bytes(positions));
        // Where a share of the limit suffices, or where all that is kept in memory leaves enough.
        let share = least.saturating_add(mill.saturating_sub(least) / SPARE.0 * SPARE.1 + SPARE.1);
        let kept = self.points.saturating_mul(self.stride as u64 + KEPT_BYTES).saturating_add(mill);
        let fits = mill <= self.most_work(least);
        let work = if fits { share.min(kept) } else { kept };
        (self.base() + self.index()).saturating_add(work).saturating_add(1 << 20)
    }

    fn most_work(&self, least: u64) -> u64 {
        (THREAD_MOST * self.threads as u64).max(least)
    }

    /// Divides the limit; an error names the one that would do.
    pub fn divide(&self) -> Result<Shares> {
        let (base, index, least) = (self.base(), self.index(), self.least());
        let needed = base + index + least;
        let Some(spare) = self.limit.checked_sub(needed) else {
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
        let share = work / self.threads as u64;
        let each = Intake::bytes_per_record(self.stride, self.tagged).max(1) as u64;
        Ok(Shares {
            base,
            work,
            index,
            kept_in_memory: least + spare - work,
            run_records: (share.saturating_sub(self.decode_fixed()) / each).min(self.most_records())
                as usize,
            tile_positions: self.tile_positions(work),
        })
    }

    fn refusal(&self, needed: u64) -> Error {
        let Demands { threads, stride, points, .. } = self;
        let index = match self.mills {
            true => format!(" and an index of {points} points"),
            false => String::new(),
        };
        Error::memory(format!(
            "a memory budget of {} is too small: {threads} threads on records of {stride} bytes\
             {index} need {}",
            Bytes(self.limit),
            Bytes(needed)
        ))
        .help(format!(
            "give --memory {} or more{}",
            whole_mebibytes(needed),
            if self.threads > 1 { ", or fewer --threads" } else { "" }
        ))
    }
}

/// The part of the memory to spare that goes to work, up to what it makes use of: 3 of 4.
const SPARE: (u64, u64) = (3, 4);
/// Bytes that a record kept in memory takes at most besides its own: its place in the order, its
/// position in a run and in the merged scan, its copies, its state, its fate.
const KEPT_BYTES: u64 = 8 + 24 + 24 + 4 + 1 + 4;

#[cfg(test)]
mod tests {
    use super::*;

    fn demands(limit: u64) -> Demands {
        Demands {
            limit,
            resident: 8 << 20,
            threads: 2,
            stride: 30,
            points: 10_000_000,
            part_bytes: 1 << 20,
            chunk: ChunkSize { points: 50_000, bytes: 4_500_000 },
            sinks: 1,
            lists: 0,
            mills: true,
            tagged: false,
            passes: vec![vec![Needs { neighbors: 10, bytes_per_point: 40, ..Needs::default() }]],
        }
    }

    #[test]
    fn what_is_divided_is_no_more_than_the_limit() {
        for mib in [64, 100, 128, 256, 1024, 65_536] {
            let Ok(shares) = demands(mib << 20).divide() else {
                assert!(mib < 128, "{mib} MiB do for two threads");
                continue;
            };
            let sum = shares.base + shares.work + shares.index + shares.kept_in_memory;
            assert!(sum <= mib << 20, "{mib} MiB: {shares:?}");
            assert!(shares.run_records >= FEWEST && shares.tile_positions >= FEWEST, "{shares:?}");
        }
    }

    #[test]
    fn the_limit_for_a_heavy_tile_leaves_that_tile_its_memory() {
        for positions in [20_000, 1_000_000, 30_000_000] {
            let named = demands(0).limit_for_tile(positions);
            let there = demands(named);
            let shares = there.divide().unwrap();
            // What is kept in memory is no more than the scan.
            let kept = shares.kept_in_memory.min(there.points * (30 + KEPT_BYTES));
            let free = named - shares.base - shares.index - kept;
            assert!(there.tile_positions(free) as u64 >= positions, "{positions}: {shares:?}");
        }
    }

    #[test]
    fn a_stream_needs_no_index() {
        let shares = Demands { mills: false, ..demands(64 << 20) }.divide().unwrap();
        assert_eq!((shares.index, shares.kept_in_memory), (0, 0));
        assert!(shares.base + shares.work <= 64 << 20);
    }

    #[test]
    fn a_refusal_names_a_limit_that_does() {
        let error = demands(32 << 20).divide().unwrap_err();
        let help = error.remedy().unwrap().to_owned();
        let mebibytes: u64 =
            help.split_once("--memory ").unwrap().1.split_once("MiB").unwrap().0.parse().unwrap();
        assert!(demands(mebibytes << 20).divide().is_ok(), "{help}");
        assert!(demands((mebibytes - 2) << 20).divide().is_err(), "{help}");
    }
}
