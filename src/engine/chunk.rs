//! Chunks of an output: stretches of its records, cut by rank and encoded at once.
//!
//! A chunk is cut by the rank of its records in the output and never by the tile that they come
//! from, since tiles depend on the memory and outputs must not. It holds numbers of records and not
//! the records: what is removed is never fetched, and what waits to be encoded is small.

use super::product::RecordEntry;
use super::row::RowLayout;
use crate::point::Columns;
use crate::store::RecordState;

/// Records that become one chunk of an output, as a product has them: a position with a million
/// copies is one entry of each chunk that it fills.
pub(crate) struct OutputChunk {
    /// Which output.
    pub sink: usize,
    /// First record, number of records, and their state.
    pub records: Vec<(u64, u32, RecordState)>,
    /// A row for each entry, and what rows are.
    rows: Vec<u8>,
    layout: RowLayout,
}

impl OutputChunk {
    /// Bytes of a record at most, its row aside: where none follows another, each is an entry.
    pub const BYTES_PER_RECORD: usize = size_of::<(u64, u32, RecordState)>();

    fn empty(sink: usize, layout: &RowLayout) -> Self {
        OutputChunk { sink, records: Vec::new(), rows: Vec::new(), layout: layout.clone() }
    }

    /// Replaces `numbers` by the numbers of its records.
    pub fn number(&self, numbers: &mut Vec<u64>) {
        numbers.clear();
        self.records.iter().for_each(|&(first, n, _)| numbers.extend(first..first + u64::from(n)));
    }

    /// The columns of its records.
    pub fn columns(&self) -> Columns {
        self.layout.spread(&self.rows, self.records.iter().map(|&(_, n, _)| n as usize))
    }

    /// Replaces `states` by the state of each record.
    pub fn states(&self, states: &mut Vec<RecordState>) {
        states.clear();
        for &(_, n, state) in &self.records {
            states.resize(states.len() + n as usize, state);
        }
    }
}

/// An output while its chunks are cut.
pub(crate) struct Open {
    /// Records of a full chunk.
    pub chunk_points: usize,
    /// The rows of its entries.
    pub layout: RowLayout,
    /// True if it takes what was there before the pass.
    pub before: bool,
    chunk: OutputChunk,
    /// Records that the chunk takes until it is full.
    room: usize,
    /// Records that it was given.
    pub written: u64,
}

impl Open {
    /// Output `sink` without a record.
    pub fn new(sink: usize, chunk_points: usize, layout: &RowLayout, before: bool) -> Self {
        let chunk = OutputChunk::empty(sink, layout);
        let layout = layout.clone();
        Open { chunk_points, layout, before, chunk, room: chunk_points, written: 0 }
    }

    /// Takes what becomes of an entry with its row, if it has one; chunks that this completes go to
    /// `full`.
    pub fn take(&mut self, entry: &RecordEntry, row: &[u8], full: &mut Vec<OutputChunk>) {
        let state = if self.before { entry.was } else { entry.now };
        if !state.is_written() {
            return;
        }
        let (mut first, mut left) = (entry.number, entry.count);
        self.written += u64::from(left);
        while left > 0 {
            let now = left.min(u32::try_from(self.room).unwrap_or(u32::MAX));
            self.chunk.records.push((first, now, state));
            self.layout.enter(row, &mut self.chunk.rows);
            (first, left) = (first + u64::from(now), left - now);
            self.room -= now as usize;
            if self.room == 0 {
                full.push(self.close());
            }
        }
    }

    /// The last chunk, if there is one.
    pub fn rest(&mut self) -> Option<OutputChunk> {
        (self.room < self.chunk_points).then(|| self.close())
    }

    fn close(&mut self) -> OutputChunk {
        self.room = self.chunk_points;
        let empty = OutputChunk::empty(self.chunk.sink, &self.layout);
        std::mem::replace(&mut self.chunk, empty)
    }
}
