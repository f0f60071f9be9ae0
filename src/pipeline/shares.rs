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
}

/// The division.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shares {
    /// Not leased to anyone: the program itself.
    pub base: u64,
    /// Work of all threads: decode first, then the mill.
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
    pub fn of(source: &dyn Source, limit: u64, threads: usize, ops: Vec<Needs>) -> Self {
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

    fn index(&self) -> u64 {
        // That of the runs and that of the merged scan exist side by side for a moment.
        2 * index_bytes(self.points)
    }

    fn work(&self, run_records: u64, tile_positions: u64) -> u64 {
        let decode =
            self.decode_fixed() + run_records * Intake::bytes_per_record(self.stride) as u64;
        let mill = self.mill_fixed() + tile_positions * self.tile_bytes_per_point() as u64;
        self.threads as u64 * decode.max(mill)
    }

    /// The limit that would do for tiles of `positions` positions, rim included.
    pub fn limit_for_tile(&self, positions: u64) -> u64 {
        (self.base() + self.index() + self.work(FEWEST as u64, positions)) * 21 / 20
    }

    /// Divides the limit; an error names the one that would do.
    pub fn divide(&self) -> Result<Shares> {
        let least = self.work(FEWEST as u64, FEWEST as u64);
        let base = self.base();
        let needed = base + self.index() + least;
        let Some(spare) = self.limit.checked_sub(needed) else {
            return Err(Error::memory(format!(
                "a memory budget of {} is too small: {} threads on records of {} bytes and an index \
                 of {} points need {}",
                Bytes(self.limit), self.threads, self.stride, self.points, Bytes(needed)
            ))
            .help(format!("give --memory {} or more, or fewer --threads", whole_mebibytes(needed))));
        };
        let most = (THREAD_MOST * self.threads as u64).max(least);
        let work = (least + spare / 4 * 3).min(most);
        let share = work / self.threads as u64;
        let fit =
            |fixed: u64, each: usize| (share.saturating_sub(fixed) / each.max(1) as u64) as usize;
        Ok(Shares {
            base,
            work,
            index: self.index(),
            kept_in_memory: least + spare - work,
            run_records: fit(self.decode_fixed(), Intake::bytes_per_record(self.stride)),
            tile_positions: fit(self.mill_fixed(), self.tile_bytes_per_point()),
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
    fn a_refusal_names_a_limit_that_does() {
        let error = demands(32 << 20).divide().unwrap_err();
        let help = error.remedy().unwrap().to_owned();
        let mebibytes: u64 =
            help.split_once("--memory ").unwrap().1.split_once("MiB").unwrap().0.parse().unwrap();
        assert!(demands(mebibytes << 20).divide().is_ok(), "{help}");
        assert!(demands((mebibytes - 2) << 20).divide().is_err(), "{help}");
    }
}
