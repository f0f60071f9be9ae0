//! Compressed points (LAZ), decoded by ourselves.

mod coder;
mod color;
mod context;
mod damage;
mod integer;
mod interleaved;
mod layer;
mod layered;
mod layers;
mod model;
mod places;
mod point10;
mod point14;
mod predict;
mod record;
mod stream;
mod time;
mod wave;

pub use damage::{Damage, Why};
pub use layers::Layers;
pub use record::{CHUNK_POINTS, Compression, Compressor, LASZIP};

use super::file::InputFile;
use coder::Coder;
use integer::Integers;
use interleaved::Interleaved;
use layered::Layered;
use stream::Bytes;

/// The decoder of compressed points.
pub struct Decoder {
    stride: usize,
    kind: Kind,
}

enum Kind {
    Interleaved(Box<Interleaved>),
    Layered(Box<Layered>),
}

impl Decoder {
    /// A decoder that stands nowhere yet.
    pub fn new(compression: &Compression, file: &InputFile) -> Self {
        let bytes = || Bytes::new(file.clone());
        let items = compression.items();
        let kind = match compression.compressor {
            Compressor::Layered => Kind::Layered(Box::new(Layered::new(items, bytes))),
            _ => Kind::Interleaved(Box::new(Interleaved::new(items, bytes()))),
        };
        Decoder { stride: compression.stride, kind }
    }

    /// Reads these layers alone, where there are layers.
    pub fn select(&mut self, wanted: Layers) {
        if let Kind::Layered(layered) = &mut self.kind {
            layered.select(wanted);
        }
    }

    /// Begins with the chunk `start..end` of the file.
    pub fn begin(&mut self, start: u64, end: u64) {
        match &mut self.kind {
            Kind::Interleaved(decoder) => decoder.begin(start, end),
            Kind::Layered(decoder) => decoder.begin(start, end),
        }
    }

    /// Reads the next points, whole records.
    pub fn read(&mut self, records: &mut [u8]) -> Result<(), Damage> {
        match &mut self.kind {
            Kind::Interleaved(decoder) => decoder.read(records, self.stride),
            Kind::Layered(decoder) => decoder.read(records, self.stride),
        }
    }

    /// File position of the next byte of a stream of points; of layered ones, of the chunk.
    pub fn position(&mut self) -> u64 {
        match &mut self.kind {
            Kind::Interleaved(decoder) => decoder.position(),
            Kind::Layered(decoder) => decoder.start(),
        }
    }

    /// All points of a chunk were read that has no known end.
    pub fn pause(&mut self) -> Result<(), Damage> {
        match &mut self.kind {
            Kind::Interleaved(decoder) => decoder.pause(),
            Kind::Layered(decoder) => decoder.finish(),
        }
    }

    /// All points of the chunk were read: its bytes must end here.
    pub fn finish(&mut self) -> Result<(), Damage> {
        match &mut self.kind {
            Kind::Interleaved(decoder) => decoder.finish(),
            Kind::Layered(decoder) => decoder.finish(),
        }
    }
}

/// The numbers of a chunk table.
pub struct Numbers {
    coder: Coder,
    integers: Box<Integers<32, 2>>,
}

impl Numbers {
    /// Those from byte `at` of the file.
    pub fn new(file: &InputFile, at: u64) -> Self {
        let mut coder = Coder::new(Bytes::new(file.clone()));
        coder.bytes().move_to(at, file.len());
        coder.start();
        Numbers { coder, integers: Box::new(Integers::new()) }
    }

    /// The next number of its kind, 0 or 1.
    pub fn read(&mut self, last: i32, kind: usize) -> Result<i32, Damage> {
        let mut cursor = self.coder.enter(layer::MOST);
        let number = self.integers.read(&mut cursor, last, kind & 1);
        let left = cursor.left();
        self.coder.leave(left);
        Damage::of(&mut self.coder, None).map(|()| number)
    }
}
