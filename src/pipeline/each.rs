//! One output for each input: while tiles leave their products the records that an output gets are
//! sorted by input, and behind the last tile each input's file is written, a file a thread.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::chunks::{Chunk, Open};
use super::grind::{Bench, Benches};
use super::job::Job;
use super::product::Entry;
use super::publish::Staged;
use crate::point::Metadata;
use crate::report::Tally;
use crate::stage::{CreateSink, Input, SinkSummary};
use crate::tile::{SealedTiles, Spill, SpillArea, State, Stretch, Tag, lock};
use crate::{Error, Result};
use std::sync::Arc;

/// Bytes that all lists of records hold in memory before they go to the spill.
pub const LISTS_BYTES: usize = 8 << 20;
/// What the list of one input holds at least and at most.
const LIST: (usize, usize) = (512, 64 << 10);
/// Bytes of an entry of a list: number, count, state; a normal if there is one.
const ENTRY: usize = 8 + 4 + 1;
const NORMAL: usize = 12;

/// The rank of each input by its name: what tells equal records of two inputs apart, so that the
/// order in which inputs are named decides nothing.
pub fn ranks(inputs: &[Input]) -> Vec<u32> {
    let mut order: Vec<usize> = (0..inputs.len()).collect();
    order.sort_by_key(|&i| (inputs[i].path.file_name(), &inputs[i].path));
    let mut ranks = vec![0; inputs.len()];
    for (rank, i) in order.into_iter().enumerate() {
        ranks[i] = u32::try_from(rank).unwrap_or(u32::MAX);
    }
    ranks
}

/// Bytes that sorting by so many inputs holds.
pub fn lists_bytes(inputs: usize) -> u64 {
    let each = (list_bytes(inputs) + size_of::<List>()) as u64;
    (inputs as u64).saturating_mul(each)
}

fn list_bytes(inputs: usize) -> usize {
    (LISTS_BYTES / inputs.max(1)).clamp(LIST.0, LIST.1)
}

/// The records of one input that were not yet stored, and where the others are.
#[derive(Debug, Default)]
struct List {
    open: Vec<u8>,
    stretches: Vec<Stretch>,
    records: u64,
}

/// The records that an output gets, sorted by input; within one they stay in their order.
pub(super) struct ByInput {
    /// Which output.
    pub sink: usize,
    wants_normals: bool,
    /// True if it takes what was there before the pass.
    before: bool,
    spill: Spill,
    lists: Vec<List>,
    list_bytes: usize,
}

impl ByInput {
    /// Output `sink`, for so many inputs, without a record.
    pub fn new(
        area: &Arc<SpillArea>,
        sink: usize,
        inputs: usize,
        wants_normals: bool,
        before: bool,
    ) -> Self {
        let spill = Spill::new(area, "inputs");
        let mut lists = Vec::new();
        lists.resize_with(inputs, List::default);
        ByInput { sink, wants_normals, before, spill, lists, list_bytes: list_bytes(inputs) }
    }

    /// Takes what becomes of an entry.
    pub fn take(&mut self, entry: &Entry, normal: Option<[f32; 3]>) -> Result<()> {
        let state = if self.before { entry.was } else { entry.now };
        if !state.is_written() {
            return Ok(());
        }
        let rank = entry.tag.input(self.lists.len()) as usize;
        let list = self.lists.get_mut(rank).ok_or_else(|| {
            Error::internal(format!("a record of input {rank} came, which there is not"))
        })?;
        list.open.extend_from_slice(&entry.number.to_le_bytes());
        list.open.extend_from_slice(&entry.count.to_le_bytes());
        list.open.push(state.0);
        if self.wants_normals {
            let normal = normal.unwrap_or([f32::NAN; 3]);
            normal.iter().for_each(|v| list.open.extend_from_slice(&v.to_le_bytes()));
        }
        list.records += u64::from(entry.count);
        if list.open.len() + ENTRY + NORMAL > self.list_bytes {
            list.stretches.push(self.spill.store(&list.open)?);
            list.open.clear();
        }
        Ok(())
    }

    /// Calls `visit` with the entries of the input of `rank`, in canonical order.
    fn each(
        &self,
        rank: usize,
        mut visit: impl FnMut(&Entry, Option<[f32; 3]>) -> Result<()>,
    ) -> Result<()> {
        let Some(list) = self.lists.get(rank) else { return Ok(()) };
        let mut bytes = Vec::new();
        let mut visit_all = |bytes: &[u8]| {
            let size = if self.wants_normals { ENTRY + NORMAL } else { ENTRY };
            bytes.chunks_exact(size).try_for_each(|item| {
                let (entry, normal) = unpack(item);
                visit(&entry, normal)
            })
        };
        for stretch in &list.stretches {
            self.spill.load(stretch, &mut bytes)?;
            visit_all(&bytes)?;
        }
        visit_all(&list.open)
    }

    /// Records of all inputs.
    pub fn records(&self) -> u64 {
        self.lists.iter().map(|list| list.records).sum()
    }
}

/// An entry as stored, and its normal if there is one.
fn unpack(item: &[u8]) -> (Entry, Option<[f32; 3]>) {
    let field = |at: usize| {
        let mut bytes = [0; 4];
        bytes.copy_from_slice(&item[at..at + 4]);
        bytes
    };
    let word = |at| u32::from_le_bytes(field(at));
    let state = State(item[12]);
    let number = u64::from(word(0)) | u64::from(word(4)) << 32;
    let entry = Entry { number, count: word(8), tag: Tag::default(), was: state, now: state };
    let normal =
        (item.len() > ENTRY).then(|| [0, 4, 8].map(|at| f32::from_le_bytes(field(ENTRY + at))));
    (entry, normal)
}

/// The outputs of all inputs, in the order of these, and where they grow.
pub(super) struct Each<'a> {
    pub sinks: &'a [Box<dyn CreateSink>],
    pub staged: &'a [Staged],
    pub ranks: &'a [u32],
    /// Records of a chunk.
    pub chunk_points: usize,
}

impl Each<'_> {
    /// Writes every input's output, each thread one at a time; for each input, the records that its
    /// output was given and what it said. `counted` if classes are counted by these records.
    pub fn write(
        &self,
        job: &Job<'_>,
        tiles: &SealedTiles,
        records: &ByInput,
        counted: bool,
    ) -> Result<(Vec<(u64, SinkSummary)>, Tally)> {
        let next = AtomicUsize::new(0);
        let done = Mutex::new((BTreeMap::new(), Tally::default()));
        job.parallel(|| {
            let mut bench = Bench::new(job, self.chunk_points);
            loop {
                let input = next.fetch_add(1, Ordering::Relaxed);
                if input >= self.sinks.len() {
                    break;
                }
                job.advance(0)?;
                let summary = self.write_one(job, tiles, records, input, &mut bench, counted)?;
                lock(&done).0.insert(input, summary);
            }
            lock(&done).1.merge(&bench.tally);
            Ok(())
        })?;
        let (written, tally) = std::mem::take(&mut *lock(&done));
        Ok((written.into_values().collect(), tally))
    }

    fn write_one(
        &self,
        job: &Job<'_>,
        tiles: &SealedTiles,
        records: &ByInput,
        input: usize,
        bench: &mut Bench,
        counted: bool,
    ) -> Result<(u64, SinkSummary)> {
        let missing = || Error::internal(format!("input {input} has no output"));
        let create = self.sinks.get(input).ok_or_else(missing)?;
        let staged = self.staged.get(input).ok_or_else(missing)?;
        let rank = *self.ranks.get(input).ok_or_else(missing)? as usize;
        let pipeline = Some(job.pipeline.clone());
        let metadata = Metadata { pipeline, ..job.source.metadata_of(input)? };
        let mut sink = create.create(staged.file(), job.source.schema(), &metadata, false)?;
        let benches = Benches::of_one(job, tiles, &*sink, counted, create.likes_time());
        let mut open = Open::new(0, sink.chunk_points(), records.wants_normals, false);
        let (mut given, mut full) = (0, Vec::new());
        let mut append = |chunk: Chunk| {
            let (_, encoded) = bench.encode(&benches, &chunk)?;
            sink.append(encoded)?;
            job.advance(0)
        };
        records.each(rank, |entry: &Entry, normal| {
            given += u64::from(entry.count);
            open.take(entry, normal, &mut full);
            full.drain(..).try_for_each(&mut append)
        })?;
        open.rest().map_or(Ok(()), append)?;
        Ok((given, sink.finish()?))
    }
}

/// The paths of outputs in a folder, to be compared with other outputs.
pub fn paths(sinks: &[Box<dyn CreateSink>]) -> impl Iterator<Item = PathBuf> + '_ {
    sinks.iter().map(|sink| sink.path().to_owned())
}
