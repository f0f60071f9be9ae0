//! X, y and returns of points of formats 6 to 10: the layer that all others follow.

use super::coder::{Coder, Cursor};
use super::integer::Integers;
use super::layer::{BLOCK, MOST, Note, Notes, Point14Record, put};
use super::model::Model;
use super::predict::{RETURN_KINDS, RunningMedian, level};
use super::stream::ByteStream;

type Symbols16 = Model<17, 32>;

/// Where fields are in a record.
mod at {
    pub const RETURNS: usize = 14;
    pub const FLAGS: usize = 15;
}

/// X, y and returns of a scanner channel.
struct Channel {
    x: i32,
    y: i32,
    number: u8,
    returns: u8,
    time_changed: bool,
    changes: [Model<129, 128>; 8],
    channels: Model<4, 16>,
    returns_models: [Symbols16; 16],
    numbers: [Symbols16; 16],
    numbers_of_pulse: Symbols16,
    dx: Integers<32, 2>,
    dy: Integers<32, 22>,
    dxs: [RunningMedian; 12],
    dys: [RunningMedian; 12],
}

impl Channel {
    fn new(x: i32, y: i32, number: u8, returns: u8) -> Box<Self> {
        Box::new(Channel {
            x,
            y,
            number,
            returns,
            time_changed: false,
            changes: [const { Model::new(128) }; 8],
            channels: const { Model::new(3) },
            returns_models: [const { Model::new(16) }; 16],
            numbers: [const { Model::new(16) }; 16],
            numbers_of_pulse: const { Model::new(13) },
            dx: const { Integers::new() },
            dy: const { Integers::new() },
            dxs: [RunningMedian::NEW; 12],
            dys: [RunningMedian::NEW; 12],
        })
    }

    /// Reads the number of returns and the number of the return.
    #[inline(always)]
    fn read_returns(&mut self, cursor: &mut Cursor, changed: usize) {
        if changed & 4 != 0 {
            let model = &mut self.returns_models[usize::from(self.returns & 15)];
            self.returns = cursor.rare_symbol(model) as u8;
        }
        let last = self.number;
        self.number = match changed & 3 {
            0 => last,
            1 => (last + 1) & 15,
            2 => (last + 15) & 15,
            _ if changed & 16 != 0 => {
                cursor.rare_symbol(&mut self.numbers[usize::from(last & 15)]) as u8
            }
            _ => (last + cursor.rare_symbol(&mut self.numbers_of_pulse) as u8 + 2) & 15,
        };
    }

    /// Reads the next point, whose changes are known.
    #[inline(always)]
    fn read(&mut self, cursor: &mut Cursor, changed: usize, record: &mut Point14Record) -> Note {
        self.read_returns(cursor, changed);
        let time_changed = changed & 16 != 0;
        self.time_changed = time_changed;
        let (n, r) = (usize::from(self.returns & 15), usize::from(self.number & 15));
        let kind = (usize::from(RETURN_KINDS[n][r]) << 1) | usize::from(time_changed);
        let single = usize::from(n == 1);

        let by = self.dx.read(cursor, self.dxs[kind].get(), single);
        self.x = self.x.wrapping_add(by);
        self.dxs[kind].add(by);
        let bits = self.dx.bits();
        let context = single + (bits.min(20) & !1) as usize;
        let by = self.dy.read(cursor, self.dys[kind].get(), context);
        self.y = self.y.wrapping_add(by);
        self.dys[kind].add(by);

        put(record, 0, self.x.to_le_bytes());
        put(record, 4, self.y.to_le_bytes());
        record[at::RETURNS] = self.number | (self.returns << 4);
        let bits = (bits + self.dy.bits()) / 2;
        Note {
            pulse: (u8::from(r == 1) << 1) | u8::from(r >= n),
            level: level(n, r) as u8,
            height: single as u8 + (bits.min(18) & !1) as u8,
            time_changed,
            angle_changed: changed & 8 != 0,
            source_changed: changed & 32 != 0,
        }
    }
}

/// The layer.
pub struct Places {
    /// Its stream.
    pub coder: Coder,
    version: u16,
    now: usize,
    channels: [Option<Box<Channel>>; 4],
}

impl Places {
    /// A layer of version 3 or 4 that stands nowhere yet.
    pub fn new(version: u16, bytes: ByteStream) -> Self {
        Places { coder: Coder::new(bytes), version, now: 0, channels: [None, None, None, None] }
    }

    /// Begins with the first point of a chunk; its scanner channel.
    pub fn begin(&mut self, first: &Point14Record) -> usize {
        let int = |at| i32::from_le_bytes(field(first, at));
        let returns = first[at::RETURNS];
        self.now = usize::from((first[at::FLAGS] >> 4) & 3);
        self.channels = [None, None, None, None];
        self.channels[self.now] = Some(Channel::new(int(0), int(4), returns & 15, returns >> 4));
        self.now
    }

    /// Reads a block of points into records that else are as `first`; notes what the layers need to
    /// know.
    pub fn read(
        &mut self,
        first: &Point14Record,
        notes: &mut Notes,
        records: &mut [u8],
        stride: usize,
    ) {
        let mut cursor = self.coder.enter(BLOCK * MOST);
        notes.run_count = 0;
        let mut run = 0;
        for ((record, note), context) in
            records.chunks_exact_mut(stride).zip(&mut notes.points).zip(&mut notes.contexts)
        {
            let Some(record) = record.first_chunk_mut() else { break };
            let Some(channel) = &mut self.channels[self.now] else { break };
            let place = usize::from(channel.number == 1)
                | (usize::from(channel.number >= channel.returns) << 1)
                | (usize::from(channel.time_changed) << 2);
            let changed = cursor.symbol(&mut channel.changes[place]);
            *context = if self.version == 3 { 0 } else { self.now as u8 };
            if changed & 64 != 0 {
                let step = cursor.rare_symbol(&mut channel.channels);
                let (x, y) = (channel.x, channel.y);
                let (number, returns) = (channel.number, channel.returns);
                if run > 0 {
                    notes.runs[notes.run_count] = (self.now as u8, run);
                    notes.run_count += 1;
                    run = 0;
                }
                self.now = (self.now + step + 1) & 3;
                *context = self.now as u8;
                self.channels[self.now].get_or_insert_with(|| Channel::new(x, y, number, returns));
            }
            run += 1;
            let Some(channel) = &mut self.channels[self.now] else { break };
            *record = *first;
            record[at::FLAGS] = (first[at::FLAGS] & !0x30) | ((self.now as u8) << 4);
            *note = channel.read(&mut cursor, changed, record);
        }
        if run > 0 {
            notes.runs[notes.run_count] = (self.now as u8, run);
            notes.run_count += 1;
        }
        let left = cursor.left();
        self.coder.leave(left);
    }
}

/// A field of a record.
pub fn field<const N: usize>(record: &Point14Record, at: usize) -> [u8; N] {
    record.get(at..).and_then(|bytes| bytes.first_chunk()).copied().unwrap_or([0; N])
}
