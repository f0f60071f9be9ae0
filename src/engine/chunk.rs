//! Chunks of an output: stretches of its records, cut by rank and encoded at once.
//!
//! A chunk is cut by the rank of its records in the output and never by the tile that they come
//! from, since tiles depend on the memory and outputs must not. It holds numbers of records and not
//! the records: what is removed is never fetched, and what waits to be encoded is small.

use super::product::RecordEntry;
use crate::store::RecordState;

/// Records that become one chunk of an output, as a product has them: a position with a million
/// copies is one entry of each chunk that it fills.
pub(crate) struct OutputChunk {
    /// Which output.
    pub sink: usize,
    /// First record, number of records, and their state.
    pub records: Vec<(u64, u32, RecordState)>,
    /// Normals of the entries, if the sink wants them.
    normals: Option<Vec<[f32; 3]>>,
}

impl OutputChunk {
    /// Bytes of a record at most: where none follows another, each is an entry of its own.
    pub const BYTES_PER_RECORD: usize =
        size_of::<(u64, u32, RecordState)>() + size_of::<[f32; 3]>();

    fn empty(sink: usize, wants_normals: bool) -> Self {
        OutputChunk { sink, records: Vec::new(), normals: wants_normals.then(Vec::new) }
    }

    /// Replaces `numbers` by the numbers of its records.
    pub fn number(&self, numbers: &mut Vec<u64>) {
        numbers.clear();
        self.records.iter().for_each(|&(first, n, _)| numbers.extend(first..first + u64::from(n)));
    }

    /// The normal of each record.
    pub fn spread_normals(&self) -> Option<Vec<[f32; 3]>> {
        let each = self.records.iter().map(|&(_, n, _)| n as usize).zip(self.normals.as_ref()?);
        Some(each.flat_map(|(n, &normal)| std::iter::repeat_n(normal, n)).collect())
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
    /// True if it writes normals.
    pub wants_normals: bool,
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
    pub fn new(sink: usize, chunk_points: usize, wants_normals: bool, before: bool) -> Self {
        let chunk = OutputChunk::empty(sink, wants_normals);
        Open { chunk_points, wants_normals, before, chunk, room: chunk_points, written: 0 }
    }

    /// Takes what becomes of an entry; chunks that this completes go to `full`.
    pub fn take(
        &mut self,
        entry: &RecordEntry,
        normal: Option<[f32; 3]>,
        full: &mut Vec<OutputChunk>,
    ) {
        let state = if self.before { entry.was } else { entry.now };
        if !state.is_written() {
            return;
        }
        let (mut first, mut left) = (entry.number, entry.count);
        self.written += u64::from(left);
        while left > 0 {
            let now = left.min(u32::try_from(self.room).unwrap_or(u32::MAX));
            self.chunk.records.push((first, now, state));
            if let (Some(normals), Some(normal)) = (&mut self.chunk.normals, normal) {
                normals.push(normal);
            }
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
        let empty = OutputChunk::empty(self.chunk.sink, self.wants_normals);
        std::mem::replace(&mut self.chunk, empty)
    }
}
