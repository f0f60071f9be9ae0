//! Records that a program holds.

use std::sync::Arc;

use crate::point::{COLUMN_ENDIAN, Dimension, Layout, Metadata, PointBatch, Scalar, Schema, names};
use crate::stage::{OpenSource, Part, Source};
use crate::{Error, Result};

/// Records of a part.
const PART: usize = 1 << 16;

/// The records of a program as a source: they are held as they are, and read side by side.
#[derive(Debug, Clone)]
pub struct Records {
    schema: Arc<Schema>,
    metadata: Metadata,
    bytes: Arc<[u8]>,
}

/// A schema of records of this machine's numbers, one behind the other without gaps; coordinates
/// are `X`, `Y` and `Z`.
///
/// # Errors
///
/// Two dimensions of one name, and none of the three coordinates.
pub fn schema(dimensions: &[(&str, Scalar)]) -> Result<Schema> {
    let twice = |(n, (name, _)): &(usize, &(&str, Scalar))| {
        dimensions[..*n].iter().any(|(other, _)| other == name)
    };
    if let Some((_, (name, _))) = dimensions.iter().enumerate().find(twice) {
        return Err(Error::pipeline(format!("two dimensions are called {name}")));
    }
    let schema = packed(dimensions);
    check(&schema)?;
    Ok(schema)
}

/// The same of dimensions that are known to be right.
fn packed(dimensions: &[(&str, Scalar)]) -> Schema {
    let layout = Layout::plain("MEMORY");
    let mut schema = Schema { layout, endian: COLUMN_ENDIAN, stride: 0, dimensions: Vec::new() };
    for (name, scalar) in dimensions {
        schema.dimensions.push(Dimension::new(*name, *scalar, schema.stride));
        schema.stride += scalar.size();
    }
    schema
}

/// Refuses records that have no place.
pub(super) fn check(schema: &Schema) -> Result<()> {
    match schema.coordinates() {
        Some(_) => Ok(()),
        None => Err(Error::pipeline("records need the dimensions X, Y and Z")),
    }
}

impl Records {
    /// The records `bytes`, each of the length that `schema` says.
    ///
    /// # Errors
    ///
    /// A schema without coordinates, and bytes that are no whole number of records.
    pub fn new(schema: Schema, bytes: Vec<u8>) -> Result<Records> {
        check(&schema)?;
        if schema.stride == 0 || !bytes.len().is_multiple_of(schema.stride) {
            let (len, stride) = (bytes.len(), schema.stride);
            let told = format!("{len} bytes are no whole number of records of {stride} bytes");
            return Err(Error::pipeline(told));
        }
        let (schema, metadata) = (Arc::new(schema), Metadata::default());
        Ok(Records { schema, metadata, bytes: bytes.into() })
    }

    /// Positions in world units, which are all that a record holds.
    pub fn of_positions(positions: &[[f64; 3]]) -> Records {
        let schema = packed(&names::XYZ.map(|name| (name, Scalar::F64)));
        let bytes = bytemuck::cast_slice::<[f64; 3], u8>(positions).into();
        Records { schema: Arc::new(schema), metadata: Metadata::default(), bytes }
    }

    /// The same with what outputs carry on besides points, such as the reference system.
    #[must_use]
    pub fn with_metadata(self, metadata: Metadata) -> Records {
        Records { metadata, ..self }
    }

    fn len(&self) -> usize {
        self.bytes.len() / self.schema.stride
    }
}

impl OpenSource for Records {
    fn open(&self) -> Result<Box<dyn Source>> {
        Ok(Box::new(self.clone()))
    }
}

impl Source for Records {
    fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn points(&self) -> u64 {
        self.len() as u64
    }

    fn part_bytes(&self) -> u64 {
        0
    }

    fn parts(&self) -> usize {
        self.len().div_ceil(PART)
    }

    fn first_record(&self, index: usize) -> Option<u64> {
        Some((index * PART) as u64)
    }

    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>> {
        let stride = self.schema.stride;
        let end = self.len().min((index + 1) * PART);
        Ok(Box::new(RecordsPart { rest: &self.bytes[index * PART * stride..end * stride] }))
    }
}

struct RecordsPart<'a> {
    rest: &'a [u8],
}

impl Part for RecordsPart<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        batch.clear();
        batch.source = 0;
        let bytes = self.rest.len().min(batch.capacity() * batch.schema().stride);
        let (now, later) = self.rest.split_at(bytes);
        batch.extend(now);
        self.rest = later;
        Ok(())
    }
}
