//! How a run divides its memory: what it can tell before any work, as a pure function.
//!
//! What an allocation takes, the type that makes it says; here is who makes how many at once. What is
//! planned, what a refusal lists and what a run leases are the same parts under the same names. A sum
//! that 64 bits do not hold is refused like any that is too large ([`Bytes`]).

use super::by_rank::ordering_bytes;
use super::chunk::OutputChunk;
use super::encoding::ChunkEncoder;
use super::filtering::Filtering;
use super::outlet::A_THREAD;
use super::pass::decides_by_normals;
use super::placed::{BATCH, Placed};
use super::product::Product;
use super::survey::survey_bytes;
use crate::budget::{Bytes, Holders, at_least_mebibytes, at_most_mebibytes, whole_mebibytes};
use crate::geom::nearest::Nearest;
use crate::report::{Baseline, Grouped};
use crate::stage::{ChunkSize, Needs, Source};
use crate::store::{
    Block, FATE_BYTES, FIGURE_BYTES, Intake, NORMAL_BYTES, Pieces, RecordState, SealedTiles,
    merge_bytes, ref_bytes,
};
use crate::tile::{Loader, Remote};
use crate::{Error, Result};

/// Positions or records that a thread must be able to hold: with fewer, rims outweigh tiles.
const FEWEST: usize = 16_384;
/// Working memory that a thread makes use of; more goes to keeping the scan in memory.
const THREAD_MOST: Bytes = Bytes(192 << 20);
/// Records that a run has at most, unless the scan then has more runs than a merge likes.
const RUN_MOST: u64 = 1 << 19;
const RUNS: u64 = 64;
/// Stacks, allocator slack and decoder tables of a thread, and the same for the process.
const THREAD_OVERHEAD: Bytes = Bytes(3 << 20);
const PROCESS_OVERHEAD: Bytes = Bytes(6 << 20);
/// What tiles larger than planned leave for the list of all tiles.
pub const MILL_SPARE: Bytes = Bytes(1 << 20);
/// By how much what is resident before a run differs from process to process: a budget that is named
/// must do in the next.
const RESIDENT_VARIES: Bytes = Bytes(1 << 20);

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
            lists: Bytes(0),
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

    /// What the program holds whatever it does.
    pub fn base(&self) -> Holders {
        Holders::of([
            ("program", Bytes(self.resident) + PROCESS_OVERHEAD),
            ("overhead of threads", self.by_threads(THREAD_OVERHEAD)),
            ("list of records by input", self.lists),
        ])
    }

    /// What a run with tiles holds from the decode on, beside the points that it keeps in memory.
    fn index(&self) -> Holders {
        // That of the runs and that of the merged scan exist side by side for a moment.
        let index = SealedTiles::index_bytes(self.points);
        match self.mills {
            true => Holders::of([
                ("index of the sorted runs", index),
                ("index of the scan", index),
                ("table of stored pieces", self.tables()),
            ]),
            false => Holders::default(),
        }
    }

    /// Bytes of the tables of all that is stored by number; that of the order has gaps.
    fn tables(&self) -> Bytes {
        let order = ref_bytes(self.tagged);
        let states_and_fates = [size_of::<RecordState>(), FATE_BYTES].repeat(self.standings);
        let places = self.ranked.then_some(size_of::<u64>());
        let stores = [self.stride, order, order, NORMAL_BYTES, FIGURE_BYTES];
        let all = stores.into_iter().chain(states_and_fates).chain(places);
        all.map(|stride| Pieces::table_bytes(self.points, stride)).sum()
    }

    /// What all threads hold where each holds `each`.
    fn by_threads(&self, each: Bytes) -> Bytes {
        each * self.threads as u64
    }

    /// What the decode holds where each thread sorts runs of so many records.
    pub fn decode(&self, run_records: u64) -> Holders {
        let batch = Bytes::from(self.stride) + Bytes::from(Placed::BYTES_PER_RECORD);
        let run = Intake::fixed_bytes(self.stride) + self.intake() * run_records;
        Holders::of([
            ("reading of parts", self.by_threads(Bytes(self.part_bytes))),
            ("placing of records", self.by_threads(batch * BATCH as u64)),
            ("sorting of records", self.by_threads(run)),
        ])
    }

    /// What the merge of runs of so many records holds.
    fn merge(&self, run_records: u64) -> Holders {
        // A thread leaves one run that is not full.
        let runs = (self.points / run_records.max(1)).saturating_add(self.threads as u64);
        let all = self.by_threads(merge_bytes(runs, self.stride));
        Holders::of([("merging of sorted runs", all)])
    }

    /// Bytes that an intake holds for each record.
    fn intake(&self) -> Bytes {
        Intake::bytes_per_record(self.stride, self.tagged, self.ranked)
    }

    /// Records of a run for which neither the decode, which holds one, nor the merge, which holds a
    /// bit of each, takes more than they must.
    fn fewest_records(&self) -> u64 {
        let run = merge_bytes(1, self.stride).0 - merge_bytes(0, self.stride).0;
        let all = u128::from(self.points) * u128::from(run);
        let balanced = (all / u128::from(self.intake().0)).isqrt() as u64;
        balanced.max(FEWEST as u64).min(self.most_records())
    }

    /// Records of a run beyond which a larger one gains nothing: it is sorted and gathered outside of
    /// the caches, and its memory is written to for the first time.
    fn most_records(&self) -> u64 {
        RUN_MOST.max(self.points / RUNS).min(self.run_most.unwrap_or(u64::MAX)).max(1)
    }

    /// What the mill holds besides its tiles. Chunks that are cut wait in the outlet; one is open for
    /// every sink, that of the first among those that wait.
    fn outputs(&self) -> Holders {
        let (points, encoded) = (self.chunk.points as u64, Bytes(self.chunk.bytes));
        let chunk = Bytes::of(points, OutputChunk::BYTES_PER_RECORD);
        let chunks = chunk * A_THREAD + chunk * self.other_sinks();
        let encoding = ChunkEncoder::bytes(points, self.stride) + encoded * A_THREAD;
        let by_normals = self.passes.iter().flatten().any(decides_by_normals);
        let baseline = if by_normals { Baseline::BYTES } else { 0 };
        let filters = match self.filters {
            true => Filtering::bytes(self.stride),
            false => Bytes(0),
        };
        Holders::of([
            ("queue of chunks", self.by_threads(chunks)),
            ("encoding of chunks", self.by_threads(encoding)),
            ("comparison with grids", self.by_threads(Bytes(baseline))),
            ("search beyond tiles", self.by_threads(Bytes(Remote::BYTES))),
            ("streaming behind tiles", self.by_threads(filters)),
        ])
    }

    fn other_sinks(&self) -> u64 {
        self.sinks.saturating_sub(1) as u64
    }

    /// What a stream holds. What waits is behind what is read and what is open, and one more of each
    /// is spare.
    pub fn stream(&self) -> Holders {
        let chunk = Bytes::of(self.chunk.points as u64, self.stride);
        let chunks = chunk * (A_THREAD + 1) + chunk * self.other_sinks();
        let batches = Bytes::of(BATCH as u64, self.stride) * (A_THREAD + 1);
        Holders::of([
            ("reading of parts", self.by_threads(Bytes(self.part_bytes))),
            ("queue of batches", self.by_threads(batches)),
            ("queue of chunks", self.by_threads(chunks)),
            ("encoding of chunks", self.by_threads(Bytes(self.chunk.bytes) * A_THREAD)),
        ])
    }

    /// Bytes of a tile per position it holds, the product that it leaves behind included.
    fn tile_bytes_per_point(&self) -> Bytes {
        let of = |pass: &Vec<Needs>| {
            let looks = pass.iter().any(|n| n.neighbors > 0);
            let search = if looks { Nearest::BYTES_PER_POINT } else { 0 };
            let stages = pass.iter().map(|n| Bytes::from(n.bytes_per_point));
            stages.sum::<Bytes>() + Bytes::from(search)
        };
        let stages = self.passes.iter().map(of).max().unwrap_or_default();
        let sieved = self.tagged || self.passes.len() > 1;
        let sieve = if sieved { Loader::SIEVE_BYTES_PER_POINT } else { 0 };
        let product = Product::BYTES_PER_POINT + if self.ranked { Product::PLACE_BYTES } else { 0 };
        Bytes::from(Loader::BYTES_PER_POINT + sieve) + Bytes::of(A_THREAD, product) + stages
    }

    /// What the mill holds where `millers` of the threads have tiles of `positions` positions, rim
    /// included.
    pub fn mill(&self, millers: usize, positions: u64) -> Holders {
        let tiles = self.tile_bytes_per_point() * positions * millers as u64;
        self.outputs().with(&Holders::of([("milling of tiles", tiles)]))
    }

    /// Positions that the tile of each of `millers` threads may hold where the mill has `bytes`.
    pub fn tile_positions(&self, millers: usize, bytes: u64) -> usize {
        let tiles = bytes.saturating_sub(self.outputs().sum().0);
        let share = tiles / (millers as u64).max(1) / self.tile_bytes_per_point().0;
        usize::try_from(share).unwrap_or(usize::MAX)
    }

    /// The most that any phase holds.
    fn work(&self, run_records: u64, tile_positions: u64) -> Holders {
        let survey = Holders::of([("survey", self.by_threads(survey_bytes()))]);
        let ordering = self.by_threads(ordering_bytes(self.points));
        let ordering = Holders::of([("ordering of records", ordering)]).with(&self.outputs());
        self.mill(self.threads, tile_positions)
            .larger(self.decode(run_records))
            .larger(self.merge(run_records))
            .larger(survey)
            .larger(if self.ranked { ordering } else { Holders::default() })
    }

    fn least(&self) -> Holders {
        match self.mills {
            true => self.work(self.fewest_records(), FEWEST as u64),
            false => self.stream(),
        }
    }

    /// The least limit in whole mebibytes with which `millers` of the threads have tiles of
    /// `positions` positions, rim included, whatever of the scan is kept in memory by then.
    pub fn limit_for_tile(&self, millers: usize, positions: u64) -> u64 {
        let needed = self.mill(millers, positions).sum();
        let does = |mebibytes: u64| {
            let demands = Demands { limit: mebibytes << 20, ..self.clone() };
            demands.divide().is_ok_and(|shares| needed.fit(demands.free(&shares)))
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
        let all = Bytes::of(self.points, GATHERED_BYTES);
        if self.gathers { all.min(Bytes(shares.kept_in_memory)) } else { Bytes(0) }
    }

    /// Bytes that `shares` leave the mill at least.
    fn free(&self, shares: &Shares) -> u64 {
        let place = if self.ranked { size_of::<u64>() } else { 0 };
        // Two outcomes of passes are there in any run.
        let more = self.standings.saturating_sub(2) as u64;
        let each = Bytes::from(self.stride) + Bytes::from(KEPT_BYTES + place);
        let each = each + Bytes::from(STANDING_BYTES) * more;
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
        let most = self.by_threads(THREAD_MOST).0.max(least);
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

/// The same of the outcome of a pass that is kept beside two others: states, fates, columns.
const STANDING_BYTES: usize = size_of::<RecordState>() + FATE_BYTES + NORMAL_BYTES + FIGURE_BYTES;

/// The same of what a first phase leaves: a normal, a figure, and two entries of what it found.
const GATHERED_BYTES: usize = NORMAL_BYTES + FIGURE_BYTES + 2 * size_of::<[u64; 2]>();

#[cfg(test)]
mod tests;
