//! Points that a stage moved, as they are written.
//!
//! All stages that work on tiles go by the positions of one sealed scan, which nothing writes
//! again: neighbours, cells and proofs are those of the points that were read. So a stage that
//! moves points computes by how much, as a column, and this part of it streams behind the tiles and
//! writes the coordinates as records are encoded. A shift, and not a place: records that share a
//! position of the lattice and not all of their digits each keep their own, and one that stays
//! keeps its bytes.

use crate::point::{Dimension, PointBatch, SHIFT, Scalar, Schema, Value, names};
use crate::report::Tally;
use crate::stage::{Needs, Transform};
use crate::{Error, Result};

/// Writes the coordinates of records that the stage above moved, and sets their synthetic flag
/// where they have one: none of them is what a scanner saw any more.
pub(crate) struct Moved;

impl Transform for Moved {
    fn needs(&self) -> Needs {
        Needs::none().looks_at(names::XYZ).reads(&SHIFT).changes(names::XYZ)
    }

    fn apply(&self, batch: &mut PointBatch, _: &mut Tally) -> Result<()> {
        let schema = batch.schema().clone();
        let axes = schema.coordinates().ok_or_else(|| Error::internal("no coordinates"))?;
        let flag = schema.find(names::SYNTHETIC);
        let shifts = batch.columns.get(&SHIFT)?.to_vec();
        let records = batch.records_mut().chunks_exact_mut(schema.stride);
        for (record, shift) in records.zip(shifts) {
            if is_still(shift) {
                continue;
            }
            for (axis, shift) in axes.into_iter().zip(shift) {
                if shift != 0.0 && !put(axis, record, &schema, shift) {
                    return Err(unheld(axis, record, &schema, shift));
                }
            }
            if flag.is_some_and(|flag| !flag.put(record, schema.endian, Value::Unsigned(1))) {
                return Err(Error::internal("a synthetic flag cannot be set"));
            }
        }
        Ok(())
    }
}

/// True for a shift of nothing, and for a position that none was computed for.
pub(crate) fn is_still(shift: [f64; 3]) -> bool {
    shift == [0.0; 3] || shift.iter().any(|v| v.is_nan())
}

/// Moves a coordinate by `shift` world units; false if its field cannot hold where it goes.
fn put(axis: &Dimension, record: &mut [u8], schema: &Schema, shift: f64) -> bool {
    let stored = axis.get(record, schema.endian).as_f64();
    let moved = stored + shift / axis.scale;
    let value = match axis.scalar {
        Scalar::F32 => Value::Single(moved as f32),
        Scalar::F64 => Value::Double(moved),
        _ => Value::Double(stored + (shift / axis.scale).round_ties_even()),
    };
    axis.put(record, schema.endian, value)
}

fn unheld(axis: &Dimension, record: &[u8], schema: &Schema, shift: f64) -> Error {
    let Dimension { name, scale, origin, .. } = axis;
    let at = axis.world(record, schema.endian);
    Error::pipeline(format!(
        "a point with {name} {at} is moved by {shift}, and its records do not hold that in steps \
         of {scale} from {origin}"
    ))
    .help("convert the scan to PLY of doubles first")
}
