//! The lattice: where points are, as integers, so that every decision is exact.

use super::decimal::{decimal_step, multiple};
use crate::point::{Bounds, Endian, Position, Scalar, Schema};
use crate::{Error, Result};

/// Steps of the binary lattice per world unit where nothing decimal fits: 2^30.
const BINARY: f64 = (1u64 << 30) as f64;
/// The smallest decimal step.
const SMALLEST_STEP: f64 = 1e-9;

/// An isotropic lattice of i64 positions anchored at world 0, fixed by headers alone.
///
/// ```
/// use pointmill::stage::{Lattice, OpenSource};
/// use pointmill::synth::{Scene, Synthetic};
///
/// let scan = Synthetic { scene: Scene::Plane, points: 10, ..Synthetic::default() }.open()?;
/// // Steps of a quarter of the scan's unit; where none are given, those of its records.
/// let lattice = Lattice::of(scan.schema(), Some(0.25))?;
/// assert_eq!(lattice.world([4, 8, -2]), [1.0, 2.0, -0.5]);
/// # Ok::<(), pointmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Lattice {
    /// World units of one step, along z after it was stretched.
    pub step: f64,
    /// World coordinate of lattice position 0 (the fraction of a step that all offsets share).
    pub shift: [f64; 3],
    /// What z was multiplied by, so that its unit is that of x and y.
    z_scale: f64,
    placement: Placement,
}

/// How a record's coordinates become a position.
#[derive(Debug, Clone, PartialEq)]
enum Placement {
    /// position = stored · times + plus.
    Integer { times: [i64; 3], plus: [i64; 3] },
    /// position = round_half_even(world · per_unit).
    Float { per_unit: f64 },
}

/// Why a record has no position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Misplaced {
    /// A coordinate is NaN or infinite.
    NotFinite,
    /// A coordinate is 2^62 steps or more from world 0.
    TooFar,
}

impl Lattice {
    /// The lattice of records of `schema`. `step` overrides the step in world units.
    ///
    /// # Errors
    ///
    /// A step that is not above 0, and records without coordinates.
    pub fn of(schema: &Schema, step: Option<f64>) -> Result<Lattice> {
        Lattice::stretched(schema, step, 1.0)
    }

    /// The lattice of records of `schema` whose z is multiplied by `z_scale`, for scans whose
    /// heights have another unit than their x and y. Records stay as they are: only where their
    /// points are for each other changes, and lengths are in the unit of x and y. It is exact where
    /// a decimal step of 1e-9 or more divides the stretched scale too; else positions are rounded
    /// to 2^-30.
    ///
    /// # Errors
    ///
    /// A factor or step that is not above 0, and records without coordinates.
    pub fn stretched(schema: &Schema, step: Option<f64>, z_scale: f64) -> Result<Lattice> {
        if !(z_scale.is_finite() && z_scale > 0.0) {
            return Err(Error::pipeline(format!("`run.z_scale` must be above 0, not {z_scale}")));
        }
        let axes = schema
            .coordinates()
            .ok_or_else(|| Error::pipeline("the input has no coordinates X, Y and Z"))?;
        if let Some(step) = step {
            if !(step.is_finite() && step > 0.0) {
                return Err(Error::pipeline(format!("`run.lattice` must be above 0, not {step}")));
            }
            return Ok(Lattice::binary(step, 1.0 / step, z_scale));
        }
        let stored_whole = schema.layout.steps && axes.iter().all(|d| d.scalar == Scalar::I32);
        let decimal = || decimal(axes.map(|d| d.scale), axes.map(|d| d.origin), z_scale);
        let decimal = stored_whole.then(decimal).flatten();
        Ok(decimal.unwrap_or_else(|| Lattice::binary(1.0 / BINARY, BINARY, z_scale)))
    }

    /// True if positions are rounded, so that unequal coordinates may share one.
    pub fn rounds(&self) -> bool {
        matches!(self.placement, Placement::Float { .. })
    }

    /// What z is multiplied by before it is placed; 1 for most scans.
    pub fn z_scale(&self) -> f64 {
        self.z_scale
    }

    fn binary(step: f64, per_unit: f64, z_scale: f64) -> Lattice {
        Lattice { step, shift: [0.0; 3], z_scale, placement: Placement::Float { per_unit } }
    }

    /// World coordinates of a position, z as the records have it. Where a world unit is a whole
    /// number of steps they are divided, which rounds to the decimal that one expects: 12.345 and
    /// not 12.345000000000001.
    pub fn world(&self, p: Position) -> [f64; 3] {
        let per_unit = (1.0 / self.step).round();
        let whole = 1.0 / per_unit == self.step;
        std::array::from_fn(|axis| {
            let steps = p[axis] as f64;
            let at = if whole { steps / per_unit } else { steps * self.step };
            let at = if axis == 2 { at / self.z_scale } else { at };
            at + self.shift[axis]
        })
    }

    /// The position nearest to world coordinates; None where there is none.
    pub fn nearest(&self, world: [f64; 3]) -> Option<Position> {
        if let Placement::Float { per_unit } = self.placement {
            let [x, y, z] = world;
            return float_position([x, y, stretched(z, self.z_scale)], per_unit).ok();
        }
        let mut position = [0; 3];
        for axis in 0..3 {
            let at = world[axis] - self.shift[axis];
            let at = if axis == 2 { at * self.z_scale } else { at };
            let steps = (at / self.step).round();
            position[axis] = (steps.abs() < FARTHEST).then_some(steps as i64)?;
        }
        Some(position)
    }

    /// Whole steps nearest to a length in world units, at least 1.
    pub fn steps(&self, length: f64) -> i64 {
        ((length / self.step).round() as i64).max(1)
    }

    /// The longest length in world units: farther apart no two positions are.
    pub fn longest(&self) -> f64 {
        FARTHEST * self.step
    }

    /// What a length in world units is on the lattice, if that is more than a thousandth beside it.
    pub fn rounded(&self, length: f64) -> Option<f64> {
        let held = self.steps(length) as f64 * self.step;
        ((held - length).abs() > 1e-3 * length).then_some(held)
    }

    /// A decimal step that tells points apart which are `apart` in one coordinate, and still
    /// reaches the ends of `bounds`; None where that is no finer than the step of this lattice.
    pub(crate) fn finer(&self, bounds: &Bounds, apart: f64) -> Option<f64> {
        let ends = bounds.lo.iter().chain(&bounds.hi);
        let farthest = ends.map(|end| end.unsigned_abs()).max()? as f64 * self.step;
        let least = decimal_step(farthest / FARTHEST) * 10.0;
        let step = decimal_step(apart / 2.0);
        let step = if step < least { decimal_step(least * 1.5) } else { step };
        (step < self.step).then_some(step)
    }

    /// A decimal step of a lattice that reaches a coordinate and is no coarser than the numbers
    /// around it are from one another.
    pub(crate) fn reaching(coordinate: f64) -> f64 {
        decimal_step(coordinate.abs() * f64::EPSILON)
    }

    /// Positions of `records` (of the schema the lattice was made for), one after the other;
    /// `misplaced` is told the index of each record that has none, which is left out.
    pub fn place(
        &self,
        schema: &Schema,
        records: &[u8],
        mut place: impl FnMut(usize, Position),
        mut misplaced: impl FnMut(usize, Misplaced),
    ) {
        let Some(axes) = schema.coordinates() else { return };
        match self.placement {
            Placement::Integer { times, plus } => {
                let at = axes.map(|d| d.offset);
                for (i, record) in records.chunks_exact(schema.stride).enumerate() {
                    place(
                        i,
                        std::array::from_fn(|axis| {
                            let mut stored = [0; 4];
                            stored.copy_from_slice(&record[at[axis]..at[axis] + 4]);
                            i64::from(i32::from_le_bytes(stored)) * times[axis] + plus[axis]
                        }),
                    );
                }
            }
            Placement::Float { per_unit } => {
                let endian: Endian = schema.endian;
                for (i, record) in records.chunks_exact(schema.stride).enumerate() {
                    let mut world = axes.map(|d| d.world(record, endian));
                    world[2] = stretched(world[2], self.z_scale);
                    match float_position(world, per_unit) {
                        Ok(position) => place(i, position),
                        Err(why) => misplaced(i, why),
                    }
                }
            }
        }
    }
}

/// 2^62: far enough from the ends of i64 that a box around a position can grow.
const FARTHEST: f64 = (1u64 << 62) as f64;

/// A height times `z_scale`. A finite one that overflows stays finite: it is too far, and not a
/// point to be dropped as not finite.
fn stretched(z: f64, z_scale: f64) -> f64 {
    let scaled = z * z_scale;
    if z.is_finite() { scaled.clamp(f64::MIN, f64::MAX) } else { z }
}

fn float_position(world: [f64; 3], per_unit: f64) -> Result<Position, Misplaced> {
    let mut position = [0; 3];
    for axis in 0..3 {
        if !world[axis].is_finite() {
            return Err(Misplaced::NotFinite);
        }
        // Infinite where a finite coordinate overflows; NaN where the steps are infinitely small.
        let steps = (world[axis] * per_unit).round_ties_even();
        if steps.abs() < FARTHEST {
            position[axis] = steps as i64;
        } else {
            return Err(Misplaced::TooFar);
        }
    }
    Ok(position)
}

/// The decimal lattice of integer coordinates, z stretched: one step that all scales are whole
/// multiples of, and offsets that share their fraction of a step. None if there is no such step.
fn decimal(mut scale: [f64; 3], mut origin: [f64; 3], z_scale: f64) -> Option<Lattice> {
    scale[2] *= z_scale;
    origin[2] *= z_scale;
    if scale.iter().chain(&origin).any(|v| !v.is_finite()) || scale.iter().any(|&s| s <= 0.0) {
        return None;
    }
    let step = if scale[0] == scale[1] && scale[1] == scale[2] {
        scale[0]
    } else {
        (0..=9)
            .map(|digits| 1.0 / 10f64.powi(digits))
            .find(|h| scale.iter().all(|s| multiple(*s, *h).is_some()))?
    };
    if step < SMALLEST_STEP {
        return None;
    }
    let mut times = [0; 3];
    let mut plus = [0; 3];
    let mut shift = [0.0; 3];
    for axis in 0..3 {
        times[axis] = multiple(scale[axis], step)?;
        let steps = origin[axis] / step;
        let whole = steps.round();
        // |raw · times + plus| stays below 2^62, as everywhere on the lattice.
        if whole.abs() >= FARTHEST / 2.0 || times[axis] >= 1 << 29 {
            return None;
        }
        plus[axis] = whole as i64;
        // Decimal offsets are seldom exact in binary: a fraction below 1e-6 of a step is none.
        let fraction = steps - whole;
        shift[axis] = if fraction.abs() < 1e-6 { 0.0 } else { fraction * step };
    }
    shift[2] /= z_scale;
    Some(Lattice { step, shift, z_scale, placement: Placement::Integer { times, plus } })
}

#[cfg(test)]
mod tests;
