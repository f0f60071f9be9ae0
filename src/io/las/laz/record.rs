//! How the points of a LAZ file are compressed: its laszip record, proven before the decoder sees
//! it, and the record that we write. Source: LASzip's `laszip.hpp` and the LAZ specification 1.4.

use std::borrow::Cow;

use laz::record::{
    LayeredPointRecordCompressor, RecordCompressor, SequentialPointRecordCompressor,
};
use laz::{LazItem, LazVlr};

use super::super::file::InputFile;
use super::super::format::record_size;
use super::super::guard::unpanicked;
use super::super::vlr::Vlr;
use crate::{Error, Result};

/// Points of a chunk that we write.
pub const CHUNK_POINTS: u32 = 50_000;
/// User and number of the record that describes the compression.
pub const LASZIP: (&str, u16) = ("laszip encoded", 22204);
/// A chunk size that means: as the chunk table says, chunk by chunk.
const VARIABLE: u32 = u32::MAX;

/// How chunks are laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compressor {
    /// One stream for the whole file, without a chunk table.
    PointWise,
    /// Chunks of interleaved points; formats 0 to 5.
    Chunked,
    /// Chunks whose fields are apart; formats 6 to 10.
    Layered,
}

impl Item {
    /// Bytes that these fields cost a point at most: two a symbol, eight a whole number.
    pub fn most_bytes(&self) -> usize {
        match self.kind {
            6 => 64,
            9 => 72,
            0 | 14 => 2 * usize::from(self.size),
            _ => 32,
        }
    }
}

/// How the points of a file are compressed.
#[derive(Debug, Clone)]
pub struct Compression {
    /// How chunks are laid out.
    pub compressor: Compressor,
    /// Points of a chunk; None where the chunk table tells it chunk by chunk.
    pub chunk_points: Option<u32>,
    /// Compressed layers of a chunk (0 if it is not layered).
    pub layers: usize,
    /// Bytes of a record.
    pub stride: usize,
    items: Vec<Item>,
}

/// One group of fields as the laszip record has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Item {
    /// Its type.
    pub kind: u16,
    /// Its bytes in a record.
    pub size: u16,
    /// How it is compressed.
    pub version: u16,
}

impl Compression {
    /// Reads the laszip record `vlr`, whose payload is at byte `at` of `file`, for records of
    /// `format` that are `stride` bytes long.
    pub fn read(file: &InputFile, vlr: &Vlr, at: u64, format: u8, stride: u16) -> Result<Self> {
        let bytes = vlr.payload();
        let word = |i: usize| u16::from_le_bytes([bytes[i], bytes[i + 1]]);
        let wrong = |byte: u64, message: String| {
            file.wrong(at + byte, message).help("the file is damaged, or newer than LASzip 3.4")
        };
        if bytes.len() < 34 || (bytes.len() - 34) / 6 < usize::from(word(32)) {
            return Err(wrong(0, "the laszip record is too short for what it claims".into()));
        }
        let compressor = match (word(0), format < 6) {
            (1, true) => Compressor::PointWise,
            (2, true) => Compressor::Chunked,
            (3, false) => Compressor::Layered,
            (kind, _) => {
                let message = format!("LAZ compressor {kind} with point format {format}");
                return Err(wrong(0, message + " cannot be read"));
            }
        };
        if word(2) != 0 {
            return Err(wrong(2, format!("LAZ coder {} is not known", word(2))));
        }
        let items: Vec<Item> = (0..usize::from(word(32)))
            .map(|i| 34 + 6 * i)
            .map(|i| Item { kind: word(i), size: word(i + 2), version: word(i + 4) })
            .collect();
        check_items(&items, format, stride).map_err(|why| wrong(34, why))?;
        let chunk = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]);
        Ok(Compression {
            compressor,
            chunk_points: (chunk != 0 && chunk != VARIABLE).then_some(chunk),
            layers: layers(&items),
            stride: usize::from(stride),
            items,
        })
    }

    /// The compression that we write for `format` with `stride` bytes a record, and its record.
    pub fn write(format: u8, stride: u16) -> Result<(Self, Vlr)> {
        Compression::of_chunks(format, stride, CHUNK_POINTS)
    }

    /// The same for chunks whose points the chunk table tells one by one.
    pub fn write_varying(format: u8, stride: u16) -> Result<(Self, Vlr)> {
        Compression::of_chunks(format, stride, VARIABLE)
    }

    fn of_chunks(format: u8, stride: u16, chunk_points: u32) -> Result<(Self, Vlr)> {
        let items = default_items(format, stride);
        let compressor = if format < 6 { Compressor::Chunked } else { Compressor::Layered };
        let payload = payload(compressor, &items, chunk_points);
        let compression = Compression {
            compressor,
            chunk_points: (chunk_points != VARIABLE).then_some(chunk_points),
            layers: layers(&items),
            stride: usize::from(stride),
            items,
        };
        Ok((compression, Vlr::new(LASZIP.0, LASZIP.1, LazVlr::DESCRIPTION, payload)))
    }

    /// The groups of fields of a record.
    pub fn items(&self) -> &[Item] {
        &self.items
    }

    /// Compresses records, a whole number of them, as one chunk behind what `out` holds.
    pub fn encode(&self, records: &[u8], out: Vec<u8>) -> Result<Vec<u8>> {
        self.encode_each(std::iter::once(Ok(Cow::Borrowed(records))), out)
    }

    /// The same for records that come in pieces, each a whole number of them.
    pub fn encode_each<'a>(
        &self,
        pieces: impl Iterator<Item = Result<Cow<'a, [u8]>>>,
        out: Vec<u8>,
    ) -> Result<Vec<u8>> {
        let failed = || Error::internal("the LAZ encoder failed");
        let mut encoder: Box<dyn RecordCompressor<Vec<u8>>> = match self.compressor {
            Compressor::Layered => Box::new(LayeredPointRecordCompressor::new(out)),
            _ => Box::new(SequentialPointRecordCompressor::new(out)),
        };
        unpanicked(move || {
            encoder.set_fields_from(&self.encoded_items()?).map_err(|e| failed().because(e))?;
            for records in pieces {
                let records = self.without_signs_of_zero(records?);
                encoder.compress_many(&records).map_err(|e| failed().because(e))?;
            }
            encoder.done().map_err(|e| failed().because(e))?;
            Ok(encoder.box_into_inner())
        })
        .unwrap_or_else(|| Err(failed()))
    }

    /// The encoder compares the GPS times of layered records as numbers and would take -0 for the 0
    /// before it, at random as chunks are cut: here all of them are 0, which is the same time.
    fn without_signs_of_zero<'a>(&self, records: Cow<'a, [u8]>) -> Cow<'a, [u8]> {
        const TIME: std::ops::Range<usize> = 22..30;
        let negative = (-0.0f64).to_le_bytes();
        let is_signed = |record: &[u8]| record.get(TIME) == Some(&negative[..]);
        let layered = self.compressor == Compressor::Layered;
        if !layered || !records.chunks_exact(self.stride).any(is_signed) {
            return records;
        }
        let mut records = records.into_owned();
        for record in records.chunks_exact_mut(self.stride).filter(|record| is_signed(record)) {
            record[TIME].fill(0);
        }
        Cow::Owned(records)
    }

    /// The items as the encoder takes them.
    fn encoded_items(&self) -> Result<Vec<LazItem>> {
        let record: Vec<u8> = payload(self.compressor, &self.items, CHUNK_POINTS);
        let parsed = LazVlr::from_buffer(&record)
            .map_err(|e| Error::internal("our own laszip record is wrong").because(e))?;
        Ok(parsed.items().clone())
    }

    /// Upper estimate of what a decoder or an encoder holds besides records: models of what was
    /// learned, of four scanner channels, and a window of each stream. Each extra byte has models
    /// of its own.
    pub fn state_bytes(&self) -> u64 {
        let of = |kinds: [u16; 2]| {
            let items = self.items.iter().filter(move |item| kinds.contains(&item.kind));
            items.map(|item| u64::from(item.size)).sum::<u64>()
        };
        let waves = if of([9, 13]) > 0 { 1 << 20 } else { 0 };
        (3 << 20) + waves + 24 * 1024 * self.layers as u64 + 8 * 1024 * of([0, 14])
    }
}

/// The laszip record that we write.
fn payload(compressor: Compressor, items: &[Item], chunk_points: u32) -> Vec<u8> {
    let kind: u16 = if compressor == Compressor::Layered { 3 } else { 2 };
    let mut payload = Vec::new();
    payload.extend(kind.to_le_bytes());
    payload.extend([0, 0, 2, 2, 0, 0]); // coder 0, LASzip 2.2 revision 0
    payload.extend(0u32.to_le_bytes());
    payload.extend(chunk_points.to_le_bytes());
    payload.extend([0xff; 16]); // no special extended records
    payload.extend((items.len() as u16).to_le_bytes());
    for Item { kind, size, version } in items {
        payload.extend([kind, size, version].iter().flat_map(|word| word.to_le_bytes()));
    }
    payload
}

/// Types of the fixed field groups of a format, in record order.
fn types(format: u8) -> &'static [u16] {
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
    TYPES.get(usize::from(format)).copied().unwrap_or_default()
}

/// Bytes of a fixed field group.
fn size_of(kind: u16) -> u16 {
    match kind {
        6 => 20,
        7 | 12 => 8,
        8 | 11 => 6,
        9 | 13 => 29,
        10 => 30,
        _ => 0,
    }
}

/// The groups must be those of the format, in order, and fill the record: the decoder writes as
/// many bytes as they say.
fn check_items(items: &[Item], format: u8, stride: u16) -> Result<(), String> {
    let fixed = types(format);
    let (bytes, versions) = if format < 6 { (0, 1..=2) } else { (14, 3..=4) };
    let mut total = 0u64;
    for (i, &Item { kind, size, version }) in items.iter().enumerate() {
        let expected = fixed.get(i).copied().unwrap_or(bytes);
        let right = if kind == bytes { size > 0 } else { size == size_of(kind) };
        if kind != expected || !right {
            return Err(format!(
                "LAZ item {i} is type {kind} of {size} bytes, which point format {format} does \
                 not have there"
            ));
        }
        if !versions.contains(&version) {
            return Err(format!("version {version} of LAZ item type {kind} is not known"));
        }
        total += u64::from(size);
    }
    if items.len() < fixed.len() || total != u64::from(stride) {
        return Err(format!(
            "the LAZ items describe {total} bytes of the {stride} that a record has"
        ));
    }
    Ok(())
}

/// The items that we write. LASzip knows version 1 alone of the waveform packets of formats 4 and
/// 5.
fn default_items(format: u8, stride: u16) -> Vec<Item> {
    let version = |kind| match kind {
        9 => 1,
        _ if format < 6 => 2,
        _ => 3,
    };
    let item = |kind, size| Item { kind, size, version: version(kind) };
    let mut items: Vec<Item> =
        types(format).iter().map(|&kind| item(kind, size_of(kind))).collect();
    let extra = stride - record_size(format).unwrap_or(0).min(stride);
    if extra > 0 {
        let kind = if format < 6 { 0 } else { 14 };
        items.push(item(kind, extra));
    }
    items
}

/// Compressed layers that a chunk of these items has: nine of a point, one each of colour, infrared
/// and waveform, one of every extra byte.
fn layers(items: &[Item]) -> usize {
    items
        .iter()
        .map(|&Item { kind, size, .. }| match kind {
            10 => 9,
            11 | 13 => 1,
            12 => 2,
            14 => usize::from(size),
            _ => 0,
        })
        .sum()
}
