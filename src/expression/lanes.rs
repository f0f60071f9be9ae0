//! The numbers of a field side by side, as expressions work on them: a block of records at a time,
//! so that what a field is, is asked once a block instead of once a record.

use crate::point::{
    COLUMN_ENDIAN, ColumnKind, ComputedDimension, Dimension, Endian, PointBatch, Scalar, Schema,
    Value,
};

/// Records that are worked on at once.
pub(super) const LANES: usize = 256;
/// A number for each.
pub(super) type NumberLanes = [f64; LANES];

/// Records of a batch that are worked on at once.
#[derive(Clone, Copy)]
pub(super) struct BatchBlock<'a> {
    pub batch: &'a PointBatch,
    /// The first.
    pub first: usize,
    /// How many, at most [`LANES`].
    pub count: usize,
}

/// A field of records, or a number of a column.
#[derive(Debug, Clone)]
pub(super) struct LoadedField {
    dimension: Dimension,
    endian: Endian,
    column: Option<ColumnKind>,
}

impl LoadedField {
    pub fn of_record(dimension: &Dimension, schema: &Schema) -> LoadedField {
        LoadedField { dimension: dimension.clone(), endian: schema.endian, column: None }
    }

    pub fn of_column(part: &ComputedDimension) -> LoadedField {
        let dimension = Dimension::new(part.name, part.scalar(), part.range().start);
        LoadedField { dimension, endian: COLUMN_ENDIAN, column: Some(part.column) }
    }

    /// True if it is one bit.
    pub fn is_flag(&self) -> bool {
        self.dimension.bits.is_some_and(|bits| bits.width == 1)
    }

    /// True if its values are `f32` as they are stored.
    pub fn is_single(&self) -> bool {
        let Dimension { scalar, scale, origin, .. } = self.dimension;
        scalar == Scalar::F32 && scale == 1.0 && origin == 0.0
    }

    /// World units of a stored one, and the world value of a stored 0.
    pub fn units(&self) -> [f64; 2] {
        [self.dimension.scale, self.dimension.origin]
    }

    /// True if its stored numbers are whole and below 2^32.
    pub fn is_whole(&self) -> bool {
        !self.dimension.scalar.is_float() && self.dimension.scalar.size() <= 4
    }

    /// Writes its world values in a block into `out`; NaN where a column is not there.
    pub fn load(&self, block: BatchBlock<'_>, out: &mut NumberLanes) {
        self.load_stored(block, out);
        let [scale, origin] = self.units();
        if scale != 1.0 || origin != 0.0 {
            out.iter_mut().for_each(|value| *value = *value * scale + origin);
        }
    }

    /// The same of its values as they are stored.
    pub fn load_stored(&self, block: BatchBlock<'_>, out: &mut NumberLanes) {
        let (bytes, stride) = match self.column {
            None => (Some(block.batch.records()), block.batch.schema().stride),
            Some(kind) => (block.batch.columns.bytes_of(kind), kind.bytes()),
        };
        let rows = bytes.and_then(|all| all.get(block.first * stride..)).unwrap_or_default();
        let rows = rows.chunks_exact(stride).take(block.count);
        if rows.len() < block.count {
            out.fill(f64::NAN);
        }
        self.read(rows, out);
    }

    /// The numbers as they are stored.
    fn read<'a>(&self, rows: impl Iterator<Item = &'a [u8]>, out: &mut NumberLanes) {
        let Dimension { scalar, offset, bits, .. } = self.dimension;
        // Foreign byte orders, and bits of what is no byte, are rare.
        let is_plain = self.endian == Endian::Little && (bits.is_none() || scalar == Scalar::U8);
        let rows = out.iter_mut().zip(rows);
        if !is_plain {
            let get = |row: &[u8]| self.dimension.get(row, self.endian).as_f64();
            return rows.for_each(|(value, row)| *value = get(row));
        }
        macro_rules! read {
            ($t:ty) => {
                rows.for_each(|(value, row)| {
                    if let Some(bytes) = row.get(offset..).and_then(<[u8]>::first_chunk) {
                        *value = <$t>::from_le_bytes(*bytes) as f64;
                    }
                })
            };
        }
        match scalar {
            Scalar::U8 => {
                let (shift, width) = bits.map_or((0, 8), |bits| (bits.shift, bits.width));
                let mask = ((1u16 << width) - 1) as u8;
                rows.for_each(|(value, row)| *value = f64::from(row[offset] >> shift & mask));
            }
            Scalar::I8 => read!(i8),
            Scalar::U16 => read!(u16),
            Scalar::I16 => read!(i16),
            Scalar::U32 => read!(u32),
            Scalar::I32 => read!(i32),
            Scalar::U64 => read!(u64),
            Scalar::I64 => read!(i64),
            Scalar::F32 => read!(f32),
            Scalar::F64 => read!(f64),
        }
    }

    /// Stores world values into the field of `rows`, records one after the other: rounded to the
    /// nearest that it has.
    ///
    /// # Errors
    ///
    /// The first value that it cannot hold.
    pub fn store(&self, worlds: &[f64], rows: &mut [u8], stride: usize) -> Result<(), f64> {
        let Dimension { scalar, offset, bits, .. } = self.dimension;
        let [scale, origin] = self.units();
        let is_world = scale == 1.0 && origin == 0.0;
        let stored = |world: f64| if is_world { world } else { (world - origin) / scale };
        let rows = rows.chunks_exact_mut(stride).zip(worlds);
        macro_rules! store {
            ($t:ty) => {{
                let most = <$t>::MIN as f64..=<$t>::MAX as f64;
                let fits = |world: &f64| most.contains(&stored(*world).round_ties_even());
                if let Some(beyond) = worlds.iter().find(|world| !fits(world)) {
                    return Err(*beyond);
                }
                rows.for_each(|(row, world)| {
                    if let Some(bytes) = row.get_mut(offset..).and_then(<[u8]>::first_chunk_mut) {
                        *bytes = (stored(*world).round_ties_even() as $t).to_le_bytes();
                    }
                });
                Ok(())
            }};
        }
        match scalar {
            Scalar::U8 if bits.is_none() => store!(u8),
            Scalar::I8 if bits.is_none() => store!(i8),
            Scalar::U16 if self.is_plain() => store!(u16),
            Scalar::I16 if self.is_plain() => store!(i16),
            Scalar::U32 if self.is_plain() => store!(u32),
            Scalar::I32 if self.is_plain() => store!(i32),
            _ => {
                rows.into_iter().try_for_each(|(row, world)| match self.put(row, stored(*world)) {
                    true => Ok(()),
                    false => Err(*world),
                })
            }
        }
    }

    /// True if its bytes are all its own, in this order.
    fn is_plain(&self) -> bool {
        self.endian == Endian::Little && self.dimension.bits.is_none()
    }

    /// Stores a number into one record. False if it is out of range.
    fn put(&self, row: &mut [u8], stored: f64) -> bool {
        let value = match self.dimension.scalar {
            Scalar::F32 if (stored as f32).is_infinite() && stored.is_finite() => return false,
            Scalar::F32 => Value::Single(stored as f32),
            Scalar::F64 => Value::Double(stored),
            _ => Value::Double(stored.round_ties_even()),
        };
        self.dimension.put(row, self.endian, value)
    }
}
