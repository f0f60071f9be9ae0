//! Points of formats 6 to 10: nine layers, each a stream of its own.
//!
//! X, y and returns come first, for a block of points; what the other layers need to know of each point
//! is noted. Then each other layer is read for the block by a loop of its own: a small loop, whose branches
//! are learned and whose interval stays in registers.
//!
//! Source: LAZ specification 1.4, section of POINT14 (versions 3 and 4).

use super::coder::{Coder, Cursor};
use super::damage::Damage;
use super::integer::Integers;
use super::layers::Layers;
use super::model::{Model, learned};
use super::predict::{Median, RETURN_KINDS, level};
use super::stream::Bytes;
use super::time::{Kind, Times};

/// Bytes of the fields.
pub const SIZE: usize = 30;
/// Layers, in the order in which they are stored.
pub const LAYERS: usize = 9;
/// Points that are read at once.
pub const BLOCK: usize = 128;
/// Bytes that a point costs in a layer at most.
pub const MOST: usize = 32;

/// Names of the layers.
const NAMES: [&str; LAYERS] = [
    "x, y and returns",
    "z",
    "classification",
    "flags",
    "intensity",
    "scan angle",
    "user data",
    "point source",
    "GPS time",
];

type Record = [u8; SIZE];
type Symbols16 = Model<17, 32>;

/// Where fields are in a record.
mod at {
    pub const HEIGHT: usize = 8;
    pub const INTENSITY: usize = 12;
    pub const RETURNS: usize = 14;
    pub const FLAGS: usize = 15;
    pub const CLASS: usize = 16;
    pub const USER: usize = 17;
    pub const ANGLE: usize = 18;
    pub const SOURCE: usize = 20;
    pub const TIME: usize = 22;
}

/// What the layers need to know of a point.
#[derive(Clone, Copy, Default)]
struct Note {
    /// Single 3, first 2, last 1, between 0.
    pulse: u8,
    level: u8,
    /// Kind of place of the height.
    height: u8,
    time_changed: bool,
    angle_changed: bool,
    source_changed: bool,
}

/// What the layers need to know of a block of points.
struct Notes {
    points: [Note; BLOCK],
    /// Scanner channels and how many points in a row are of each.
    runs: [(u8, u8); BLOCK],
    run_count: usize,
    /// The context that each point gives to the fields beside it.
    contexts: [u8; BLOCK],
}

/// What a layer learns of a scanner channel.
trait Learned {
    /// The field.
    type Value: Copy + Default;
    /// Nothing yet, where the channel begins with a value.
    fn new(first: Self::Value) -> Box<Self>;
}

/// One layer: its stream, the last value and what is learned of each scanner channel.
struct Layer<M: Learned> {
    coder: Coder,
    is_read: bool,
    now: usize,
    last: [M::Value; 4],
    channels: [Option<Box<M>>; 4],
}

impl<M: Learned> Layer<M> {
    fn new(bytes: Bytes) -> Self {
        Layer {
            coder: Coder::new(bytes),
            is_read: false,
            now: 0,
            last: [M::Value::default(); 4],
            channels: [None, None, None, None],
        }
    }

    fn begin(&mut self, channel: usize, first: M::Value) {
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
trait ReadField<M: Learned>:
    Fn(&mut M, &mut M::Value, &mut Cursor, Note, usize, &mut Record)
{
}

impl<M: Learned, F> ReadField<M> for F where
    F: Fn(&mut M, &mut M::Value, &mut Cursor, Note, usize, &mut Record)
{
}

/// A block of points and what the layers need to know of them.
struct Block<'a> {
    notes: &'a Notes,
    records: &'a mut [u8],
    stride: usize,
}

impl Block<'_> {
    /// Reads two layers, point by point in one loop: each symbol of a layer waits for the one before, and
    /// the two wait at the same time.
    #[inline(always)]
    fn read_both<A: Learned, B: Learned>(
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
    fn read<A: Learned>(&mut self, a: &mut Layer<A>, read_a: impl ReadField<A>) {
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

/// X, y and returns of a scanner channel.
struct Places {
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
    dxs: [Median; 12],
    dys: [Median; 12],
}

impl Places {
    fn new(x: i32, y: i32, number: u8, returns: u8) -> Box<Self> {
        Box::new(Places {
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
            dxs: [Median::NEW; 12],
            dys: [Median::NEW; 12],
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
    fn read(&mut self, cursor: &mut Cursor, changed: usize, record: &mut Record) -> Note {
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

/// Heights of a scanner channel.
struct Heights {
    integers: Integers<32, 20>,
    levels: [i32; 8],
}

impl Learned for Heights {
    type Value = i32;
    fn new(first: i32) -> Box<Self> {
        Box::new(Heights { integers: const { Integers::new() }, levels: [first; 8] })
    }
}

/// Intensities of a scanner channel.
struct Intensities {
    integers: Integers<16, 4>,
    kinds: [u16; 8],
}

impl Learned for Intensities {
    type Value = u16;
    fn new(first: u16) -> Box<Self> {
        Box::new(Intensities { integers: const { Integers::new() }, kinds: [first; 8] })
    }
}

/// Bytes that depend on the one before.
struct Bytewise<const N: usize, const T: usize>([Option<Box<Model<N, T>>>; 64]);

impl<const N: usize, const T: usize> Learned for Bytewise<N, T> {
    type Value = u8;
    fn new(_first: u8) -> Box<Self> {
        Box::new(Bytewise([const { None }; 64]))
    }
}

impl<const CONTEXTS: usize> Learned for Integers<16, CONTEXTS> {
    type Value = u16;
    fn new(_first: u16) -> Box<Self> {
        Box::new(const { Integers::new() })
    }
}

impl Learned for Times {
    type Value = i64;
    fn new(first: i64) -> Box<Self> {
        Times::begin(Kind::Layer, first)
    }
}

/// The decoder of these fields.
pub struct Point14 {
    version: u16,
    /// The first point of the chunk: what no layer changes.
    first: Record,
    coder: Coder,
    is_read: bool,
    now: usize,
    places: [Option<Box<Places>>; 4],
    heights: Layer<Heights>,
    classes: Layer<Bytewise<257, 256>>,
    flags: Layer<Bytewise<65, 128>>,
    intensities: Layer<Intensities>,
    angles: Layer<Integers<16, 2>>,
    users: Layer<Bytewise<257, 256>>,
    sources: Layer<Integers<16, 1>>,
    times: Layer<Times>,
    notes: Box<Notes>,
}

fn field<const N: usize>(record: &Record, at: usize) -> [u8; N] {
    let mut bytes = [0; N];
    bytes.copy_from_slice(&record[at..at + N]);
    bytes
}

/// Stores a field.
#[inline(always)]
fn put<const N: usize>(record: &mut Record, at: usize, bytes: [u8; N]) {
    if let Some(field) = record[at..].first_chunk_mut() {
        *field = bytes;
    }
}

impl Point14 {
    /// A decoder of version 3 or 4; `bytes` makes the streams.
    pub fn new(version: u16, bytes: &impl Fn() -> Bytes) -> Self {
        Point14 {
            version,
            first: [0; SIZE],
            coder: Coder::new(bytes()),
            is_read: true,
            now: 0,
            places: [None, None, None, None],
            heights: Layer::new(bytes()),
            classes: Layer::new(bytes()),
            flags: Layer::new(bytes()),
            intensities: Layer::new(bytes()),
            angles: Layer::new(bytes()),
            users: Layer::new(bytes()),
            sources: Layer::new(bytes()),
            times: Layer::new(bytes()),
            notes: Box::new(Notes {
                points: [Note::default(); BLOCK],
                runs: [(0, 0); BLOCK],
                run_count: 0,
                contexts: [0; BLOCK],
            }),
        }
    }

    /// Begins with the first point of a chunk; its scanner channel.
    pub fn begin(&mut self, record: &Record) -> usize {
        self.first = *record;
        let int = |at| i32::from_le_bytes(field(record, at));
        let word = |at| u16::from_le_bytes(field(record, at));
        let flags = record[at::FLAGS];
        let returns = record[at::RETURNS];
        let now = usize::from((flags >> 4) & 3);
        self.now = now;
        self.places = [None, None, None, None];
        self.places[now] = Some(Places::new(int(0), int(4), returns & 15, returns >> 4));
        self.heights.begin(now, int(8));
        self.classes.begin(now, record[at::CLASS]);
        self.flags.begin(now, (flags & 15) | ((flags >> 2) & 0x30));
        self.intensities.begin(now, word(at::INTENSITY));
        self.angles.begin(now, word(at::ANGLE));
        self.users.begin(now, record[at::USER]);
        self.sources.begin(now, word(at::SOURCE));
        self.times.begin(now, i64::from_le_bytes(field(record, at::TIME)));
        now
    }

    /// Moves the layers to where they are: one after the other from byte `at`, of these lengths. The
    /// byte behind the last.
    pub fn move_to(&mut self, mut at: u64, lengths: &[u64; LAYERS], wanted: Layers) -> u64 {
        for (i, ((coder, is_read), length)) in self.layers().into_iter().zip(lengths).enumerate() {
            *is_read = wanted.has_point(i) && (i == 0 || *length > 0);
            if *is_read {
                coder.bytes().move_to(at, at + length);
                coder.start();
            }
            at += length;
        }
        at
    }

    fn layers(&mut self) -> [(&mut Coder, &mut bool); LAYERS] {
        [
            (&mut self.coder, &mut self.is_read),
            (&mut self.heights.coder, &mut self.heights.is_read),
            (&mut self.classes.coder, &mut self.classes.is_read),
            (&mut self.flags.coder, &mut self.flags.is_read),
            (&mut self.intensities.coder, &mut self.intensities.is_read),
            (&mut self.angles.coder, &mut self.angles.is_read),
            (&mut self.users.coder, &mut self.users.is_read),
            (&mut self.sources.coder, &mut self.sources.is_read),
            (&mut self.times.coder, &mut self.times.is_read),
        ]
    }

    /// What `check` finds wrong with a layer that is read.
    pub fn check(
        &mut self,
        check: impl Fn(&mut Coder, Option<&'static str>) -> Result<(), Damage>,
    ) -> Result<(), Damage> {
        for ((coder, is_read), name) in self.layers().into_iter().zip(NAMES) {
            if *is_read {
                check(coder, Some(name))?;
            }
        }
        Ok(())
    }

    /// Reads the next points, [`BLOCK`] at most; the contexts that they give to the other fields.
    pub fn read(&mut self, records: &mut [u8], stride: usize) -> &[u8; BLOCK] {
        self.read_places(records, stride);
        let mut block = Block { notes: &self.notes, records, stride };
        block.read_both(
            &mut self.heights,
            |models, last, cursor, note, _, record| {
                let before = &mut models.levels[usize::from(note.level & 7)];
                *last = models.integers.read(cursor, *before, usize::from(note.height));
                *before = *last;
                put(record, at::HEIGHT, last.to_le_bytes());
            },
            &mut self.intensities,
            |models, last, cursor, note, _, record| {
                let pulse = usize::from(note.pulse & 3);
                let before = &mut models.kinds[(pulse << 1) | usize::from(note.time_changed)];
                *last = models.integers.read(cursor, i32::from(*before), pulse) as u16;
                *before = *last;
                put(record, at::INTENSITY, last.to_le_bytes());
            },
        );
        block.read_both(
            &mut self.classes,
            |models, last, cursor, note, _, record| {
                let place = (usize::from(*last & 31) << 1) | usize::from(note.pulse == 3);
                *last = cursor.symbol(learned(&mut models.0[place], 256)) as u8;
                record[at::CLASS] = *last;
            },
            &mut self.flags,
            |models, last, cursor, _, channel, record| {
                let place = usize::from(*last & 63);
                *last = cursor.symbol(learned(&mut models.0[place], 64)) as u8;
                record[at::FLAGS] = (*last & 15) | ((channel as u8) << 4) | ((*last & 0x30) << 2);
            },
        );
        block.read_both(
            &mut self.angles,
            |models, last, cursor, note, _, record| {
                if note.angle_changed {
                    let context = usize::from(note.time_changed);
                    *last = models.read(cursor, i32::from(*last as i16), context) as u16;
                }
                put(record, at::ANGLE, last.to_le_bytes());
            },
            &mut self.times,
            |models, last, cursor, note, _, record| {
                if note.time_changed {
                    *last = models.read(cursor, Kind::Layer);
                }
                put(record, at::TIME, last.to_le_bytes());
            },
        );
        block.read(&mut self.users, |models, last, cursor, _, _, record| {
            let place = usize::from(*last >> 2);
            *last = cursor.symbol(learned(&mut models.0[place], 256)) as u8;
            record[at::USER] = *last;
        });
        block.read(&mut self.sources, |models, last, cursor, note, _, record| {
            if note.source_changed {
                *last = models.read(cursor, i32::from(*last), 0) as u16;
            }
            put(record, at::SOURCE, last.to_le_bytes());
        });
        &self.notes.contexts
    }

    fn read_places(&mut self, records: &mut [u8], stride: usize) {
        let mut cursor = self.coder.enter(BLOCK * MOST);
        let notes = &mut *self.notes;
        let first = self.first;
        notes.run_count = 0;
        let mut run = 0;
        for ((record, note), context) in records
            .chunks_exact_mut(stride)
            .zip(&mut notes.points)
            .zip(&mut notes.contexts)
        {
            let Some(record) = record.first_chunk_mut() else { break };
            let Some(places) = &mut self.places[self.now] else { break };
            let place = usize::from(places.number == 1)
                | (usize::from(places.number >= places.returns) << 1)
                | (usize::from(places.time_changed) << 2);
            let changed = cursor.symbol(&mut places.changes[place]);
            *context = if self.version == 3 { 0 } else { self.now as u8 };
            if changed & 64 != 0 {
                let step = cursor.rare_symbol(&mut places.channels);
                let (x, y) = (places.x, places.y);
                let (number, returns) = (places.number, places.returns);
                if run > 0 {
                    notes.runs[notes.run_count] = (self.now as u8, run);
                    notes.run_count += 1;
                    run = 0;
                }
                self.now = (self.now + step + 1) & 3;
                *context = self.now as u8;
                self.places[self.now].get_or_insert_with(|| Places::new(x, y, number, returns));
            }
            run += 1;
            let Some(places) = &mut self.places[self.now] else { break };
            *record = first;
            record[at::FLAGS] = (first[at::FLAGS] & !0x30) | ((self.now as u8) << 4);
            *note = places.read(&mut cursor, changed, record);
        }
        if run > 0 {
            notes.runs[notes.run_count] = (self.now as u8, run);
            notes.run_count += 1;
        }
        let left = cursor.left();
        self.coder.leave(left);
    }
}
