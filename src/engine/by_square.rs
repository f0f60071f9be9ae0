//! One output for each square of the plane: tiles as files, for whoever works on a scan piece by
//! piece.
//!
//! Which squares have points is known when the last of them was read, and of thousands of squares
//! a file each cannot be open. So records are set down by square as they come, a few in memory and
//! the rest in the spill; behind the last, a square is an item, and its file is written from begin
//! to end by one thread. The stages before know nothing of it: to them this is one output.
//!
//! How often a square sets records down depends on the order of the input, and may be often. What
//! is where is therefore not listed in memory: each stretch of a square begins with the place of
//! the one before it.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use super::by_time::ByTime;
use super::job::Job;
use super::publish::Staged;
use super::row::RowLayout;
use crate::budget::Bytes;
use crate::host::lock;
use crate::point::{Dimension, Metadata, PointBatch, Schema};
use crate::stage::{ChunkSize, CreateSink, Encode, Encoded, Sink, SinkSummary};
use crate::store::{RecordState, Spill, SpillArea, StoredStretch};
use crate::{Error, Result};

/// The column and the row of a square: how many sides it is from the origin of the coordinates.
pub(crate) type SquareKey = [i64; 2];

/// Squares with points that an output has at most.
pub(crate) const MOST_SQUARES: usize = 16_384;
/// Bytes of records that wait in memory, of all squares.
const OPEN_BYTES: usize = 8 << 20;
/// Bytes of a stretch at most.
const STRETCH: usize = 256 << 10;
/// Sides from the origin at most: whole numbers are exact in a `f64` up to here.
const FARTHEST: f64 = (1u64 << 52) as f64;
/// What sides are short of a whole number by, at most, if they are it: decimals are seldom exact in
/// binary, and 0.3 lies on the border of squares of 0.1.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// The records of one square that were not yet stored, and the last stretch of the others.
#[derive(Debug, Default)]
struct SquareList {
    open: Vec<u8>,
    last: Option<StoredStretch>,
    records: u64,
}

/// The records that an output gets, by square; within one they stay in their order.
pub(crate) struct BySquare {
    side: f64,
    schema: Arc<Schema>,
    layout: RowLayout,
    spill: Spill,
    lists: Mutex<SquareLists>,
}

#[derive(Default)]
struct SquareLists {
    squares: BTreeMap<SquareKey, SquareList>,
    /// Bytes that wait in memory.
    open: usize,
}

/// A file of a square, where it grew, what it was given and what it said.
pub(crate) struct SquareFile {
    pub path: PathBuf,
    pub staged: Staged,
    pub given: u64,
    pub summary: SinkSummary,
}

/// Bytes that the lists of one output hold.
pub(crate) fn lists_bytes() -> Bytes {
    // A vector that grows has up to twice what is in it.
    let list = size_of::<SquareKey>() + 2 * size_of::<SquareList>();
    Bytes::from(2 * OPEN_BYTES) + Bytes::of(MOST_SQUARES as u64, list)
}

/// Bytes that a thread holds while it writes the file of a square, in chunks of this size whose
/// records take `record` bytes.
pub(crate) fn writing_bytes(chunk: ChunkSize, record: usize) -> Bytes {
    let records = Bytes::of(chunk.points as u64, record);
    records * 2 + Bytes(chunk.bytes) + Bytes::from(2 * STRETCH)
}

impl BySquare {
    /// Without a record; `side` is that of the squares, in world units.
    pub fn new(area: &Arc<SpillArea>, side: f64, schema: &Arc<Schema>, layout: RowLayout) -> Self {
        let (spill, schema) = (Spill::new(area, "squares"), schema.clone());
        BySquare { side, schema, layout, spill, lists: Mutex::default() }
    }

    /// The square of a position.
    fn square(&self, position: [f64; 2]) -> Result<SquareKey> {
        let mut square = [0; 2];
        for (at, v) in square.iter_mut().zip(position) {
            let sides = v / self.side;
            let number = (sides + sides.abs() * ROUNDING).floor();
            let is_near = number.abs() < FARTHEST;
            if !is_near {
                let told = format!("the point at {position:?} lies in no square of {}", self.side);
                return Err(Error::pipeline(told).help("give a larger `write.side`"));
            }
            *at = number as i64;
        }
        Ok(square)
    }

    /// Bytes of a record with its row.
    fn entry(&self) -> usize {
        self.schema.stride + self.layout.bytes()
    }

    /// Takes `entries`, records of `square` each with its row.
    fn take(&self, square: SquareKey, entries: &[u8]) -> Result<()> {
        let lists = &mut *lock(&self.lists);
        let full = lists.squares.len() >= MOST_SQUARES;
        if full && !lists.squares.contains_key(&square) {
            let told = format!("more than {MOST_SQUARES} squares of {} have points", self.side);
            return Err(Error::pipeline(told).help("give a larger `write.side`"));
        }
        let list = lists.squares.entry(square).or_default();
        list.open.extend_from_slice(entries);
        list.records += (entries.len() / self.entry()) as u64;
        lists.open += entries.len();
        if lists.open > OPEN_BYTES {
            lists.squares.values_mut().try_for_each(|list| self.store(list))?;
            lists.open = 0;
        }
        Ok(())
    }

    /// Stores what waits of a square, and gives its memory back.
    fn store(&self, list: &mut SquareList) -> Result<()> {
        let open = std::mem::take(&mut list.open);
        let room = (STRETCH / self.entry()).max(1) * self.entry();
        for entries in open.chunks(room) {
            let mut stretch = StoredStretch::link(list.last).to_vec();
            stretch.extend_from_slice(entries);
            list.last = Some(self.spill.store(&stretch)?);
        }
        Ok(())
    }

    /// Calls `visit` with the records of a square and their rows, stretch by stretch.
    fn each(&self, list: &SquareList, mut visit: impl FnMut(&[u8]) -> Result<()>) -> Result<()> {
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

    /// Writes the files of all squares, each thread one at a time.
    pub fn write(&self, job: &Job<'_>, sink: usize) -> Result<Vec<SquareFile>> {
        let lists = lock(&self.lists);
        let missing = || Error::internal("an output of squares has no place");
        let beside = job.outputs[sink].first().ok_or_else(missing)?;
        let create = &job.task.sinks[sink];
        let (mut sinks, mut staged) = (Vec::new(), Vec::new());
        for square in lists.squares.keys() {
            let create = create.of_square(*square, self.side)?;
            staged.push(beside.in_same_folder(create.path())?);
            sinks.push(create);
        }
        let lists: Vec<&SquareList> = lists.squares.values().collect();
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
            files.push(SquareFile { path, staged, given: list.records, summary });
        }
        Ok(files)
    }

    /// Records of all squares.
    pub fn records(&self) -> u64 {
        lock(&self.lists).squares.values().map(|list| list.records).sum()
    }

    fn write_one(
        &self,
        job: &Job<'_>,
        number: usize,
        (create, staged): (&dyn CreateSink, &Staged),
        list: &SquareList,
    ) -> Result<SinkSummary> {
        let task = job.task;
        let note = job.note(number, create.path());
        let metadata = Metadata { note, ..task.metadata(number, Some(task.pipeline(number))) };
        let mut sink = create.create(staged.file(), &self.schema, &metadata, false)?;
        let (points, encoder) = (sink.chunk_points(), sink.encoder());
        let in_chunks = task.mills && !task.in_input_order[number] && create.likes_time();
        let by_time = in_chunks.then(|| ByTime::of(&self.schema)).flatten();
        let mut batch = PointBatch::new(self.schema.clone(), points);
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
        sink.finish()
    }
}

/// What stages see of an output of squares: one sink, which takes records as they come.
pub(crate) struct SquareSink {
    squares: Arc<BySquare>,
    chunk: ChunkSize,
    given: u64,
}

impl SquareSink {
    /// The sink that sets records down in `squares`, in chunks of this size.
    pub fn new(squares: Arc<BySquare>, chunk: ChunkSize) -> Self {
        SquareSink { squares, chunk, given: 0 }
    }
}

/// Bytes of an encoded group of records before its entries: its square and their length.
const GROUP: usize = 3 * size_of::<u64>();

impl Sink for SquareSink {
    fn chunk_points(&self) -> usize {
        self.chunk.points
    }

    fn chunk_bytes(&self) -> u64 {
        self.chunk.bytes
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        Arc::new(SquareEncoder(self.squares.clone()))
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        let mut rest = &chunk.bytes[..];
        while let Some((head, more)) = rest.split_at_checked(GROUP) {
            let word = |n: usize| {
                let mut bytes = [0; 8];
                bytes.copy_from_slice(&head[n * 8..(n + 1) * 8]);
                i64::from_le_bytes(bytes)
            };
            let (entries, more) = more.split_at(word(2) as usize);
            self.squares.take([word(0), word(1)], entries)?;
            rest = more;
        }
        self.given += chunk.points;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<SinkSummary> {
        Ok(SinkSummary::new(self.given, 0))
    }
}

/// Sorts the records of a chunk by square; runs on all threads.
struct SquareEncoder(Arc<BySquare>);

impl Encode for SquareEncoder {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let (squares, schema) = (&self.0, batch.schema());
        let missing = || Error::internal("records without coordinates came to squares");
        let [x, y, _]: [&Dimension; 3] = schema.coordinates().ok_or_else(missing)?;
        let columns: Vec<(&[u8], usize)> = (squares.layout.kinds().iter())
            .map(|kind| {
                let values = batch.columns.bytes_of(*kind);
                let missing = || Error::internal("a column of an output of squares is not there");
                Ok((values.ok_or_else(missing)?, kind.bytes()))
            })
            .collect::<Result<_>>()?;
        let mut groups: BTreeMap<SquareKey, Vec<u8>> = BTreeMap::new();
        for (i, record) in batch.iter().enumerate() {
            let square = squares.square([x, y].map(|axis| axis.world(record, schema.endian)))?;
            let group = groups.entry(square).or_default();
            group.extend_from_slice(record);
            columns.iter().for_each(|(values, size)| {
                group.extend_from_slice(&values[i * size..(i + 1) * size]);
            });
        }
        let mut bytes = Vec::with_capacity(batch.len() * squares.entry() + GROUP * groups.len());
        for ([column, row], entries) in groups {
            bytes.extend_from_slice(&column.to_le_bytes());
            bytes.extend_from_slice(&row.to_le_bytes());
            bytes.extend_from_slice(&(entries.len() as i64).to_le_bytes());
            bytes.extend_from_slice(&entries);
        }
        Ok(Encoded::new(bytes, batch.len() as u64))
    }
}
