//! How a run divides its memory: what it can tell before any work, as a pure function.

use crate::budget::{Bytes, whole_mebibytes};
use crate::stage::{Needs, Source};
use crate::tile::{Fetch, Intake, Loader, Remote, index_bytes};
use crate::{Error, Result, geom::nearest::Nearest};

/// Records that a batch of the decode takes.
pub const BATCH: usize = 8192;
/// Positions or records that a thread must be able to hold for the mill to be worth its name.
const FEWEST: usize = 16_384;
/// Working memory that a thread makes use of; more goes to keeping the scan in memory.
const THREAD_MOST: u64 = 192 << 20;
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
    /// Records that the sink takes at once, and bytes that encoding them holds.
    pub chunk: (usize, u64),
    /// What the tile stages need.
    pub ops: Vec<Needs>,
    /// True if the run needs tiles; else it streams, which needs no index.
    pub mills: bool,
}

/// The division.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shares {
    /// Not leased to anyone: the program itself.
    pub base: u64,
    /// Work of all threads: decode first, then the mill; or streaming.
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
    /// What a source demands, before its sink is known.
    pub fn of(
        source: &dyn Source,
        limit: u64,
        threads: usize,
        ops: Vec<Needs>,
        mills: bool,
    ) -> Self {
        let stride = source.schema().stride;
        Demands {
            limit,
            resident: crate::report::resident_now().unwrap_or(8 << 20),
            threads,
            stride,
            points: source.points(),
            part_bytes: source.part_bytes(),
            chunk: (50_000, 3 * 50_000 * stride as u64),
            ops,
            mills,
        }
    }

    fn base(&self) -> u64 {
        self.resident + PROCESS_OVERHEAD + self.threads as u64 * THREAD_OVERHEAD
    }

    /// Bytes that a thread holds while it decodes, besides its run.
    fn decode_fixed(&self) -> u64 {
        self.part_bytes + (BATCH * self.stride + Intake::fixed_bytes(self.stride)) as u64
    }

    /// Bytes that a thread holds in the mill, besides its tile: one chunk that it encodes and one
    /// that waits (of each position: first record, number of records, normal), and the records of
    /// the former with their numbers and normals.
    fn mill_fixed(&self) -> u64 {
        let (points, bytes) = self.chunk;
        let batch = points as u64 * (self.stride as u64 + 8 + 12);
        Remote::BYTES + 2 * (bytes + points as u64 * 28) + batch + Fetch::bytes(points, self.stride)
    }

    /// Bytes of a tile per position it holds, the product that it leaves behind included.
    pub fn tile_bytes_per_point(&self) -> usize {
        let search =
            if self.ops.iter().any(|n| n.neighbors > 0) { Nearest::BYTES_PER_POINT } else { 0 };
        let columns: usize = self.ops.iter().map(|n| n.bytes_per_point).sum();
        Loader::BYTES_PER_POINT + search + columns + 2 * PRODUCT_BYTES
    }

    /// Bytes that a thread holds while it streams: a batch that it reads and two that wait for their
    /// turn, a chunk that fills, one that waits and one that it encodes, and two that are encoded.
    fn stream_bytes(&self) -> u64 {
        let (points, bytes) = self.chunk;
        self.part_bytes + 3 * ((BATCH + points) * self.stride) as u64 + 2 * bytes
    }

    fn index(&self) -> u64 {
        // That of the runs and that of the merged scan exist side by side for a moment.
        if self.mills { index_bytes(self.points).saturating_mul(2) } else { 0 }
    }

    fn work(&self, run_records: u64, tile_positions: u64) -> u64 {
        if !self.mills {
            return self.threads as u64 * self.stream_bytes();
        }
        let decode =
            self.decode_fixed() + run_records * Intake::bytes_per_record(self.stride) as u64;
        (self.threads as u64 * decode).max(self.mill_work(tile_positions))
    }

    /// Bytes that all threads hold in the mill with tiles of `positions` positions, rim included.
    pub fn mill_work(&self, positions: u64) -> u64 {
        let tile = positions.saturating_mul(self.tile_bytes_per_point() as u64);
        (self.threads as u64).saturating_mul(self.mill_fixed().saturating_add(tile))
    }

    /// How many positions each thread's tile holds where all of them have `work` bytes.
    pub fn tile_positions(&self, work: u64) -> usize {
        let tile = (work / self.threads.max(1) as u64).saturating_sub(self.mill_fixed());
        (tile / self.tile_bytes_per_point().max(1) as u64) as usize
    }

    /// Divides the limit; an error names the one that would do.
    pub fn divide(&self) -> Result<Shares> {
        let least = self.work(FEWEST as u64, FEWEST as u64);
        let base = self.base();
        let needed = base.saturating_add(self.index()).saturating_add(least);
        let Some(spare) = self.limit.checked_sub(needed) else {
            return Err(Error::memory(format!(
                "a memory budget of {} is too small: {} threads on records of {} bytes{} need {}",
                Bytes(self.limit),
                self.threads,
                self.stride,
                match self.mills {
                    true => format!(" and an index of {} points", self.points),
                    false => String::new(),
                },
                Bytes(needed)
            ))
            .help(format!(
                "give --memory {} or more, or fewer --threads",
                whole_mebibytes(needed)
            )));
        };
        let most = if self.mills { (THREAD_MOST * self.threads as u64).max(least) } else { least };
        let work = (least + spare / 4 * 3).min(most);
        let run = (work / self.threads as u64).saturating_sub(self.decode_fixed());
        Ok(Shares {
            base,
            work,
            index: self.index(),
            kept_in_memory: least + spare - work,
            run_records: (run / Intake::bytes_per_record(self.stride) as u64) as usize,
            tile_positions: self.tile_positions(work),
        })
    }
}

/// Bytes that a tile leaves behind for each of its positions: what is kept, its normal, its fate.
const PRODUCT_BYTES: usize = 16 + 12 + 4;

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
            chunk: (50_000, 4_500_000),
            ops: vec![Needs { neighbors: 10, bytes_per_point: 40, ..Needs::default() }],
            mills: true,
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
    fn a_stream_needs_no_index_however_many_points_there_are() {
        let endless = Demands { mills: false, points: u64::MAX, ..demands(64 << 20) };
        let shares = endless.divide().unwrap();
        assert_eq!(shares.index, 0);
        assert!(shares.base + shares.work <= 64 << 20);
        let needs_index = Demands { mills: true, ..endless };
        assert!(needs_index.divide().is_err(), "and no sum overflows");
    }

    #[test]
    fn tiles_take_what_their_work_allows() {
        let demands = demands(1 << 30);
        for positions in [0, 1, 20_000, 5_000_000] {
            let work = demands.mill_work(positions as u64);
            assert_eq!(demands.tile_positions(work), positions);
        }
        assert_eq!(demands.tile_positions(0), 0);
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
