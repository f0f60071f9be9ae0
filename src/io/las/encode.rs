//! Encoding a chunk of records, on any thread: computed dimensions put in, counted, compressed.

use std::borrow::Cow;

use super::laz::{CHUNK_POINTS, Compression};
use crate::point::{
    COLUMN_ENDIAN, ComputedDimension, Dimension, Endian, PointBatch, Scalar, Schema, Spare, Value,
};
use crate::stage::{Encode, Encoded};
use crate::{Error, Result};

/// Where computed dimensions go.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ComputedFields {
    /// Into dimensions that the record has.
    in_place: Vec<(ComputedDimension, Dimension)>,
    /// Behind the record, one after the other.
    pub appended: Vec<ComputedDimension>,
}

impl ComputedFields {
    /// Where those of `computed` go in records of `schema`.
    pub fn of(schema: &Schema, computed: &[ComputedDimension]) -> Self {
        let mut fields = ComputedFields::default();
        for dimension in computed {
            match schema.find(dimension.name) {
                Some(found) => fields.in_place.push((*dimension, found.clone())),
                None => fields.appended.push(*dimension),
            }
        }
        fields
    }

    /// Where the dimension `name` is in records of `schema` with these.
    pub fn place_of(&self, schema: &Schema, name: &str) -> Option<Dimension> {
        let mut at = schema.stride;
        let appended = self.appended.iter().find_map(|dimension| {
            let field = Dimension::new(dimension.name, dimension.scalar(), at);
            at += dimension.scalar().size();
            (dimension.name == name).then_some(field)
        });
        appended.or_else(|| schema.find(name).cloned())
    }

    /// True if there are none.
    fn is_empty(&self) -> bool {
        self.in_place.is_empty() && self.appended.is_empty()
    }

    /// Bytes that they make a record longer.
    pub fn appended_bytes(&self) -> usize {
        self.appended.iter().map(|dimension| dimension.scalar().size()).sum()
    }

    /// Puts the values of `batch` into `records`, which are its own, longer by
    /// [`appended_bytes`](ComputedFields::appended_bytes).
    fn put(&self, batch: &PointBatch, records: &mut [u8]) -> Result<()> {
        let (points, own) = (batch.len(), batch.schema().stride);
        let stride = own + self.appended_bytes();
        let mut at = own;
        for dimension in &self.appended {
            let numbers = batch.columns.bytes_of_dimension(dimension, points)?;
            let field = at..at + dimension.scalar().size();
            for (record, number) in records.chunks_exact_mut(stride).zip(numbers) {
                let bytes = &mut record[field.clone()];
                bytes.copy_from_slice(number);
                if COLUMN_ENDIAN == Endian::Big {
                    bytes.reverse();
                }
            }
            at = field.end;
        }
        for (dimension, target) in &self.in_place {
            let numbers = batch.columns.numbers(dimension, points)?;
            for (record, number) in records.chunks_exact_mut(stride).zip(numbers) {
                put_computed(target, record, number)?;
            }
        }
        Ok(())
    }
}

/// Encodes chunks of one output.
pub struct LasEncoder {
    /// Bytes of a record as it arrives.
    stride: usize,
    /// Bits of the byte at 14 that hold the return number.
    return_bits: u8,
    /// Where computed dimensions go.
    pub computed: ComputedFields,
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
        computed: ComputedFields,
        compression: Option<Compression>,
    ) -> Self {
        let return_bits = if format < 6 { 0b111 } else { 0b1111 };
        let (stride, spare) = (schema.stride, Spare::default());
        LasEncoder { stride, return_bits, computed, compression, spare }
    }

    /// Upper estimate of what encoding one chunk holds: records with computed dimensions, the
    /// compressor's layers, the output.
    pub fn chunk_bytes(&self) -> u64 {
        let record = (self.stride + self.computed.appended_bytes()) as u64;
        let copies = match (self.computed.is_empty(), &self.compression) {
            (true, None) => 1,
            (false, None) => 2,
            // A chunk that does not compress grows by an eighth at most.
            (_, Some(_)) => 4,
        };
        let state = self.compression.as_ref().map_or(0, Compression::state_bytes);
        u64::from(CHUNK_POINTS) * record * copies + state
    }

    fn records<'a>(&self, batch: &'a PointBatch) -> Result<Cow<'a, [u8]>> {
        if batch.is_empty() || self.computed.is_empty() {
            return Ok(Cow::Borrowed(batch.records()));
        }
        let more = self.computed.appended_bytes();
        let mut records = Vec::with_capacity(batch.len() * (self.stride + more));
        for record in batch.iter() {
            records.extend_from_slice(record);
            records.resize(records.len() + more, 0);
        }
        self.computed.put(batch, &mut records)?;
        Ok(Cow::Owned(records))
    }
}

/// Stores a computed number, rounded to what the dimension can hold; where that holds whole
/// numbers, 0 for one that is not known.
fn put_computed(dimension: &Dimension, record: &mut [u8], value: Value) -> Result<()> {
    let is_scaled = dimension.scale != 1.0 || dimension.origin != 0.0;
    let value = match value {
        Value::Unsigned(_) | Value::Signed(_) if !is_scaled => value,
        _ => {
            let stored = (value.as_f64() - dimension.origin) / dimension.scale;
            match dimension.scalar {
                Scalar::F32 => Value::Single(stored as f32),
                Scalar::F64 => Value::Double(stored),
                _ if stored.is_nan() => Value::Signed(0),
                _ => Value::Double(stored.round()),
            }
        }
    };
    if dimension.put(record, Endian::Little, value) {
        return Ok(());
    }
    let name = &dimension.name;
    Err(Error::pipeline(format!("the input's {name} cannot hold what is computed for it"))
        .help(format!("leave {name} out of `write.dimensions`, or compute it by another name")))
}

impl Encode for LasEncoder {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let records = self.records(batch)?;
        let stride = self.stride + self.computed.appended_bytes();
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
