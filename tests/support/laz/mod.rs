//! What the tests of the LAZ decoder share: files of every format and kind of compression, written by the
//! `laz` crate from made-up records, and that crate as the second opinion on any file.

mod colors;
pub mod damage;
pub mod points;

use std::fs::File;
use std::io::{BufReader, Cursor, Seek, SeekFrom};
use std::path::Path;

use laz::record::{RecordCompressor, SequentialPointRecordCompressor};
use laz::{LasZipCompressor, LasZipDecompressor, LazVlr};
use pointmill::Result;
use pointmill::io::las::open;

use super::las_file::STRIDES;
use super::records::read_without;

/// Bytes of the header of LAS 1.4.
const HEADER: usize = 375;
/// Step of stored coordinates.
const SCALE: f64 = 0.01;

/// How the points of a file are cut into chunks.
#[derive(Debug, Clone)]
pub enum Chunks {
    /// Not at all: compressor 1.
    None,
    /// Each has so many points, the last may have fewer.
    Fixed(u32),
    /// Each has as many points as it is said here, the last has the rest.
    Varying(Vec<usize>),
}

/// How a file is compressed.
#[derive(Debug, Clone)]
pub struct Recipe {
    pub format: u8,
    /// Bytes behind the fields of the format.
    pub extra: usize,
    /// Version of all items; 1 or 2 for formats 0 to 5, 3 or 4 for the others.
    pub version: u16,
    pub chunks: Chunks,
}

fn put(data: &mut [u8], at: usize, bytes: &[u8]) {
    data[at..at + bytes.len()].copy_from_slice(bytes);
}

impl Recipe {
    /// Bytes of a record.
    pub fn stride(&self) -> usize {
        STRIDES[usize::from(self.format)] + self.extra
    }

    /// True if the crate reads no such file as LASzip does: colours of version 1.
    pub fn is_beyond_the_crate(&self) -> bool {
        self.version == 1 && matches!(self.format, 2 | 3 | 5)
    }

    /// The payload of the laszip record.
    fn laszip(&self) -> Vec<u8> {
        const TYPES: [&[u16]; 11] = [
            &[6],
            &[6, 7],
            &[6, 8],
            &[6, 7, 8],
            &[6, 7, 9],
            &[6, 7, 8, 9],
            &[10],
            &[10, 11],
            &[10, 12],
            &[10, 13],
            &[10, 12, 13],
        ];
        let size = |kind| match kind {
            6 => 20,
            7 | 12 => 8,
            8 | 11 => 6,
            9 | 13 => 29,
            _ => 30,
        };
        let fixed = TYPES[usize::from(self.format)];
        let mut items: Vec<(u16, u16)> = fixed.iter().map(|&kind| (kind, size(kind))).collect();
        if self.extra > 0 {
            items.push((if self.format < 6 { 0 } else { 14 }, self.extra as u16));
        }
        let compressor: u16 = match self.chunks {
            Chunks::None => 1,
            _ if self.format < 6 => 2,
            _ => 3,
        };
        let each = match self.chunks {
            Chunks::None => 50_000, // Means nothing.
            Chunks::Fixed(each) => each,
            Chunks::Varying(_) => u32::MAX,
        };
        let mut payload = compressor.to_le_bytes().to_vec();
        payload.extend([0, 0, 3, 4, 0, 0, 0, 0, 0, 0]);
        payload.extend(each.to_le_bytes());
        payload.extend([0xff; 16]);
        payload.extend((items.len() as u16).to_le_bytes());
        for (kind, size) in items {
            payload.extend([kind, size, self.version].iter().flat_map(|word| word.to_le_bytes()));
        }
        payload
    }

    /// A LAS 1.4 file of these records.
    pub fn bake(&self, records: &[u8]) -> Vec<u8> {
        let payload = self.laszip();
        let points = (records.len() / self.stride()) as u32;
        let mut file = vec![0; HEADER + 54];
        put(&mut file, 0, b"LASF");
        put(&mut file, 24, &[1, 4]);
        put(&mut file, 94, &(HEADER as u16).to_le_bytes());
        put(&mut file, 96, &((HEADER + 54 + payload.len()) as u32).to_le_bytes());
        put(&mut file, 100, &1u32.to_le_bytes());
        file[104] = self.format | 0x80;
        put(&mut file, 105, &(self.stride() as u16).to_le_bytes());
        if self.format < 6 {
            put(&mut file, 107, &points.to_le_bytes());
        } else {
            file[6] = 16; // The coordinate reference system is WKT.
        }
        for axis in 0..3 {
            put(&mut file, 131 + 8 * axis, &SCALE.to_le_bytes());
            let stored = records.chunks(self.stride()).filter_map(|record| {
                record[4 * axis..].first_chunk().map(|bytes| i32::from_le_bytes(*bytes))
            });
            let (lo, hi) = stored.fold((i32::MAX, i32::MIN), |(lo, hi), v| (lo.min(v), hi.max(v)));
            put(&mut file, 179 + 16 * axis, &(f64::from(hi) * SCALE).to_le_bytes());
            put(&mut file, 187 + 16 * axis, &(f64::from(lo) * SCALE).to_le_bytes());
        }
        put(&mut file, 247, &u64::from(points).to_le_bytes());
        put(&mut file, HEADER + 2, b"laszip encoded");
        put(&mut file, HEADER + 18, &22204u16.to_le_bytes());
        put(&mut file, HEADER + 20, &(payload.len() as u16).to_le_bytes());
        file.extend(&payload);
        self.compress(file, LazVlr::from_buffer(&payload).unwrap(), records)
    }

    fn compress(&self, file: Vec<u8>, laszip: LazVlr, records: &[u8]) -> Vec<u8> {
        let mut out = Cursor::new(file);
        out.seek(SeekFrom::End(0)).unwrap();
        if self.is_beyond_the_crate() {
            return colors::compress(self, &laszip, records, out);
        }
        if matches!(self.chunks, Chunks::None) {
            let mut encoder = SequentialPointRecordCompressor::new(out);
            encoder.set_fields_from(laszip.items()).unwrap();
            encoder.compress_many(records).unwrap();
            encoder.done().unwrap();
            return encoder.into_inner().into_inner();
        }
        let mut encoder = LasZipCompressor::new(out, laszip).unwrap();
        let mut rest = records;
        if let Chunks::Varying(sizes) = &self.chunks {
            for points in sizes {
                // The encoder ends the last chunk by itself.
                let (now, behind) = rest.split_at((points * self.stride()).min(rest.len()));
                if behind.is_empty() {
                    break;
                }
                encoder.compress_many(now).unwrap();
                encoder.finish_current_chunk().unwrap();
                rest = behind;
            }
        }
        encoder.compress_many(rest).unwrap();
        encoder.done().unwrap();
        encoder.into_inner().into_inner()
    }
}

/// A file as the `laz` crate reads it.
pub struct Theirs {
    decoder: LasZipDecompressor<'static, BufReader<File>>,
    stride: usize,
    /// Points left.
    pub left: u64,
}

impl Theirs {
    /// None if the file is not compressed in a way that the crate knows.
    pub fn open(path: &Path) -> Option<Self> {
        let bytes = std::fs::read(path).unwrap();
        let number = |at: usize, size: usize| {
            bytes[at..at + size].iter().rev().fold(0u64, |all, &byte| (all << 8) | u64::from(byte))
        };
        let mut at = number(94, 2) as usize;
        let mut laszip = None;
        for _ in 0..number(100, 4) {
            let payload = at + 54..at + 54 + number(at + 20, 2) as usize;
            if number(at + 18, 2) == u64::from(LazVlr::RECORD_ID) {
                laszip = LazVlr::from_buffer(&bytes[payload.clone()]).ok();
            }
            at = payload.end;
        }
        let left = if number(25, 1) >= 4 { number(247, 8) } else { number(107, 4) };
        let mut reader = BufReader::with_capacity(1 << 16, File::open(path).unwrap());
        reader.seek(SeekFrom::Start(number(96, 4))).unwrap();
        let decoder = LasZipDecompressor::new(reader, laszip?).ok()?;
        Some(Theirs { decoder, stride: number(105, 2) as usize, left })
    }

    /// The next `points` records.
    pub fn next(&mut self, points: usize) -> Vec<u8> {
        let mut records = vec![0; points * self.stride];
        self.decoder.decompress_many(&mut records).unwrap();
        self.left -= points as u64;
        records
    }
}

/// All records of a file.
pub fn read_file(path: &Path, capacity: usize) -> Result<Vec<u8>> {
    read_without(&*open(&[path.to_owned()])?, capacity, &[])
}

/// Where two runs of records first differ, in words.
pub fn difference(ours: &[u8], theirs: &[u8], stride: usize) -> Option<String> {
    if ours == theirs {
        return None;
    }
    let at = ours.iter().zip(theirs).position(|(a, b)| a != b);
    let at = at.unwrap_or(ours.len().min(theirs.len()));
    let counts = (ours.len() / stride, theirs.len() / stride);
    Some(format!("{counts:?} records differ at record {}, byte {}", at / stride, at % stride))
}
