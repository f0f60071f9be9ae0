//! The vertex that holds what a record of another format holds.

use super::names::{RECORDS, rank};
use crate::point::names::XYZ;
use crate::point::{Dimension, Endian, Scalar, Schema};

/// The vertex that holds every dimension of `from`, little-endian: coordinates as `double`, exactly
/// stored · scale + origin; bit fields each as `uchar`; other scaled dimensions (the scan angle of
/// point formats 6 to 10, in degrees) as `double`; 64-bit integers, which PLY does not have, as
/// `double` too, where a value that rounds is refused; all others in their own type. Known
/// dimensions come first, in the order of their PLY names. That of a PLY record is the record's
/// own.
pub fn ply_schema(from: &Schema) -> Schema {
    if from.layout == RECORDS {
        return from.clone();
    }
    let mut sources: Vec<&Dimension> = from.dimensions.iter().collect();
    sources.sort_by_key(|d| rank(&d.name).unwrap_or(usize::MAX));
    let mut stride = 0;
    let dimensions = sources
        .into_iter()
        .map(|source| {
            let scaled = source.scale != 1.0 || source.origin != 0.0;
            let scalar = match source.scalar {
                _ if XYZ.contains(&source.name.as_str()) || scaled => Scalar::F64,
                Scalar::U64 | Scalar::I64 => Scalar::F64,
                _ if source.bits.is_some_and(|bits| bits.width <= 8) => Scalar::U8,
                own => own,
            };
            let dimension = Dimension::new(&source.name, scalar, stride);
            stride += scalar.size();
            dimension
        })
        .collect();
    Schema { layout: RECORDS, endian: Endian::Little, stride, dimensions }
}
