//! One layer of points: its stream, and what is learned of each scanner channel.
//!
//! X, y and returns come first, for a block of points; what the other layers need to know of each
//! point is noted. Then each other layer is read for the block by a loop of its own: a small loop,
//! whose branches are learned and whose interval stays in registers. A loop point by point through
//! all layers would read them at the same time, too, but every branch that was foreseen wrongly
//! ends that.

use super::coder::{Coder, Cursor};
use super::stream::ByteStream;

/// Bytes of the fields of a point.
pub const SIZE: usize = 30;
/// Points that are read at once.
pub const BLOCK: usize = 128;
/// Bytes that a point costs in a layer at most: two each of a dozen symbols, and some bits.
pub const MOST: usize = 32;

/// The fields of a point as they are stored.
pub type Point14Record = [u8; SIZE];

/// What the layers need to know of a point.
#[derive(Clone, Copy, Default)]
pub struct Note {
    /// Single 3, first 2, last 1, between 0.
    pub pulse: u8,
    pub level: u8,
    /// Kind of place of the height.
    pub height: u8,
    pub time_changed: bool,
    pub angle_changed: bool,
    pub source_changed: bool,
}

/// What the layers need to know of a block of points.
pub struct Notes {
    pub points: [Note; BLOCK],
    /// Scanner channels and how many points in a row are of each.
    pub runs: [(u8, u8); BLOCK],
    pub run_count: usize,
    /// The context that each point gives to the fields beside it.
    pub contexts: [u8; BLOCK],
}

/// What a layer learns of a scanner channel.
pub trait Learned {
    /// The field.
    type Value: Copy + Default;
    /// Nothing yet, where the channel begins with a value.
    fn new(first: Self::Value) -> Box<Self>;
}

/// One layer: its stream, the last value and what is learned of each scanner channel.
pub struct Layer<M: Learned> {
    pub coder: Coder,
    pub is_read: bool,
    now: usize,
    last: [M::Value; 4],
    channels: [Option<Box<M>>; 4],
}

impl<M: Learned> Layer<M> {
    /// A layer that stands nowhere yet.
    pub fn new(bytes: ByteStream) -> Self {
        Layer {
            coder: Coder::new(bytes),
            is_read: false,
            now: 0,
            last: [M::Value::default(); 4],
            channels: [None, None, None, None],
        }
    }

    /// Begins with the first value of a chunk.
    pub fn begin(&mut self, channel: usize, first: M::Value) {
        self.channels = [None, None, None, None];
        self.channels[channel] = Some(M::new(first));
        self.now = channel;
        self.last[channel] = first;
    }

    /// What is learned of a channel, and the last value.
    #[inline(always)]
    fn turn(&mut self, channel: usize) -> (&mut Coder, &mut M, &mut M::Value) {
        if self.channels[channel].is_none() {
            self.last[channel] = self.last[self.now];
        }
        self.now = channel;
        let last = &mut self.last[channel];
        let models = self.channels[channel].get_or_insert_with(|| M::new(*last));
        (&mut self.coder, models, last)
    }
}

/// Reads one field of a point.
pub trait ReadField<M: Learned>:
    Fn(&mut M, &mut M::Value, &mut Cursor, Note, usize, &mut Point14Record)
{
}

impl<M: Learned, F> ReadField<M> for F where
    F: Fn(&mut M, &mut M::Value, &mut Cursor, Note, usize, &mut Point14Record)
{
}

/// A block of points and what the layers need to know of them.
pub struct LayerBlock<'a> {
    pub notes: &'a Notes,
    pub records: &'a mut [u8],
    pub stride: usize,
}

impl LayerBlock<'_> {
    /// Reads two layers, point by point in one loop: each symbol of a layer waits for the one
    /// before, and the two wait at the same time.
    #[inline(always)]
    pub fn read_both<A: Learned, B: Learned>(
        &mut self,
        a: &mut Layer<A>,
        read_a: impl ReadField<A>,
        b: &mut Layer<B>,
        read_b: impl ReadField<B>,
    ) {
        if !(a.is_read && b.is_read) {
            self.read(a, read_a);
            self.read(b, read_b);
            return;
        }
        let mut points = self.records.chunks_exact_mut(self.stride).zip(&self.notes.points);
        for &(channel, count) in &self.notes.runs[..self.notes.run_count] {
            let channel = usize::from(channel & 3);
            let (coder_a, models_a, last_a) = a.turn(channel);
            let (coder_b, models_b, last_b) = b.turn(channel);
            let mut cursor_a = coder_a.enter(usize::from(count) * MOST);
            let mut cursor_b = coder_b.enter(usize::from(count) * MOST);
            let (mut value_a, mut value_b) = (*last_a, *last_b);
            for (record, note) in points.by_ref().take(usize::from(count)) {
                let Some(record) = record.first_chunk_mut() else { break };
                read_a(models_a, &mut value_a, &mut cursor_a, *note, channel, record);
                read_b(models_b, &mut value_b, &mut cursor_b, *note, channel, record);
            }
            (*last_a, *last_b) = (value_a, value_b);
            let (left_a, left_b) = (cursor_a.left(), cursor_b.left());
            coder_a.leave(left_a);
            coder_b.leave(left_b);
        }
    }

    /// Reads one layer, if it is to be read.
    #[inline(always)]
    pub fn read<A: Learned>(&mut self, a: &mut Layer<A>, read_a: impl ReadField<A>) {
        if !a.is_read {
            return;
        }
        let mut points = self.records.chunks_exact_mut(self.stride).zip(&self.notes.points);
        for &(channel, count) in &self.notes.runs[..self.notes.run_count] {
            let channel = usize::from(channel & 3);
            let (coder, models, last) = a.turn(channel);
            let mut cursor = coder.enter(usize::from(count) * MOST);
            let mut value = *last;
            for (record, note) in points.by_ref().take(usize::from(count)) {
                let Some(record) = record.first_chunk_mut() else { break };
                read_a(models, &mut value, &mut cursor, *note, channel, record);
            }
            *last = value;
            let left = cursor.left();
            coder.leave(left);
        }
    }
}

/// Stores a field.
#[inline(always)]
pub fn put<const N: usize>(record: &mut Point14Record, at: usize, bytes: [u8; N]) {
    if let Some(field) = record[at..].first_chunk_mut() {
        *field = bytes;
    }
}
