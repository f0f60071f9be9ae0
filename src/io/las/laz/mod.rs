//! Compressed points (LAZ): a decoder that is safe by construction, tells damage and is quick.
//!
//! LAZ predicts each field of a point from the points before and stores what is left by an
//! arithmetic coder, whose models follow the data. It has no checksum, and each symbol can only be
//! read when the one before is known.
//!
//! *Safe.* No step can fail or leave its buffers, whatever the bytes are: each symbol is one of its
//! model, bytes behind the end of a stream are zeros, and streams are read by windows, so that no
//! claimed size allocates anything. What cannot be right is kept in mind and asked for after some
//! points.
//!
//! *Damage shows at the end of a stream.* The encoder's last bytes are determined by where its
//! interval lies, and it pads them so that the decoder, which reads ahead, ends exactly with them.
//! Points decoded from other bytes nearly never lead there. In layered chunks every layer has such
//! an end.
//!
//! *Quick.* `coder` and `layer` say how.
//!
//! | module | holds |
//! |---|---|
//! | `stream`, `coder`, `model`, `integer` | bytes, symbols, how likely they are, whole numbers |
//! | `predict` | what a point is predicted from |
//! | `point10`, `time`, `color`, `wave` | fields of formats 0 to 5, two of them layers as well |
//! | `layer`, `places`, `point14`, `context` | the layers of formats 6 to 10 |
//! | `interleaved`, `layered` | chunks of the two |
//! | `record` | the laszip record; encoding, by the `laz` crate |
//!
//! Source: LAZ specification 1.4, and LASzip 3.5 and the `laz` crate where it leaves something
//! open.

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
use stream::ByteStream;

/// The decoder of compressed points.
pub struct Decoder {
    stride: usize,
    kind: ChunkDecoder,
}

enum ChunkDecoder {
    Interleaved(Box<Interleaved>),
    Layered(Box<Layered>),
}

impl Decoder {
    /// A decoder that stands nowhere yet.
    pub fn new(compression: &Compression, file: &InputFile) -> Self {
        let bytes = || ByteStream::new(file.clone());
        let items = compression.items();
        let kind = match compression.compressor {
            Compressor::Layered => ChunkDecoder::Layered(Box::new(Layered::new(items, bytes))),
            _ => ChunkDecoder::Interleaved(Box::new(Interleaved::new(items, bytes()))),
        };
        Decoder { stride: compression.stride, kind }
    }

    /// Reads these layers alone, where there are layers.
    pub fn select(&mut self, wanted: Layers) {
        if let ChunkDecoder::Layered(layered) = &mut self.kind {
            layered.select(wanted);
        }
    }

    /// Begins with the chunk `start..end` of the file.
    pub fn begin(&mut self, start: u64, end: u64) {
        match &mut self.kind {
            ChunkDecoder::Interleaved(decoder) => decoder.begin(start, end),
            ChunkDecoder::Layered(decoder) => decoder.begin(start, end),
        }
    }

    /// Reads the next points, whole records.
    pub fn read(&mut self, records: &mut [u8]) -> Result<(), Damage> {
        match &mut self.kind {
            ChunkDecoder::Interleaved(decoder) => decoder.read(records, self.stride),
            ChunkDecoder::Layered(decoder) => decoder.read(records, self.stride),
        }
    }

    /// File position of the next byte of a stream of points; of layered ones, of the chunk.
    pub fn position(&mut self) -> u64 {
        match &mut self.kind {
            ChunkDecoder::Interleaved(decoder) => decoder.position(),
            ChunkDecoder::Layered(decoder) => decoder.start(),
        }
    }

    /// All points of a chunk were read that has no known end.
    pub fn pause(&mut self) -> Result<(), Damage> {
        match &mut self.kind {
            ChunkDecoder::Interleaved(decoder) => decoder.pause(),
            ChunkDecoder::Layered(decoder) => decoder.finish(),
        }
    }

    /// All points of the chunk were read: its bytes must end here.
    pub fn finish(&mut self) -> Result<(), Damage> {
        match &mut self.kind {
            ChunkDecoder::Interleaved(decoder) => decoder.finish(),
            ChunkDecoder::Layered(decoder) => decoder.finish(),
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
        let mut coder = Coder::new(ByteStream::new(file.clone()));
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
