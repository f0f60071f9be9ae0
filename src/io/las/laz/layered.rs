//! Chunks of formats 6 to 10: a stream for each field, which needs no other but that of x, y and
//! returns.

use super::coder::{Coder, Cursor};
use super::color::{self, Infrared, Rgb};
use super::context::Contexts;
use super::damage::{Damage, Why};
use super::layer::{BLOCK, MOST};
use super::layers::Layers;
use super::model::Model;
use super::point14::Point14;
use super::record::Item;
use super::stream::ByteStream;
use super::wave::{self, Packet, Waves};

/// A stream, and whether it is to be read: a field that does not change in a chunk has none.
struct ItemLayer {
    coder: Coder,
    is_read: bool,
    length: u64,
}

impl ItemLayer {
    fn begin(&mut self, start: u64, length: u64, wanted: bool) {
        self.length = length;
        self.is_read = wanted && length > 0;
        if self.is_read {
            self.coder.bytes().move_to(start, start + length);
            self.coder.start();
        }
    }

    /// Reads a block, point by point: `read` gets no cursor where there is nothing to read.
    #[inline(always)]
    fn each<'a, V: Clone + Default, M>(
        &mut self,
        contexts: &mut Contexts<V, M>,
        new: impl Fn() -> Box<M>,
        points: impl Iterator<Item = (usize, &'a mut [u8])>,
        read: impl Fn(&mut M, &mut V, Option<&mut Cursor>, &mut [u8]),
    ) {
        if !self.is_read {
            for (context, out) in points {
                let (last, models) = contexts.turn(context, &new);
                read(models, last, None, out);
            }
            return;
        }
        let mut cursor = self.coder.enter(BLOCK * MOST);
        for (context, out) in points {
            let (last, models) = contexts.turn(context, &new);
            read(models, last, Some(&mut cursor), out);
        }
        let left = cursor.left();
        self.coder.leave(left);
    }
}

/// The fields beside a point.
enum LayeredFields {
    Color(Contexts<Rgb, color::SecondColor>, ItemLayer),
    Infrared(Contexts<u16, Infrared>, ItemLayer),
    Wave(Contexts<Packet, Waves>, ItemLayer),
    /// Each byte has a layer.
    Bytes(Vec<(Contexts<u8, Model<257, 256>>, ItemLayer)>),
}

impl LayeredFields {
    fn layers(&mut self) -> Vec<&mut ItemLayer> {
        match self {
            LayeredFields::Color(_, layer)
            | LayeredFields::Infrared(_, layer)
            | LayeredFields::Wave(_, layer) => {
                vec![layer]
            }
            LayeredFields::Bytes(bytes) => bytes.iter_mut().map(|(_, layer)| layer).collect(),
        }
    }

    fn which(&self) -> (Layers, &'static str) {
        match self {
            LayeredFields::Color(..) => (Layers::RGB, "colour"),
            LayeredFields::Infrared(..) => (Layers::NIR, "infrared"),
            LayeredFields::Wave(..) => (Layers::WAVES, "waveform packets"),
            LayeredFields::Bytes(..) => (Layers::EXTRA, "extra bytes"),
        }
    }

    /// Begins with the first of a chunk.
    fn begin(&mut self, context: usize, first: &[u8]) {
        match self {
            LayeredFields::Color(contexts, _) => {
                contexts
                    .begin(context, color::unpack(first), || Box::new(color::SecondColor::new()));
            }
            LayeredFields::Infrared(contexts, _) => {
                let value = first.first_chunk().map_or(0, |bytes| u16::from_le_bytes(*bytes));
                contexts.begin(context, value, || Box::new(Infrared::new()));
            }
            LayeredFields::Wave(contexts, _) => {
                let packet = first.first_chunk().map(Packet::unpack).unwrap_or_default();
                contexts.begin(context, packet, || Box::new(Waves::new()));
            }
            LayeredFields::Bytes(bytes) => {
                for ((contexts, _), first) in bytes.iter_mut().zip(first) {
                    contexts.begin(context, *first, || Box::new(const { Model::new(256) }));
                }
            }
        }
    }

    /// Reads those of a block, which begin at byte `at` of each record.
    fn read(&mut self, contexts: &[u8], records: &mut [u8], stride: usize, at: usize) {
        match self {
            LayeredFields::Color(all, layer) => {
                let points = points_from(at, contexts, records, stride);
                let new = || Box::new(color::SecondColor::new());
                layer.each(all, new, points, |models, last, cursor, out| {
                    if let Some(cursor) = cursor {
                        *last = models.read(cursor, *last);
                    }
                    color::pack(*last, out);
                });
            }
            LayeredFields::Infrared(all, layer) => {
                let points = points_from(at, contexts, records, stride);
                let new = || Box::new(Infrared::new());
                layer.each(all, new, points, |models, last, cursor, out| {
                    if let Some(cursor) = cursor {
                        *last = models.read(cursor, *last);
                    }
                    if let Some(out) = out.first_chunk_mut() {
                        *out = last.to_le_bytes();
                    }
                });
            }
            LayeredFields::Wave(all, layer) => {
                let points = points_from(at, contexts, records, stride);
                let new = || Box::new(Waves::new());
                layer.each(all, new, points, |models, last, cursor, out| {
                    if let Some(cursor) = cursor {
                        *last = models.read(cursor, last);
                    }
                    if let Some(out) = out.first_chunk_mut::<{ wave::SIZE }>() {
                        last.pack(out);
                    }
                });
            }
            LayeredFields::Bytes(bytes) => {
                for (i, (all, layer)) in bytes.iter_mut().enumerate() {
                    let points = points_from(at + i, contexts, records, stride);
                    let new = || Box::new(const { Model::new(256) });
                    layer.each(
                        all,
                        new,
                        points,
                        |model: &mut Model<257, 256>, last: &mut u8, cursor, out| {
                            if let Some(cursor) = cursor {
                                *last = last.wrapping_add(cursor.symbol(model) as u8);
                            }
                            if let Some(out) = out.first_mut() {
                                *out = *last;
                            }
                        },
                    );
                }
            }
        }
    }
}

/// The scanner channel of each point of a block, and its record from byte `at` on.
fn points_from<'a>(
    at: usize,
    contexts: &'a [u8],
    records: &'a mut [u8],
    stride: usize,
) -> impl Iterator<Item = (usize, &'a mut [u8])> {
    let points = records.chunks_exact_mut(stride).zip(contexts);
    points.filter_map(move |(record, &context)| Some((usize::from(context), record.get_mut(at..)?)))
}

/// The decoder of layered chunks.
pub struct Layered {
    point: Point14,
    /// Where the fields are in a record, and the fields.
    fields: Vec<(usize, LayeredFields)>,
    head: ByteStream,
    started: bool,
    wanted: Layers,
    start: u64,
}

impl Layered {
    /// A decoder that stands nowhere yet; `bytes` makes the streams.
    pub fn new(items: &[Item], bytes: impl Fn() -> ByteStream) -> Self {
        let layer = || ItemLayer { coder: Coder::new(bytes()), is_read: false, length: 0 };
        let mut fields = Vec::new();
        let version = items.first().map_or(3, |item| item.version);
        let mut at = 0;
        for &Item { kind, size, version } in items {
            match kind {
                10 => {}
                11 => fields.push((at, LayeredFields::Color(Contexts::new(version), layer()))),
                12 => {
                    fields.push((at, LayeredFields::Color(Contexts::new(version), layer())));
                    fields.push((at + 6, LayeredFields::Infrared(Contexts::new(version), layer())));
                }
                13 => fields.push((at, LayeredFields::Wave(Contexts::new(version), layer()))),
                _ => {
                    let bytes = (0..size).map(|_| (Contexts::new(version), layer())).collect();
                    fields.push((at, LayeredFields::Bytes(bytes)));
                }
            }
            at += usize::from(size);
        }
        Layered {
            point: Point14::new(version, &bytes),
            fields,
            head: bytes(),
            started: false,
            wanted: Layers::ALL,
            start: 0,
        }
    }

    /// Reads these layers alone; the fields of others stay what they are in the first point of a
    /// chunk.
    pub fn select(&mut self, wanted: Layers) {
        self.wanted = wanted;
    }

    /// Begins with the chunk `start..end` of the file, which was found to hold its layers.
    pub fn begin(&mut self, start: u64, end: u64) {
        self.started = false;
        self.start = start;
        self.head.move_to(start, end);
    }

    /// File position of the chunk.
    pub fn start(&self) -> u64 {
        self.start
    }

    /// Reads the next points, whole records.
    pub fn read(&mut self, records: &mut [u8], stride: usize) -> Result<(), Damage> {
        let first = if self.started { 0 } else { stride.min(records.len()) };
        let (first, others) = records.split_at_mut(first);
        if !first.is_empty() {
            self.first(first)?;
        }
        for block in others.chunks_mut(BLOCK * stride) {
            let contexts = self.point.read(block, stride);
            for (at, fields) in &mut self.fields {
                fields.read(contexts, block, stride, *at);
            }
        }
        self.check(Damage::of)
    }

    fn check(
        &mut self,
        check: impl Fn(&mut Coder, Option<&'static str>) -> Result<(), Damage>,
    ) -> Result<(), Damage> {
        self.point.check(&check)?;
        for (_, fields) in &mut self.fields {
            let name = fields.which().1;
            for layer in fields.layers().into_iter().filter(|layer| layer.is_read) {
                check(&mut layer.coder, Some(name))?;
            }
        }
        Ok(())
    }

    /// The first point of a chunk is stored as it is; behind it stand the lengths of the layers.
    fn first(&mut self, record: &mut [u8]) -> Result<(), Damage> {
        self.started = true;
        self.head.take(record);
        if let Some(point) = record.first_chunk() {
            let context = self.point.begin(point);
            for (at, fields) in &mut self.fields {
                fields.begin(context, record.get(*at..).unwrap_or_default());
            }
        }
        let mut word = || {
            let mut bytes = [0; 4];
            self.head.take(&mut bytes);
            u64::from(u32::from_le_bytes(bytes))
        };
        let _points = word();
        let lengths = std::array::from_fn(|_| word());
        for (_, fields) in &mut self.fields {
            for layer in fields.layers() {
                layer.length = word();
            }
        }
        let mut at = self.point.move_to(self.head.position(), &lengths, self.wanted);
        for (_, fields) in &mut self.fields {
            let wanted = self.wanted.has(fields.which().0);
            for layer in fields.layers() {
                layer.begin(at, layer.length, wanted);
                at += layer.length;
            }
        }
        if let Err(error) = self.head.failed() {
            return Err(Damage { why: Why::Unread(error), byte: self.start, layer: None });
        }
        self.check(Damage::of)
    }

    /// All points of the chunk were read: every layer must end here.
    pub fn finish(&mut self) -> Result<(), Damage> {
        self.check(Damage::at_end)
    }
}
