//! Colours of version 1, which the `laz` crate neither writes nor reads as LASzip does: it counts the upper
//! byte of blue among those of green, and reads upper bytes into those that were there. The rest of the
//! file is the crate's.

use std::io::{Cursor, Seek, SeekFrom, Write};

use laz::LazVlr;
use laz::compressors::{IntegerCompressor, IntegerCompressorBuilder};
use laz::encoders::ArithmeticEncoder;
use laz::las::v1;
use laz::models::{ArithmeticModel, ArithmeticModelBuilder};
use laz::record::{FieldCompressor, RecordCompressor, SequentialPointRecordCompressor};

use super::{Chunks, Recipe};

struct Colors {
    last: [u8; 6],
    changes: ArithmeticModel,
    bytes: IntegerCompressor,
}

impl<W: Write> FieldCompressor<W> for Colors {
    fn size_of_field(&self) -> usize {
        6
    }

    fn compress_first(&mut self, out: &mut W, bytes: &[u8]) -> std::io::Result<()> {
        self.last.copy_from_slice(bytes);
        out.write_all(bytes)
    }

    fn compress_with(
        &mut self,
        encoder: &mut ArithmeticEncoder<W>,
        bytes: &[u8],
    ) -> std::io::Result<()> {
        let changed = |i: usize| u32::from(self.last[i] != bytes[i]) << i;
        encoder.encode_symbol(&mut self.changes, (0..6).map(changed).sum())?;
        for (i, (last, &now)) in self.last.iter_mut().zip(bytes).enumerate() {
            if *last != now {
                self.bytes.compress(encoder, i32::from(*last), i32::from(now), i as u32)?;
            }
            *last = now;
        }
        Ok(())
    }
}

type Out = Cursor<Vec<u8>>;

/// Compresses records as one chunk, or as a whole file, behind what `out` holds.
fn chunk(laszip: &LazVlr, records: &[u8], out: Out) -> Out {
    let mut encoder = SequentialPointRecordCompressor::new(out);
    for item in laszip.items() {
        let mut code = Vec::new();
        LazVlr::from_laz_items(vec![*item]).write_to(&mut code).unwrap();
        match code[34] {
            6 => encoder.add_field_compressor(v1::LasPoint0Compressor::default()),
            7 => encoder.add_field_compressor(v1::LasGpsTimeCompressor::default()),
            8 => encoder.add_field_compressor(Colors {
                last: [0; 6],
                changes: ArithmeticModelBuilder::new(64).build(),
                bytes: IntegerCompressorBuilder::new().bits(8).contexts(6).build_initialized(),
            }),
            9 => encoder.add_field_compressor(v1::LasWavepacketCompressor::default()),
            _ => {
                let size = usize::from(item.size());
                encoder.add_field_compressor(v1::LasExtraByteCompressor::new(size));
            }
        }
    }
    encoder.compress_many(records).unwrap();
    encoder.done().unwrap();
    encoder.into_inner()
}

/// A chunk table: bytes of each chunk, and its points where these vary.
fn table(chunks: &[(usize, usize)], varies: bool, out: Out) -> Out {
    let mut out = out;
    out.write_all(&[0; 4]).unwrap();
    out.write_all(&(chunks.len() as u32).to_le_bytes()).unwrap();
    let mut encoder = ArithmeticEncoder::new(out);
    let mut numbers = IntegerCompressorBuilder::new().bits(32).contexts(2).build_initialized();
    let mut last = (0, 0);
    for &(points, bytes) in chunks {
        let now = (points as i32, bytes as i32);
        if varies {
            numbers.compress(&mut encoder, last.0, now.0, 0).unwrap();
        }
        numbers.compress(&mut encoder, last.1, now.1, 1).unwrap();
        last = now;
    }
    encoder.done().unwrap();
    encoder.into_inner()
}

/// Compresses records behind a header and its records.
pub fn compress(recipe: &Recipe, laszip: &LazVlr, records: &[u8], mut out: Out) -> Vec<u8> {
    let points = records.len() / recipe.stride();
    let sizes = match &recipe.chunks {
        Chunks::None => return chunk(laszip, records, out).into_inner(),
        Chunks::Fixed(each) => vec![*each as usize; points.div_ceil(*each as usize)],
        Chunks::Varying(sizes) => [sizes.as_slice(), &[usize::MAX]].concat(),
    };
    let start = out.seek(SeekFrom::End(0)).unwrap();
    out.write_all(&[0; 8]).unwrap();
    let (mut rest, mut chunks) = (records, Vec::new());
    for size in sizes {
        let (now, behind) = rest.split_at(size.saturating_mul(recipe.stride()).min(rest.len()));
        if now.is_empty() {
            break;
        }
        let from = out.position();
        out = chunk(laszip, now, out);
        chunks.push((now.len() / recipe.stride(), (out.position() - from) as usize));
        rest = behind;
    }
    let at = out.position();
    out = table(&chunks, matches!(recipe.chunks, Chunks::Varying(_)), out);
    out.seek(SeekFrom::Start(start)).unwrap();
    out.write_all(&at.to_le_bytes()).unwrap();
    out.into_inner()
}
