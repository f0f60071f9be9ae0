//! One output that is split into files: by squares of the plane, by values of a dimension, by so
//! many points or bytes; for whoever works on a scan piece by piece.
//!
//! Which files there are is known when the last record was read, and of thousands of files each
//! cannot be open. So records are set down by file as they come, a few in memory and the rest in
//! the spill; behind the last, a file is an item, and is written from begin to end by one thread.
//! The stages before know nothing of it: to them this is one output.
//!
//! How often a file's records are set down depends on the order of the input, and may be often.
//! What is where is therefore not listed in memory: each stretch of a file begins with the place of
//! the one before it.

mod sorter;

use std::collections::{BTreeMap, HashSet};
use std::ffi::OsStr;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use super::arranged::ground;
use super::job::Job;
use super::publish::{Staged, folder_of};
use super::row::RowLayout;
use crate::budget::Bytes;
use crate::error::shown;
use crate::geom::lattice::Lattice;
use crate::host::lock;
use crate::point::{Bounds, Metadata, PointBatch, Position, Schema};
use crate::report::Grouped;
use crate::stage::{
    ChunkSize, CreateSink, Encode, Encoded, Extent, OutputSplit, Sink, SinkSummary, SplitKey,
};
use crate::store::{RecordState, Spill, StoredStretch};
use crate::{Error, Result};
use sorter::{NextPlace, SplitSorter, by_time, measured};

/// Files that an output is split into at most.
pub(crate) const MOST_FILES: usize = 16_384;
/// Bytes of records that wait in memory, of all files.
const OPEN_BYTES: usize = 8 << 20;
/// Bytes of a stretch at most.
const STRETCH: usize = 256 << 10;

/// The records of one file that were not yet stored, and the last stretch of the others.
#[derive(Debug, Default)]
struct SplitList {
    open: Vec<u8>,
    last: Option<StoredStretch>,
    records: u64,
    /// The box of its records, where files arrange them.
    bounds: Bounds,
}

/// The records that an output gets, by file; within one they stay in their order.
pub(crate) struct BySplit {
    split: OutputSplit,
    sorter: SplitSorter,
    schema: Arc<Schema>,
    layout: RowLayout,
    /// What files arrange their points on, if they do.
    ground: Option<Lattice>,
    spill: Spill,
    lists: Mutex<SplitLists>,
}

#[derive(Default)]
struct SplitLists {
    files: BTreeMap<SplitKey, SplitList>,
    /// Bytes that wait in memory.
    open: usize,
}

/// A file of a split, where it grew, what it was given and what it said.
pub(crate) struct SplitFile {
    pub path: PathBuf,
    pub staged: Staged,
    pub given: u64,
    pub summary: SinkSummary,
}

/// Bytes that the lists of one output hold.
pub(crate) fn lists_bytes() -> Bytes {
    // A vector that grows has up to twice what is in it.
    let list = size_of::<SplitKey>() + 2 * size_of::<SplitList>();
    Bytes::from(2 * OPEN_BYTES) + Bytes::of(MOST_FILES as u64, list)
}

/// Bytes that a thread holds while it writes a file of a split, in chunks of this size whose
/// records take `record` bytes.
pub(crate) fn writing_bytes(chunk: ChunkSize, record: usize) -> Bytes {
    let records = Bytes::of(chunk.points as u64, record);
    records * 2 + Bytes(chunk.bytes) + Bytes::from(2 * STRETCH)
}

impl BySplit {
    /// Without a record, for sink `sink` that is split like this and has chunks with rows like
    /// these.
    pub fn new(job: &Job<'_>, sink: usize, split: &OutputSplit, layout: RowLayout) -> Result<Self> {
        let schema = job.task.schema().clone();
        let missing = || Error::internal("records lack what they are split by");
        let sorter = match split {
            OutputSplit::Squares(side) => {
                let [x, y, _] = schema.coordinates().ok_or_else(missing)?;
                SplitSorter::Square([x.clone(), y.clone()], *side)
            }
            OutputSplit::Values(name) => {
                SplitSorter::Value(schema.find(name).ok_or_else(missing)?.clone())
            }
            OutputSplit::Points(points) => SplitSorter::Points(*points),
            OutputSplit::Bytes(bytes) => measured(job, sink, split, *bytes)?,
        };
        let ground = ground(job, &*job.task.sinks[sink], &job.task.metadata(sink, None))?;
        let (spill, split) = (Spill::new(&job.area, "split"), split.clone());
        Ok(BySplit { split, sorter, schema, layout, ground, spill, lists: Mutex::default() })
    }

    /// Bytes of a record with its row.
    fn entry(&self) -> usize {
        self.schema.stride + self.layout.bytes()
    }

    /// Takes `entries`, records of the file `key` each with its row, and where they are off the
    /// front of `places`.
    fn take(&self, key: SplitKey, entries: &[u8], places: &mut &[Position]) -> Result<()> {
        let lists = &mut *lock(&self.lists);
        let full = lists.files.len() >= MOST_FILES;
        if full && !lists.files.contains_key(&key) {
            let told = format!("more than {MOST_FILES} {}", self.split.told());
            return Err(Error::pipeline(told).help(self.split.remedy()));
        }
        let list = lists.files.entry(key).or_default();
        list.open.extend_from_slice(entries);
        let records = entries.len() / self.entry();
        list.records += records as u64;
        let (of_these, later) = places.split_at(places.len().min(records));
        of_these.iter().for_each(|at| list.bounds.add(*at));
        *places = later;
        lists.open += entries.len();
        if lists.open > OPEN_BYTES {
            lists.files.values_mut().try_for_each(|list| self.store(list))?;
            lists.open = 0;
        }
        Ok(())
    }

    /// Stores what waits of a file, and gives its memory back.
    fn store(&self, list: &mut SplitList) -> Result<()> {
        let open = std::mem::take(&mut list.open);
        let room = (STRETCH / self.entry()).max(1) * self.entry();
        for entries in open.chunks(room) {
            let mut stretch = StoredStretch::link(list.last).to_vec();
            stretch.extend_from_slice(entries);
            list.last = Some(self.spill.store(&stretch)?);
        }
        Ok(())
    }

    /// Calls `visit` with the records of a file and their rows, stretch by stretch.
    fn each(&self, list: &SplitList, mut visit: impl FnMut(&[u8]) -> Result<()>) -> Result<()> {
        let (mut chain, mut next, mut bytes) = (Vec::new(), list.last, Vec::new());
        while let Some(stretch) = next {
            chain.push(stretch);
            self.spill.load(&stretch, &mut bytes)?;
            next = StoredStretch::linked(&bytes)?;
        }
        for stretch in chain.iter().rev() {
            self.spill.load(stretch, &mut bytes)?;
            visit(&bytes[StoredStretch::LINK..])?;
        }
        visit(&list.open)
    }

    /// Writes all files, each thread one at a time.
    pub fn write(&self, job: &Job<'_>, sink: usize) -> Result<Vec<SplitFile>> {
        let lists = lock(&self.lists);
        let missing = || Error::internal("an output that is split has no place");
        let beside = job.outputs[sink].first().ok_or_else(missing)?;
        let create = &job.task.sinks[sink];
        let (mut sinks, mut staged) = (Vec::new(), Vec::new());
        for key in lists.files.keys() {
            let create = create.of_split(*key, &self.split)?;
            staged.push(beside.in_same_folder(create.path())?);
            sinks.push(create);
        }
        let lists: Vec<&SplitList> = lists.files.values().collect();
        let mut said: Vec<SinkSummary> = Vec::with_capacity(lists.len());
        job.items(lists.len()).run(
            || (),
            |(), n| {
                let written = self.write_one(job, sink, (&*sinks[n], &staged[n]), lists[n]);
                written.map_err(|error| staged[n].tell(error))
            },
            |summary| said.push(summary),
            |()| Ok(()),
        )?;
        let each = sinks.iter().zip(staged).zip(lists).zip(said);
        let mut files = Vec::with_capacity(sinks.len());
        for (((create, staged), list), summary) in each {
            let path = create.path().to_owned();
            files.push(SplitFile { path, staged, given: list.records, summary });
        }
        Ok(files)
    }

    /// Records of all files.
    pub fn records(&self) -> u64 {
        lock(&self.lists).files.values().map(|list| list.records).sum()
    }

    /// Where the records of a batch are; nothing where no file arranges them. One that has no place
    /// is told when its file is written.
    fn places(&self, batch: &PointBatch) -> Vec<Position> {
        let Some(lattice) = &self.ground else { return Vec::new() };
        let mut places = vec![[0; 3]; batch.len()];
        lattice.place(batch.schema(), batch.records(), |i, at| places[i] = at, |_, _| {});
        places
    }

    fn write_one(
        &self,
        job: &Job<'_>,
        number: usize,
        (create, staged): (&dyn CreateSink, &Staged),
        list: &SplitList,
    ) -> Result<SinkSummary> {
        let task = job.task;
        let note = job.note(number, create.path());
        let metadata = Metadata { note, ..task.metadata(number, Some(task.pipeline(number))) };
        let mut sink = create.create(staged.file(), &self.schema, &metadata, false)?;
        let (points, encoder) = (sink.chunk_points(), sink.encoder());
        let by_time = by_time(job, number, create);
        let mut batch = PointBatch::new(self.schema.clone(), points);
        if let Some(lattice) = &self.ground {
            sink.arrange(&Extent::new(lattice.clone(), list.bounds))?;
        }
        let mut rows = Vec::new();
        let mut append = |batch: &mut PointBatch, rows: &mut Vec<u8>| {
            let written = batch.len();
            if self.layout.bytes() > 0 {
                batch.columns = self.layout.spread(rows, std::iter::repeat_n(1, written));
            }
            if let Some(by_time) = &by_time {
                by_time.sort(batch, &mut vec![RecordState::ALIVE; written]);
            }
            sink.append(encoder.encode(batch)?)?;
            batch.clear();
            rows.clear();
            job.advance(written as u64)
        };
        self.each(list, |entries| {
            entries.chunks_exact(self.entry()).try_for_each(|entry| {
                let (record, row) = entry.split_at(self.schema.stride);
                batch.extend(record);
                rows.extend_from_slice(row);
                if batch.len() < points { Ok(()) } else { append(&mut batch, &mut rows) }
            })
        })?;
        if !batch.is_empty() {
            append(&mut batch, &mut rows)?;
        }
        let summary = sink.finish()?;
        match self.split {
            OutputSplit::Bytes(most) if summary.bytes > most => {
                let told = format!("a file takes {} bytes, more than {most}", summary.bytes);
                Err(Error::internal(told).at(create.path()))
            }
            _ => Ok(summary),
        }
    }
}

/// What to say of files whose names are those of files of a split, and which are not among those
/// that were `written`.
pub(crate) fn others_of_split(create: &dyn CreateSink, written: &[PathBuf]) -> Option<String> {
    let written: HashSet<&OsStr> = written.iter().filter_map(|path| path.file_name()).collect();
    let there = std::fs::read_dir(folder_of(create.path())).ok()?.flatten();
    let others = there.map(|entry| entry.path()).filter(|path| {
        let is_written = path.file_name().is_some_and(|name| written.contains(name));
        !is_written && create.may_name(path)
    });
    let mut others: Vec<PathBuf> = others.collect();
    others.sort();
    let more = match others.len() {
        0 => return None,
        all @ 4.. => format!(" and {} more", Grouped(all as u64 - 3)),
        _ => String::new(),
    };
    let first: Vec<String> = others.iter().take(3).map(|path| shown(path).to_string()).collect();
    Some(format!(
        "files of another run are left beside those of this one: {}{more}; remove them if they are \
         of an earlier split",
        first.join(", ")
    ))
}

/// What stages see of an output of files: one sink, which takes records as they come.
pub(crate) struct SplitSink {
    files: Arc<BySplit>,
    chunk: ChunkSize,
    next: NextPlace,
    given: u64,
}

impl SplitSink {
    /// The sink that sets records down in `files`, in chunks of this size.
    pub fn new(files: Arc<BySplit>, chunk: ChunkSize) -> Self {
        SplitSink { files, chunk, next: NextPlace::default(), given: 0 }
    }
}

/// Bytes of an encoded group of records before its entries: its file, or what the chunk takes, and
/// their length.
const GROUP: usize = 3 * size_of::<u64>();

impl Sink for SplitSink {
    fn chunk_points(&self) -> usize {
        self.chunk.points
    }

    fn chunk_bytes(&self) -> u64 {
        self.chunk.bytes
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        Arc::new(SplitEncoder(self.files.clone()))
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        let (mut rest, mut places) = (&chunk.bytes[..], &chunk.places[..]);
        while let Some((head, more)) = rest.split_at_checked(GROUP) {
            let word = |n: usize| {
                let mut bytes = [0; 8];
                bytes.copy_from_slice(&head[n * 8..(n + 1) * 8]);
                i64::from_le_bytes(bytes)
            };
            let (entries, more) = more.split_at(word(2) as usize);
            let files = &self.files;
            match files.sorter.is_by_place() {
                false => files.take([word(0), word(1)], entries, &mut places)?,
                true => {
                    let each = (entries, files.entry());
                    let (sorter, measured) = (&files.sorter, word(0) as u64);
                    let take = |key, some| files.take(key, some, &mut places);
                    self.next.put(sorter, each, measured, take)?;
                }
            }
            rest = more;
        }
        self.given += chunk.points;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<SinkSummary> {
        Ok(SinkSummary::new(self.given, 0))
    }
}

/// Sorts the records of a chunk by file; runs on all threads.
struct SplitEncoder(Arc<BySplit>);

impl Encode for SplitEncoder {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let (files, schema) = (&self.0, batch.schema());
        let columns: Vec<(&[u8], usize)> = (files.layout.kinds().iter())
            .map(|kind| {
                let values = batch.columns.bytes_of(*kind);
                let missing = || Error::internal("a column of an output that is split is missing");
                Ok((values.ok_or_else(missing)?, kind.bytes()))
            })
            .collect::<Result<_>>()?;
        let measured = [files.sorter.measure(batch)? as i64, 0];
        let places = files.places(batch);
        let mut groups: BTreeMap<SplitKey, (Vec<u8>, Vec<Position>)> = BTreeMap::new();
        for (i, record) in batch.iter().enumerate() {
            let key = files.sorter.key(record, schema.endian)?.unwrap_or(measured);
            let (group, places_of_group) = groups.entry(key).or_default();
            places_of_group.extend(places.get(i));
            group.extend_from_slice(record);
            columns.iter().for_each(|(values, size)| {
                group.extend_from_slice(&values[i * size..(i + 1) * size]);
            });
        }
        let mut bytes = Vec::with_capacity(batch.len() * files.entry() + GROUP * groups.len());
        let mut sorted = Vec::with_capacity(places.len());
        for ([a, b], (entries, places)) in groups {
            sorted.extend(places);
            bytes.extend_from_slice(&a.to_le_bytes());
            bytes.extend_from_slice(&b.to_le_bytes());
            bytes.extend_from_slice(&(entries.len() as i64).to_le_bytes());
            bytes.extend_from_slice(&entries);
        }
        Ok(Encoded { places: sorted, ..Encoded::new(bytes, batch.len() as u64) })
    }
}
