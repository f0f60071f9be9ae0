//! What reprojected records are: those of the inputs, with coordinates that have room for it.
//!
//! Coordinates that are steps of a scale stay steps: of the largest power of ten that is no longer
//! than a step of the inputs on the ground. Others become `f64`: metres of a map have more digits
//! than the `f32` of a scanner.

use super::systems::HeightChange;
use crate::io::convert::Projection;
use crate::io::steps::readable_offset;
use crate::point::names::XYZ;
use crate::point::{Dimension, PointBatch, Scalar, Schema, Value};
use crate::quantity::{Figure, Setting};
use crate::report::Short;
use crate::{Error, Result};

/// How records of the inputs become reprojected ones, but for their coordinates.
#[derive(Debug, Clone)]
pub struct ReprojectedForm {
    pub schema: Schema,
    /// What is to be told of steps that are longer on the ground than those of the inputs.
    pub coarser: Vec<String>,
    /// How fields come to their places, where these are others.
    fields: Option<Projection>,
    axes: [Dimension; 3],
    own_axes: [Dimension; 3],
    heights: HeightChange,
}

/// What the keys of `read` say of the scale and the offset of reprojected coordinates.
#[derive(Debug, Clone, Copy, Default)]
pub struct AskedSteps {
    pub scale: Option<Setting<[f64; 3]>>,
    pub offset: Option<Setting<[f64; 3]>>,
}

/// Metres in a unit of each axis, of the inputs and behind.
pub type AxisMetres = [[f64; 3]; 2];

impl ReprojectedForm {
    /// Of records of `own`, which come to lie in the box `place`, if that is known.
    pub fn of(
        own: &Schema,
        asked: AskedSteps,
        metres: AxisMetres,
        place: Option<[[f64; 3]; 2]>,
        heights: HeightChange,
    ) -> Result<ReprojectedForm> {
        let [own_axes, mut axes] = [axes_of(own)?, axes_of(own)?];
        let mut schema = own.clone();
        let mut coarser = Vec::new();
        if has_steps(own) {
            for (n, axis) in axes.iter_mut().enumerate() {
                let given = |key: Option<Setting<[f64; 3]>>| Some(key?.given()?[n]);
                let asked = [given(asked.scale), given(asked.offset)];
                let place = place.map(|[lo, hi]| [lo[n], hi[n]]);
                let ground = metres.map(|metres| metres[n]);
                if !(n == 2 && heights.is_none() && asked == [None; 2]) {
                    (axis.scale, axis.origin) = steps(&own_axes[n], ground, asked, place)?;
                }
                coarser.extend(told_coarser(&own_axes[n], axis, ground, asked[0].is_some()));
                for field in schema.dimensions.iter_mut().filter(|field| field.name == axis.name) {
                    (field.scale, field.origin) = (axis.scale, axis.origin);
                }
            }
        } else {
            to_doubles(&mut schema);
            axes = axes_of(&schema)?;
        }
        let fields = match own.stride == schema.stride {
            true => None,
            false => Some(Projection::reading(own, &schema)?),
        };
        Ok(ReprojectedForm { schema, coarser, fields, axes, own_axes, heights })
    }

    /// Refills `records` from those of `own`; `apply` has the place of each. A point without x or y
    /// has no place in any system; one without z has x and y as at height 0.
    pub fn fill(
        &self,
        own: &PointBatch,
        records: &mut [u8],
        apply: impl Fn([f64; 3]) -> std::result::Result<[f64; 3], String>,
    ) -> std::result::Result<(), BadPoint> {
        match &self.fields {
            Some(fields) => drop(fields.project_into(own.records(), records)?),
            None => records.copy_from_slice(own.records()),
        }
        let (from, to) = (own.schema().endian, self.schema.endian);
        let [own_z, z] = [&self.own_axes[2], &self.axes[2]];
        let is_z_there = self.heights.is_none()
            && (own_z.scalar, own_z.scale, own_z.origin) == (z.scalar, z.scale, z.origin);
        let changed = if is_z_there { 2 } else { 3 };
        for (old, new) in own.iter().zip(records.chunks_exact_mut(self.schema.stride)) {
            let [x, y, z] = [0, 1, 2].map(|axis: usize| self.own_axes[axis].world(old, from));
            let needs_z = self.heights == HeightChange::WithPlace;
            let has_place = x.is_finite() && y.is_finite() && (z.is_finite() || !needs_z);
            let mut found = [f64::NAN; 3];
            if has_place {
                let place = [x, y, if z.is_finite() { z } else { 0.0 }];
                found = apply(place).map_err(|why| BadPoint::unplaced(place, &why))?;
            }
            if self.heights.is_none() || !z.is_finite() {
                found[2] = z;
            }
            for (axis, found) in self.axes.iter().zip(found).take(changed) {
                if !put(axis, new, to, found) {
                    return Err(BadPoint::beyond(axis, found));
                }
            }
        }
        Ok(())
    }
}

/// Why a point has no place in the records behind.
#[derive(Debug)]
pub enum BadPoint {
    /// Its place, and what would help.
    Place(String, &'static str),
    /// Another error than that of a point.
    Other(Error),
}

impl From<Error> for BadPoint {
    fn from(error: Error) -> Self {
        BadPoint::Other(error)
    }
}

impl BadPoint {
    fn unplaced([x, y, z]: [f64; 3], why: &str) -> Self {
        BadPoint::Place(
            format!("the point at {x}, {y}, {z} cannot be reprojected: {why}"),
            "see whether `read.crs` has to say which system the inputs are in; points far from all \
             others are left out by a `crop` in a run before",
        )
    }

    fn beyond(axis: &Dimension, found: f64) -> Self {
        let told = format!(
            "the {} {found} of a point is too far from the offset {} for steps of {}",
            axis.name.to_ascii_lowercase(),
            axis.origin,
            Figure(axis.scale)
        );
        BadPoint::Place(told, "give `read.scale` and `read.offset` from where the steps reach it")
    }
}

/// The coordinates of records.
fn axes_of(schema: &Schema) -> Result<[Dimension; 3]> {
    let axes = schema.coordinates().map(|axes| axes.map(Dimension::clone));
    axes.ok_or_else(|| Error::internal("records without coordinates"))
}

/// True if coordinates are steps of a scale, and to stay such.
pub fn has_steps(schema: &Schema) -> bool {
    let is_whole = |axes: [&Dimension; 3]| axes.iter().all(|axis| !axis.scalar.is_float());
    schema.layout.steps && schema.coordinates().is_some_and(is_whole)
}

/// Scale and offset of an axis: those that are `asked` for, else the largest power of ten that is
/// no longer on the ground than the inputs' own, and an offset from which it reaches `place`.
fn steps(
    own: &Dimension,
    [own_metres, metres]: [f64; 2],
    asked: [Option<f64>; 2],
    place: Option<[f64; 2]>,
) -> Result<(f64, f64)> {
    let found = power_of_ten(own.scale.abs() * own_metres / metres);
    if asked[0].is_none() && !(found > 0.0 && found.is_finite()) {
        let told = format!("the scale {:e} of the inputs is no length that can be kept", own.scale);
        return Err(Error::pipeline(told).help("give `read.scale`"));
    }
    Ok(match asked {
        [Some(scale), Some(offset)] => (scale, offset),
        [None, Some(offset)] => (found, offset),
        [scale, None] => reaching(scale, found, own.origin, place),
    })
}

/// What is to be told of an axis whose steps are longer on the ground than they were.
fn told_coarser(
    own: &Dimension,
    axis: &Dimension,
    [was, is]: [f64; 2],
    is_asked: bool,
) -> Option<String> {
    let [before, after] = [own.scale.abs() * was, axis.scale.abs() * is];
    let why = match is_asked {
        true => "`read.scale` asks for it",
        false => "shorter ones do not reach from end to end of the scan",
    };
    (after > before * (1.0 + 1e-6)).then(|| {
        format!(
            "{} is rounded to steps of {}, which are {} m on the ground, and those of the inputs \
             are {} m: {why}",
            axis.name.to_ascii_lowercase(),
            Figure(axis.scale),
            Short(after),
            Short(before)
        )
    })
}

/// Stores a coordinate, as the nearest step where it has steps.
fn put(axis: &Dimension, record: &mut [u8], endian: crate::point::Endian, found: f64) -> bool {
    if axis.scalar.is_float() {
        return axis.put(record, endian, Value::Double(found));
    }
    let steps = ((found - axis.origin) / axis.scale).round();
    axis.put(record, endian, Value::Double(steps))
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

/// The scale `given`, or `found` or the next power of ten that reaches all of `place`, and an
/// offset from which it does.
fn reaching(given: Option<f64>, found: f64, own: f64, place: Option<[f64; 2]>) -> (f64, f64) {
    let mut scale = given.unwrap_or(found);
    let Some(place) = place else { return (scale, own) };
    while scale.is_normal() {
        if let Some(offset) = readable_offset(place, scale) {
            return (scale, offset);
        }
        if given.is_some() {
            break;
        }
        scale *= 10.0;
    }
    (scale, f64::midpoint(place[0], place[1]))
}
