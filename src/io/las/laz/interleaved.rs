//! Chunks of formats 0 to 5, and files without chunks: the fields of each point after each other,
//! in one stream.

use super::coder::{Coder, Cursor};
use super::color::{self, Rgb};
use super::damage::Damage;
use super::model::Model;
use super::point10;
use super::record::Item;
use super::stream::{ByteStream, WINDOW};
use super::time::{self, Times};
use super::wave::{self, Packet, Waves};

/// Bytes of a stream that are read between two looks at the window.
const PIECE: usize = WINDOW / 4;

/// The decoder of one group of fields.
enum InterleavedFields {
    Point1(Box<point10::FirstPoint10>),
    Point2(Box<point10::SecondPoint10>),
    Time1(Box<time::FirstTime>),
    Time2(Box<Times>),
    Color1(Box<color::FirstColor>, Rgb),
    Color2(Box<color::SecondColor>, Rgb),
    Wave(Box<Waves>, Packet),
    Bytes(Vec<(Model<257, 256>, u8)>),
}

impl InterleavedFields {
    /// Nothing is learned yet; the first of a chunk was `first`.
    fn begin(item: &Item, first: &[u8]) -> Option<Self> {
        let time = || Some(i64::from_le_bytes(*first.first_chunk()?));
        Some(match (item.kind, item.version) {
            (6, 1) => {
                let mut point = point10::FirstPoint10::new();
                point.begin(first.first_chunk()?);
                InterleavedFields::Point1(point)
            }
            (6, _) => {
                let mut point = point10::SecondPoint10::new();
                point.begin(first.first_chunk()?);
                InterleavedFields::Point2(point)
            }
            (7, 1) => {
                let mut times = time::FirstTime::new();
                times.begin(time()?);
                InterleavedFields::Time1(times)
            }
            (7, _) => InterleavedFields::Time2(Times::begin(time::TimeForm::Item, time()?)),
            (8, 1) => {
                InterleavedFields::Color1(Box::new(color::FirstColor::new()), color::unpack(first))
            }
            (8, _) => {
                InterleavedFields::Color2(Box::new(color::SecondColor::new()), color::unpack(first))
            }
            (9, _) => InterleavedFields::Wave(
                Box::new(Waves::new()),
                Packet::unpack(first.first_chunk()?),
            ),
            _ => InterleavedFields::Bytes(
                first.iter().map(|&byte| (const { Model::new(256) }, byte)).collect(),
            ),
        })
    }

    /// Reads the next.
    #[inline(always)]
    fn read(&mut self, coder: &mut Cursor, out: &mut [u8]) {
        match self {
            InterleavedFields::Point1(point) => {
                if let Some(out) = out.first_chunk_mut() {
                    point.read(coder, out);
                }
            }
            InterleavedFields::Point2(point) => {
                if let Some(out) = out.first_chunk_mut() {
                    point.read(coder, out);
                }
            }
            InterleavedFields::Time1(times) => {
                out.copy_from_slice(&times.read(coder).to_le_bytes())
            }
            InterleavedFields::Time2(times) => {
                out.copy_from_slice(&times.read(coder, time::TimeForm::Item).to_le_bytes());
            }
            InterleavedFields::Color1(colors, last) => {
                *last = colors.read(coder, *last);
                color::pack(*last, out);
            }
            InterleavedFields::Color2(colors, last) => {
                *last = colors.read(coder, *last);
                color::pack(*last, out);
            }
            InterleavedFields::Wave(waves, last) => {
                *last = waves.read(coder, last);
                if let Some(out) = out.first_chunk_mut::<{ wave::SIZE }>() {
                    last.pack(out);
                }
            }
            InterleavedFields::Bytes(bytes) => read_bytes(bytes, coder, out),
        }
    }
}

/// Reads extra bytes.
fn read_bytes(bytes: &mut [(Model<257, 256>, u8)], coder: &mut Cursor, out: &mut [u8]) {
    for ((model, last), out) in bytes.iter_mut().zip(out) {
        *last = last.wrapping_add(coder.symbol(model) as u8);
        *out = *last;
    }
}

/// The decoder of a stream of points.
pub struct Interleaved {
    items: Vec<Item>,
    fields: Vec<(usize, InterleavedFields)>,
    coder: Coder,
    /// Points that are read at once.
    block: usize,
    /// Bytes that one of them costs at most.
    most: usize,
}

impl Interleaved {
    /// A decoder that stands nowhere yet.
    pub fn new(items: &[Item], bytes: ByteStream) -> Self {
        let most: usize = items.iter().map(Item::most_bytes).sum();
        let block = (PIECE / most.max(1)).clamp(1, 64);
        let (items, fields, coder) = (items.to_vec(), Vec::new(), Coder::new(bytes));
        Interleaved { items, fields, coder, block, most }
    }

    /// Begins with the stretch `start..end` of the file.
    pub fn begin(&mut self, start: u64, end: u64) {
        self.fields.clear();
        self.coder.bytes().move_to(start, end);
    }

    /// File position of the next byte.
    pub fn position(&mut self) -> u64 {
        self.coder.bytes().position()
    }

    /// Reads the next points, whole records.
    pub fn read(&mut self, records: &mut [u8], stride: usize) -> Result<(), Damage> {
        let first = if self.fields.is_empty() { stride.min(records.len()) } else { 0 };
        let (first, others) = records.split_at_mut(first);
        if !first.is_empty() {
            self.first(first)?;
        }
        if self.most > PIECE {
            others.chunks_exact_mut(stride).for_each(|record| self.read_long(record));
            return Damage::of(&mut self.coder, None);
        }
        for block in others.chunks_mut(self.block * stride) {
            let mut cursor = self.coder.enter(self.block * self.most);
            for record in block.chunks_exact_mut(stride) {
                let mut rest = record;
                for (size, fields) in &mut self.fields {
                    let Some((out, behind)) = rest.split_at_mut_checked(*size) else { break };
                    fields.read(&mut cursor, out);
                    rest = behind;
                }
            }
            let left = cursor.left();
            self.coder.leave(left);
        }
        Damage::of(&mut self.coder, None)
    }

    /// Reads a record that may cost more than a window: its extra bytes some at a time.
    fn read_long(&mut self, record: &mut [u8]) {
        let mut rest = record;
        for (size, fields) in &mut self.fields {
            let Some((out, behind)) = rest.split_at_mut_checked(*size) else { break };
            if let InterleavedFields::Bytes(bytes) = fields {
                for (bytes, out) in bytes.chunks_mut(PIECE / 2).zip(out.chunks_mut(PIECE / 2)) {
                    let mut cursor = self.coder.enter(PIECE);
                    read_bytes(bytes, &mut cursor, out);
                    let left = cursor.left();
                    self.coder.leave(left);
                }
            } else {
                let mut cursor = self.coder.enter(PIECE);
                fields.read(&mut cursor, out);
                let left = cursor.left();
                self.coder.leave(left);
            }
            rest = behind;
        }
    }

    /// The first point of a chunk is stored as it is.
    fn first(&mut self, record: &mut [u8]) -> Result<(), Damage> {
        self.coder.bytes().take(record);
        let mut rest = &*record;
        for item in &self.items {
            let size = usize::from(item.size);
            let Some((first, behind)) = rest.split_at_checked(size) else { break };
            self.fields.extend(InterleavedFields::begin(item, first).map(|fields| (size, fields)));
            rest = behind;
        }
        self.coder.start();
        Damage::of(&mut self.coder, None)
    }

    /// All points of a chunk were read that has no known end.
    pub fn pause(&mut self) -> Result<(), Damage> {
        Damage::at_pause(&mut self.coder, None)
    }

    /// All points of the chunk were read: its bytes must end here.
    pub fn finish(&mut self) -> Result<(), Damage> {
        Damage::at_end(&mut self.coder, None)
    }
}
