//! Encoding a chunk of records, on any thread: normals put in, counted, compressed.

use std::borrow::Cow;

use super::laz::{CHUNK_POINTS, Compression};
use super::native::normals_of;
use crate::point::{Dimension, Endian, PointBatch, Schema, Spare, Value};
use crate::stage::{Encode, Encoded};
use crate::{Error, Result};

/// Bytes of a normal behind a record: three f32.
const NORMAL_BYTES: usize = 12;

/// Where normals go.
#[derive(Debug, Clone, PartialEq)]
pub enum Normals {
    /// Nowhere.
    Unwritten,
    /// Into dimensions that the record has.
    InPlace(Box<[Dimension; 3]>),
    /// Behind the record.
    Appended,
}

impl Normals {
    /// Where the normals of records of `schema` go if they are `asked` for.
    pub fn plan(schema: &Schema, asked: bool) -> Self {
        match (asked, normals_of(schema)) {
            (false, _) => Normals::Unwritten,
            (true, Some(dimensions)) => Normals::InPlace(Box::new(dimensions.map(Clone::clone))),
            (true, None) => Normals::Appended,
        }
    }

    /// Bytes that they make a record longer.
    pub fn appended_bytes(&self) -> usize {
        if *self == Normals::Appended { NORMAL_BYTES } else { 0 }
    }
}

/// Encodes chunks of one output.
pub struct LasEncoder {
    /// Bytes of a record as it arrives.
    stride: usize,
    /// Bits of the byte at 14 that hold the return number.
    return_bits: u8,
    /// Where normals go.
    pub normals: Normals,
    /// How records are compressed, if they are.
    pub compression: Option<Compression>,
    /// For the bytes of chunks; whoever has written one puts them back.
    pub spare: Spare<Vec<u8>>,
}

impl LasEncoder {
    /// An encoder of records of `schema`, in point format `format`.
    pub fn new(
        format: u8,
        schema: &Schema,
        normals: Normals,
        compression: Option<Compression>,
    ) -> Self {
        let return_bits = if format < 6 { 0b111 } else { 0b1111 };
        let (stride, spare) = (schema.stride, Spare::default());
        LasEncoder { stride, return_bits, normals, compression, spare }
    }

    /// Upper estimate of what encoding one chunk holds: records with normals, the compressor's
    /// layers, the output.
    pub fn chunk_bytes(&self) -> u64 {
        let record = (self.stride + self.normals.appended_bytes()) as u64;
        let copies = match (&self.normals, &self.compression) {
            (Normals::Unwritten, None) => 1,
            (_, None) => 2,
            // A chunk that does not compress grows by an eighth at most.
            (_, Some(_)) => 4,
        };
        let state = self.compression.as_ref().map_or(0, Compression::state_bytes);
        u64::from(CHUNK_POINTS) * record * copies + state
    }

    fn records<'a>(&self, batch: &'a PointBatch) -> Result<Cow<'a, [u8]>> {
        if batch.is_empty() || self.normals == Normals::Unwritten {
            return Ok(Cow::Borrowed(batch.records()));
        }
        let normals =
            batch.normals.as_ref().filter(|normals| normals.len() == batch.len()).ok_or_else(
                || {
                    Error::pipeline("normals are to be written and no stage computes them").help(
                        "put a stage 'normals' above, or do not ask for NormalX, NormalY, NormalZ",
                    )
                },
            )?;
        if let Normals::InPlace(dimensions) = &self.normals {
            let mut records = batch.records().to_vec();
            for (record, normal) in records.chunks_exact_mut(self.stride).zip(normals) {
                for (dimension, &value) in dimensions.iter().zip(normal) {
                    put_normal(dimension, record, value)?;
                }
            }
            return Ok(Cow::Owned(records));
        }
        let mut records = Vec::with_capacity(batch.len() * (self.stride + NORMAL_BYTES));
        for (record, normal) in batch.iter().zip(normals) {
            records.extend_from_slice(record);
            normal.iter().for_each(|value| records.extend(value.to_le_bytes()));
        }
        Ok(Cow::Owned(records))
    }
}

/// Stores one component of a normal, rounded to what the dimension can hold.
fn put_normal(dimension: &Dimension, record: &mut [u8], value: f32) -> Result<()> {
    let stored = (f64::from(value) - dimension.origin) / dimension.scale;
    let value = if dimension.scalar.is_float() {
        Value::Single(stored as f32)
    } else if value.is_nan() {
        Value::Signed(0)
    } else {
        Value::Double(stored.round())
    };
    if dimension.put(record, Endian::Little, value) {
        return Ok(());
    }
    Err(Error::pipeline(format!("the dimension {} cannot hold a normal", dimension.name))
        .help("drop the input's normals before new ones are written"))
}

impl Encode for LasEncoder {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let records = self.records(batch)?;
        let stride = self.stride + self.normals.appended_bytes();
        let mut encoded = Encoded { points: batch.len() as u64, ..Encoded::default() };
        let (mut lo, mut hi) = ([i32::MAX; 3], [i32::MIN; 3]);
        for record in records.chunks_exact(stride) {
            let Some(stored) = record.first_chunk::<12>() else { continue };
            for (axis, bytes) in stored.as_chunks::<4>().0.iter().enumerate() {
                let value = i32::from_le_bytes(*bytes);
                lo[axis] = lo[axis].min(value);
                hi[axis] = hi[axis].max(value);
            }
            let number = usize::from(record[14] & self.return_bits);
            if number > 0 {
                encoded.returns[number - 1] += 1;
            }
        }
        if encoded.points > 0 {
            (encoded.lo, encoded.hi) = (lo.map(i64::from), hi.map(i64::from));
            encoded.bytes = match (&self.compression, records) {
                (None, Cow::Owned(records)) => records,
                (None, Cow::Borrowed(records)) => {
                    let mut bytes = self.spare.take(|| Vec::with_capacity(records.len()));
                    bytes.clear();
                    bytes.extend_from_slice(records);
                    bytes
                }
                (Some(compression), records) => {
                    let mut bytes = self.spare.take(|| Vec::with_capacity(records.len() / 4));
                    bytes.clear();
                    compression.encode(&records, bytes)?
                }
            };
        }
        Ok(encoded)
    }
}
