//! What a run needs of the memory in each of its phases, from what is known before any work.
//!
//! What an allocation takes, the type that makes it says; here is who makes how many at once. So a
//! formula stands beside its allocation, and the parts that are planned here have the names under
//! which a run leases them and a refusal lists them.

use super::by_rank::ordering_bytes;
use super::by_split::writing_bytes;
use super::chunk::OutputChunk;
use super::encoding::ChunkEncoder;
use super::filtering::Filtering;
use super::outlet::A_THREAD;
use super::pass::{ColumnBytes, decides_by_normals};
use super::placed::Placed;
use super::product::Product;
use super::shares::{Demands, Shares};
use super::survey::survey_bytes;
use crate::budget::{Bytes, Holders};
use crate::geom::nearest::Nearest;
use crate::report::Baseline;
use crate::stage::{BATCH, Needs};
use crate::store::{FATE_BYTES, Intake, Pieces, RecordState, SealedTiles, merge_bytes, ref_bytes};
use crate::tile::{Loader, Remote};

/// Positions or records that a thread must be able to hold: with fewer, rims outweigh tiles.
pub const FEWEST: usize = 16_384;
/// Records that a run has at most, unless the scan then has more runs than a merge likes.
const RUN_MOST: u64 = 1 << 19;
const RUNS: u64 = 64;
/// Stacks, allocator slack and decoder tables of a thread, and the same for the process.
const THREAD_OVERHEAD: Bytes = Bytes(3 << 20);
const PROCESS_OVERHEAD: Bytes = Bytes(6 << 20);
/// Of what encoders lease in a stream, one part of so many is touched.
const ENCODED: u64 = 4;
/// Fifths of a stream's queues that are in use.
const STREAMED: u64 = 3;

/// What is leased for outputs that arrange points.
const ARRANGING: &str = "arranging of points";
/// What is leased for what stages hold of the whole scan.
pub(super) const HELD_OF_SCAN: &str = "stages that need the whole scan";

/// Bytes that a stage that needs this holds of a scan of so many positions.
pub(super) fn held_of_scan(needs: &Needs, positions: u64) -> Bytes {
    Bytes::of(positions, needs.of_scan) + Bytes(needs.of_any_scan)
}

impl Demands {
    /// What the program holds whatever it does.
    pub fn base(&self) -> Holders {
        Holders::of([
            ("program", Bytes(self.resident) + PROCESS_OVERHEAD),
            ("overhead of threads", self.by_threads(THREAD_OVERHEAD)),
            ("lists of records by output", self.lists),
        ])
    }

    /// What a run with tiles holds from the decode on, beside the points that it keeps in memory.
    pub(super) fn index(&self) -> Holders {
        // That of the runs and that of the merged scan exist side by side for a moment.
        let index = SealedTiles::index_bytes(self.points);
        if !self.mills {
            return Holders::default();
        }
        let needs = self.passes.iter().flatten();
        let held: Bytes = needs.map(|needs| held_of_scan(needs, self.points)).sum();
        let held = (held > Bytes(0)).then_some((HELD_OF_SCAN, held));
        let index = [
            ("index of the sorted runs", index),
            ("index of the scan", index),
            ("table of stored pieces", self.tables()),
        ];
        let mesh = (self.connected > Bytes(0)).then_some(("triangulation", self.connected));
        Holders::of(index.into_iter().chain(held).chain(mesh))
    }

    /// Bytes of the tables of all that is stored by number; that of the order has gaps.
    fn tables(&self) -> Bytes {
        let order = ref_bytes(self.tagged);
        let states_and_fates = [size_of::<RecordState>(), FATE_BYTES].repeat(self.standings);
        let places = self.ranked.then_some(size_of::<u64>());
        let stores = [self.stride, order, order, self.columns.stored];
        let all = stores.into_iter().chain(states_and_fates).chain(places);
        all.map(|stride| Pieces::table_bytes(self.points, stride)).sum()
    }

    /// What all threads hold where each holds `each`.
    pub(super) fn by_threads(&self, each: Bytes) -> Bytes {
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
    pub(super) fn merge(&self, run_records: u64) -> Holders {
        // A thread leaves one run that is not full.
        let runs = (self.points / run_records.max(1)).saturating_add(self.threads as u64);
        let all = self.by_threads(merge_bytes(runs, self.stride));
        Holders::of([("merging of sorted runs", all)])
    }

    /// Bytes that an intake holds for each record.
    pub(super) fn intake(&self) -> Bytes {
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

    /// Records of a run beyond which a larger one gains nothing: it is sorted and gathered outside
    /// of the caches, and its memory is written to for the first time.
    pub(super) fn most_records(&self) -> u64 {
        RUN_MOST.max(self.points / RUNS).min(self.run_most.unwrap_or(u64::MAX)).max(1)
    }

    /// What the mill holds besides its tiles. Chunks that are cut wait in the outlet; one is open
    /// for every sink, that of the first among those that wait.
    fn outputs(&self) -> Holders {
        let (points, encoded) = (self.chunk.points as u64, Bytes(self.chunk.bytes));
        let chunk = Bytes::of(points, OutputChunk::BYTES_PER_RECORD + self.columns.row);
        let chunks = chunk * A_THREAD + chunk * self.other_sinks();
        let encoding =
            ChunkEncoder::bytes(points, self.stride, self.columns.row) + encoded * A_THREAD;
        let by_normals = self.passes.iter().flatten().any(decides_by_normals);
        let baseline = if by_normals { Baseline::BYTES } else { 0 };
        let filters = match self.filters {
            true => Filtering::bytes(self.stride, self.columns.row),
            false => Bytes(0),
        };
        let dimensions = match self.columns.of_records {
            true => Loader::dimension_bytes(self.stride),
            false => Bytes(0),
        };
        let milled = self.arranging.milled;
        let arranging = (milled > Bytes(0)).then_some((ARRANGING, milled));
        let all = [
            ("queue of chunks", self.by_threads(chunks)),
            ("encoding of chunks", self.by_threads(encoding)),
            ("comparison with grids", self.by_threads(Bytes(baseline))),
            ("search beyond tiles", self.by_threads(Bytes(Remote::BYTES))),
            ("streaming behind tiles", self.by_threads(filters)),
            ("reading of dimensions", self.by_threads(dimensions)),
        ];
        Holders::of(all.into_iter().chain(arranging))
    }

    fn other_sinks(&self) -> u64 {
        self.sinks.saturating_sub(1) as u64
    }

    /// What a stream holds. What waits is behind what is read and what is open, and one more of
    /// each is spare.
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

    /// True if the files of a split arrange points.
    fn arranges_split(&self) -> bool {
        self.arranging.of_split > Bytes(0)
    }

    /// What is held while the files of a split are written.
    pub fn splitting(&self) -> Holders {
        let writing = writing_bytes(self.chunk, self.stride + self.columns.row);
        let arranging = self.arranges_split().then_some((ARRANGING, self.arranging.of_split));
        let writing = ("writing of split files", self.by_threads(writing));
        Holders::of([writing].into_iter().chain(arranging))
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
        let ColumnBytes { tile, stored, row, .. } = self.columns;
        let places = if self.ranked { Product::PLACE_BYTES } else { 0 };
        let product = Product::BYTES_PER_POINT + stored + row + places;
        Bytes::from(Loader::BYTES_PER_POINT + sieve + tile) + Bytes::of(A_THREAD, product) + stages
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

    /// What is held while records are brought into the order of the inputs, behind the tiles of a
    /// pass.
    pub fn ordering(&self) -> Holders {
        let ordering = self.by_threads(ordering_bytes(self.points, self.columns.row));
        Holders::of([("ordering of records", ordering)]).with(&self.outputs())
    }

    /// The most that any phase holds.
    fn work(&self, run_records: u64, tile_positions: u64) -> Holders {
        let survey = Holders::of([("survey", self.by_threads(survey_bytes()))]);
        self.mill(self.threads, tile_positions)
            .larger(self.decode(run_records))
            .larger(self.merge(run_records))
            .larger(survey)
            .larger(if self.ranked { self.ordering() } else { Holders::default() })
            .larger(if self.arranges_split() { self.splitting() } else { Holders::default() })
    }

    /// The most memory that the process is expected to hold at once: what is leased less the parts
    /// of it that are seldom touched. Tiles are half as full as they may be, and of the buffers of
    /// outputs a quarter is in use; of a stream three fifths are, and packed chunks are a quarter
    /// of what they may be (three conversions of ten million points).
    pub fn expected_peak(&self, shares: &Shares) -> Bytes {
        let program = Bytes(self.resident);
        if !self.mills {
            let encoding = self.by_threads(Bytes(self.chunk.bytes) * A_THREAD).0;
            let others = self.stream().sum().0.saturating_sub(encoding);
            let encoding = if self.is_plain { encoding } else { encoding / ENCODED };
            return program + Bytes(others / 5 * STREAMED + encoding);
        }
        let points = self.points.max(1);
        let held = |most: usize| (most as u64).min(points.div_ceil(self.threads.max(1) as u64));
        let kept = Bytes(shares.kept_in_memory.min(self.standing_bytes()));
        let standing = program + SealedTiles::index_bytes(points) + kept;
        let decode = self.decode(held(shares.run_records)).sum();
        let tiles = self.tile_bytes_per_point() * held(shares.tile_positions / 2);
        let mill = self.by_threads(tiles) + Bytes(self.outputs().sum().0 / 4);
        standing + decode.max(mill)
    }

    pub(super) fn least(&self) -> Holders {
        match self.mills {
            true => self.work(self.fewest_records(), FEWEST as u64),
            false => self.stream(),
        }
    }
}
