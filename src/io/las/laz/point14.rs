//! Points of formats 6 to 10: nine layers, each a stream of its own.
//!
//! Source: LAZ specification 1.4, section of POINT14 (versions 3 and 4).

use super::coder::Coder;
use super::damage::Damage;
use super::integer::Integers;
use super::layer::{BLOCK, Layer, LayerBlock, Learned, Note, Notes, Point14Record, put};
use super::layers::Layers;
use super::model::{Model, learned};
use super::places::{Places, field};
use super::stream::ByteStream;
use super::time::{TimeForm, Times};

/// Layers, in the order in which they are stored.
pub const LAYERS: usize = 9;

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

/// Where fields are in a record.
mod at {
    pub const HEIGHT: usize = 8;
    pub const INTENSITY: usize = 12;
    pub const FLAGS: usize = 15;
    pub const CLASS: usize = 16;
    pub const USER: usize = 17;
    pub const ANGLE: usize = 18;
    pub const SOURCE: usize = 20;
    pub const TIME: usize = 22;
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
struct ModelsByByte<const N: usize, const T: usize>([Option<Box<Model<N, T>>>; 64]);

impl<const N: usize, const T: usize> Learned for ModelsByByte<N, T> {
    type Value = u8;
    fn new(_first: u8) -> Box<Self> {
        Box::new(ModelsByByte([const { None }; 64]))
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
        Times::begin(TimeForm::Layer, first)
    }
}

/// The decoder of these fields.
pub struct Point14 {
    /// The first point of the chunk: what no layer changes.
    first: Point14Record,
    places: Places,
    places_are_read: bool,
    heights: Layer<Heights>,
    classes: Layer<ModelsByByte<257, 256>>,
    flags: Layer<ModelsByByte<65, 128>>,
    intensities: Layer<Intensities>,
    angles: Layer<Integers<16, 2>>,
    users: Layer<ModelsByByte<257, 256>>,
    sources: Layer<Integers<16, 1>>,
    times: Layer<Times>,
    notes: Box<Notes>,
}

impl Point14 {
    /// A decoder of version 3 or 4; `bytes` makes the streams.
    pub fn new(version: u16, bytes: &impl Fn() -> ByteStream) -> Self {
        Point14 {
            first: [0; _],
            places: Places::new(version, bytes()),
            places_are_read: true,
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
    pub fn begin(&mut self, record: &Point14Record) -> usize {
        self.first = *record;
        let word = |at| u16::from_le_bytes(field(record, at));
        let flags = record[at::FLAGS];
        let now = self.places.begin(record);
        self.heights.begin(now, i32::from_le_bytes(field(record, at::HEIGHT)));
        self.classes.begin(now, record[at::CLASS]);
        self.flags.begin(now, (flags & 15) | ((flags >> 2) & 0x30));
        self.intensities.begin(now, word(at::INTENSITY));
        self.angles.begin(now, word(at::ANGLE));
        self.users.begin(now, record[at::USER]);
        self.sources.begin(now, word(at::SOURCE));
        self.times.begin(now, i64::from_le_bytes(field(record, at::TIME)));
        now
    }

    /// Moves the layers to where they are: one after the other from byte `at`, of these lengths.
    /// The byte behind the last.
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
            (&mut self.places.coder, &mut self.places_are_read),
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
        self.places.read(&self.first, &mut self.notes, records, stride);
        self.read_all(records, stride);
        self.read_changes(records, stride);
        &self.notes.contexts
    }

    /// The layers that have a symbol for each point.
    fn read_all(&mut self, records: &mut [u8], stride: usize) {
        let mut block = LayerBlock { notes: &self.notes, records, stride };
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
        block.read(&mut self.users, |models, last, cursor, _, _, record| {
            let place = usize::from(*last >> 2);
            *last = cursor.symbol(learned(&mut models.0[place], 256)) as u8;
            record[at::USER] = *last;
        });
    }

    /// The layers that have symbols only where x, y and returns said that the field changes.
    fn read_changes(&mut self, records: &mut [u8], stride: usize) {
        let mut block = LayerBlock { notes: &self.notes, records, stride };
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
                    *last = models.read(cursor, TimeForm::Layer);
                }
                put(record, at::TIME, last.to_le_bytes());
            },
        );
        block.read(&mut self.sources, |models, last, cursor, note, _, record| {
            if note.source_changed {
                *last = models.read(cursor, i32::from(*last), 0) as u16;
            }
            put(record, at::SOURCE, last.to_le_bytes());
        });
    }
}
