//! What reprojected records are: those of the inputs, with coordinates that have room for it.
//!
//! Coordinates that are steps of a scale stay steps: of the largest power of ten that is no longer
//! than a step of the inputs on the ground. Others become `f64`: metres of a map have more digits
//! than the `f32` of a scanner.

use crate::io::convert::Projection;
use crate::io::steps::{REACH, reaches};
use crate::point::names::XYZ;
use crate::point::{Dimension, PointBatch, Scalar, Schema, Value};
use crate::quantity::Setting;
use crate::{Error, Result};

/// How records of the inputs become reprojected ones, but for their coordinates.
#[derive(Debug, Clone)]
pub struct ReprojectedForm {
    pub schema: Schema,
    /// How fields come to their places, where these are others.
    fields: Option<Projection>,
    axes: [Dimension; 3],
    own_axes: [Dimension; 3],
    /// True if z is not touched.
    keeps_heights: bool,
}

/// What the keys of `read` say of the scale and the offset of reprojected coordinates.
#[derive(Debug, Clone, Copy, Default)]
pub struct AskedSteps {
    pub scale: Option<Setting<[f64; 3]>>,
    pub offset: Option<Setting<[f64; 3]>>,
}

impl ReprojectedForm {
    /// Of records of `own`, which have coordinates in units of `metres[0]` that become such of
    /// `metres[1]` and lie in the box `place` then; z keeps its unit if `keeps_heights`.
    pub fn of(
        own: &Schema,
        asked: AskedSteps,
        metres: [f64; 2],
        place: Option<[[f64; 3]; 2]>,
        keeps_heights: bool,
    ) -> Result<ReprojectedForm> {
        let Some(own_axes) = own.coordinates().map(|axes| axes.map(Dimension::clone)) else {
            return Err(Error::internal("records without coordinates"));
        };
        let mut schema = own.clone();
        let has_steps = own.layout.steps && own_axes.iter().all(|axis| !axis.scalar.is_float());
        if !has_steps {
            to_doubles(&mut schema);
        }
        let places = place.map(|[lo, hi]| [0, 1, 2].map(|axis| [lo[axis], hi[axis]]));
        for axis in 0..if has_steps { 3 } else { 0 } {
            let field = schema.dimensions.iter_mut().find(|d| d.name == XYZ[axis]);
            let Some(field) = field else { continue };
            let is_kept = axis == 2 && keeps_heights;
            let given = |key: Option<Setting<[f64; 3]>>| Some(key.and_then(Setting::given)?[axis]);
            let [own_metres, new_metres] = if is_kept { [1.0; 2] } else { metres };
            let step = field.scale.abs() * own_metres / new_metres;
            let found = if is_kept { field.scale } else { power_of_ten(step) };
            let place = places.map(|places| places[axis]);
            let (scale, offset) = match (given(asked.scale), given(asked.offset)) {
                (Some(scale), Some(offset)) => (scale, offset),
                (None, None) if is_kept => continue,
                (scale, Some(offset)) => (scale.unwrap_or(found), offset),
                (scale, None) => reaching(scale, found, field.origin, place),
            };
            (field.scale, field.origin) = (scale, offset);
        }
        let axes = schema.coordinates().map(|axes| axes.map(Dimension::clone));
        let axes = axes.ok_or_else(|| Error::internal("records without coordinates"))?;
        let fields = match own.stride == schema.stride {
            true => None,
            false => Some(Projection::reading(own, &schema)?),
        };
        Ok(ReprojectedForm { schema, fields, axes, own_axes, keeps_heights })
    }

    /// Refills `records` from those of `own`; `apply` has the place of each.
    pub fn fill(
        &self,
        own: &PointBatch,
        records: &mut [u8],
        apply: impl Fn([f64; 3]) -> std::result::Result<[f64; 3], String>,
    ) -> Result<()> {
        match &self.fields {
            Some(fields) => drop(fields.project_into(own.records(), records)?),
            None => records.copy_from_slice(own.records()),
        }
        let (from, to) = (own.schema().endian, self.schema.endian);
        for (old, new) in own.iter().zip(records.chunks_exact_mut(self.schema.stride)) {
            let place = [0, 1, 2].map(|axis: usize| self.own_axes[axis].world(old, from));
            // What has no place has none in any system.
            if !place.iter().all(|at| at.is_finite()) {
                continue;
            }
            let found = apply(place).map_err(|why| unplaced(place, &why))?;
            let changed = if self.keeps_heights { 2 } else { 3 };
            for (axis, found) in self.axes.iter().zip(found).take(changed) {
                if !put(axis, new, to, found) {
                    return Err(beyond(axis, found));
                }
            }
            let z = &self.axes[2];
            let is_moved = (z.scale, z.origin) != (self.own_axes[2].scale, self.own_axes[2].origin);
            if self.keeps_heights && is_moved && !put(z, new, to, found[2]) {
                return Err(beyond(z, found[2]));
            }
        }
        Ok(())
    }
}

/// Stores a coordinate, as the nearest step where it has steps.
fn put(axis: &Dimension, record: &mut [u8], endian: crate::point::Endian, found: f64) -> bool {
    if axis.scalar.is_float() {
        return axis.put(record, endian, Value::Double(found));
    }
    let steps = ((found - axis.origin) / axis.scale).round();
    axis.put(record, endian, Value::Double(steps))
}

fn unplaced([x, y, z]: [f64; 3], why: &str) -> Error {
    let told = format!("the point at {x}, {y}, {z} cannot be reprojected: {why}");
    Error::pipeline(told).help(
        "see whether `read.crs` has to say which system the inputs are in; points far from all \
         others are left out by `read.box`",
    )
}

fn beyond(axis: &Dimension, found: f64) -> Error {
    let told = format!(
        "the {} {found} of a point is too far from the offset {} for steps of {}",
        axis.name.to_ascii_lowercase(),
        axis.origin,
        axis.scale
    );
    Error::pipeline(told).help("give `read.scale` and `read.offset`, which reach the points")
}

/// Gives coordinates the type `f64`, and the fields behind them their places.
fn to_doubles(schema: &mut Schema) {
    let mut order: Vec<usize> = (0..schema.dimensions.len()).collect();
    order.sort_by_key(|i| schema.dimensions[*i].offset);
    let mut grown = 0;
    for i in order {
        let field = &mut schema.dimensions[i];
        field.offset += grown;
        if XYZ.contains(&field.name.as_str()) {
            grown += Scalar::F64.size() - field.scalar.size();
            (field.scalar, field.scale, field.origin) = (Scalar::F64, 1.0, 0.0);
        }
    }
    schema.stride += grown;
}

/// The largest power of ten that is not above `step`, but for rounding.
fn power_of_ten(step: f64) -> f64 {
    let exponent = (step.log10() + 1e-9).floor();
    format!("1e{exponent}").parse().unwrap_or(step)
}

/// The scale `given`, or `found` or the next power of ten that reaches all of `place`, and an offset
/// from which it does.
fn reaching(given: Option<f64>, found: f64, own: f64, place: Option<[f64; 2]>) -> (f64, f64) {
    let mut scale = given.unwrap_or(found);
    let Some(place) = place else { return (scale, own) };
    let middle = f64::midpoint(place[0], place[1]);
    loop {
        // Whole thousands where the steps reach that far: their digits stay readable.
        let units = [1e6, 1e3, 1.0].into_iter().filter(|unit| *unit <= scale * REACH / 4.0);
        let near = units.map(|unit| (middle / unit).round() * unit);
        let mut offsets = [0.0].into_iter().chain(near).chain([(middle / scale).round() * scale]);
        if let Some(offset) = offsets.find(|offset| reaches(place, *offset, scale)) {
            return (scale, offset);
        }
        if given.is_some() || scale > 1e300 {
            return (scale, middle);
        }
        scale *= 10.0;
    }
}
