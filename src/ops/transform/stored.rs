//! Affine maps of what records store: whole steps from an offset, or world coordinates.
//!
//! Where records store coordinates as steps of a scale from an offset, what they are stored as
//! after a map depends on the scales, the offsets and the map alone. An axis that comes from one
//! axis (translations, scales, quarter turns) keeps the stored numbers, up to a sign, and its scale
//! and offset go the way of the points: nothing is rounded. Any other has steps as fine as the
//! finest that it comes from, times how much it grows, and an offset that is the image of the old
//! one in whole thousands of steps.

use nalgebra::{Matrix3, Vector3};

use super::affine::AffineMap;
use crate::point::{Dimension, Scalar, Schema, Value, names};
use crate::{Error, Result};

/// An affine map between stored coordinates.
#[derive(Debug)]
pub(super) struct StoredMap {
    /// From the fields to themselves, as they are and as they will be.
    from: [Dimension; 3],
    to: [Dimension; 3],
    linear: Matrix3<f64>,
    translation: Vector3<f64>,
    /// In what it is for, to tell of a point.
    world: AffineMap,
}

/// Offsets of axes that come from several are in so many steps.
const OFFSET_STEPS: f64 = 1000.0;
/// Parts of a factor that differ by less than this are rounding of sines and square roots.
const NEGLIGIBLE: f64 = 1e-12;

impl StoredMap {
    /// The map of records of `schema`.
    pub fn of(world: &AffineMap, schema: &Schema) -> Result<StoredMap> {
        let axes = schema.coordinates().ok_or_else(|| Error::internal("no coordinates"))?;
        let from: [Dimension; 3] = axes.map(Clone::clone);
        let steps = schema.layout.steps && from.iter().all(|axis| axis.scalar == Scalar::I32);
        let to = std::array::from_fn(|row| match steps {
            true => stored_axis(world, row, &from),
            false => from[row].clone(),
        });
        let linear = Matrix3::from_fn(|row, column| {
            let factor = world.linear[(row, column)] * from[column].scale / to[row].scale;
            let whole = factor.round();
            if (factor - whole).abs() < NEGLIGIBLE { whole } else { factor }
        });
        let origins = Vector3::from_fn(|row, _| from[row].origin);
        let moved = world.linear * origins + world.translation;
        let translation =
            Vector3::from_fn(|row, _| match steps && sources(world, row).count() == 1 {
                true => 0.0,
                false => (moved[row] - to[row].origin) / to[row].scale,
            });
        Ok(StoredMap { from, to, linear, translation, world: *world })
    }

    /// The schema of what it makes of records of `schema`, if that is another.
    pub fn schema(&self, schema: &Schema) -> Option<Schema> {
        let mut moved = schema.clone();
        for (axis, name) in self.to.iter().zip(names::XYZ) {
            if let Some(field) = moved.dimensions.iter_mut().find(|field| field.name == name) {
                *field = axis.clone();
            }
        }
        (moved != *schema).then_some(moved)
    }

    /// By how much each coordinate is rounded at most, in world units; 0 where it is not, and None
    /// where it is stored as a floating-point number.
    pub fn rounding(&self) -> [Option<f64>; 3] {
        std::array::from_fn(|row| {
            let is_whole = |v: &f64| v.fract() == 0.0;
            let exact =
                self.linear.row(row).iter().all(is_whole) && is_whole(&self.translation[row]);
            let half = self.to[row].scale.abs() / 2.0;
            (!self.to[row].scalar.is_float()).then_some(if exact { 0.0 } else { half })
        })
    }

    /// Moves a record.
    pub fn apply(&self, record: &mut [u8], schema: &Schema) -> Result<()> {
        let at = |axis: usize| self.from[axis].get(record, schema.endian).as_f64();
        let stored = Vector3::new(at(0), at(1), at(2));
        let moved = self.linear * stored + self.translation;
        for (row, field) in self.to.iter().enumerate() {
            let value = match field.scalar {
                Scalar::F32 => Value::Single(moved[row] as f32),
                Scalar::F64 => Value::Double(moved[row]),
                _ => Value::Double(moved[row].round_ties_even()),
            };
            if !field.put(record, schema.endian, value) {
                let [x, y, z] = std::array::from_fn(|axis| {
                    stored[axis] * self.from[axis].scale + self.from[axis].origin
                });
                return Err(self.unheld([x, y, z], row));
            }
        }
        Ok(())
    }

    fn unheld(&self, point: [f64; 3], row: usize) -> Error {
        let (to, name) = (self.world.of(point), names::XYZ[row]);
        let Dimension { scale, origin, .. } = &self.to[row];
        Error::pipeline(format!(
            "`transform` moves the point {point:?} to {to:?}, and its records do not hold that as \
             {name} in steps of {scale} from {origin}"
        ))
        .help("crop the scan to what is needed first, or convert it to PLY of doubles")
    }
}

/// The axes that decide about axis `row`, each with its factor.
fn sources(world: &AffineMap, row: usize) -> impl Iterator<Item = (usize, f64)> {
    let factors: [f64; 3] = std::array::from_fn(|column| world.linear[(row, column)]);
    let largest = factors.iter().fold(0.0, |largest: f64, factor| largest.max(factor.abs()));
    factors.into_iter().enumerate().filter(move |(_, f)| f.abs() > NEGLIGIBLE * largest)
}

/// How axis `row` is stored behind a map of records that store steps.
fn stored_axis(world: &AffineMap, row: usize, from: &[Dimension; 3]) -> Dimension {
    let all: Vec<(usize, f64)> = sources(world, row).collect();
    let grows = rounded(all.iter().map(|(_, factor)| factor * factor).sum::<f64>().sqrt());
    let finest = all.iter().map(|(axis, _)| from[*axis].scale).fold(f64::INFINITY, f64::min);
    let scale = rounded(finest * grows);
    let images = all.iter().map(|(axis, factor)| rounded(*factor) * from[*axis].origin);
    let image = images.sum::<f64>() + world.translation[row];
    let unit = rounded(scale * OFFSET_STEPS);
    let origin = if all.len() == 1 { image } else { rounded((image / unit).round() * unit) };
    Dimension { scale, origin, ..from[row].clone() }
}

/// A figure without the last digits, which are rounding: 0.001 and not 0.0010000000000000002.
fn rounded(value: f64) -> f64 {
    format!("{value:.13e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests;
