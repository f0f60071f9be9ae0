//! Scale and offset of an output that are found: those that round no coordinate and reach every
//! point.
//!
//! A coordinate has so many decimals if it is the number nearest to them that its type holds: 0.1
//! as `f32` has one, though its digits go on. So the points are read once before the run, and the
//! most decimals of an axis are its step.

use crate::io::steps::{reaches, readable_offset, whole_steps};
use crate::point::names::XYZ;
use crate::point::{Dimension, Endian, PointBatch, Scalar};
use crate::quantity::{Figure, Setting};
use crate::stage::{PointWalk, PointsAhead, Source, WriteKeys};
use crate::{Error, Result};

/// Decimals that are looked for.
const MOST_DECIMALS: u8 = 12;
/// How far a coordinate may be from its decimals, in parts of it: steps times a scale, as other
/// programs sum them up, are some bits off.
const SLACK: f64 = 4.0 * f64::EPSILON;
/// The step of a scan without points.
const STEP_OF_NONE: f64 = 1e-3;

/// `keys` with a scale and an offset in the place of `"auto"`; None where nothing is to be found.
///
/// # Errors
///
/// Points that no scale holds without rounding, points that stages move, and what reading them
/// fails with.
pub(super) fn settled(keys: &WriteKeys, ahead: &PointsAhead<'_>) -> Result<Option<WriteKeys>> {
    let is_auto = |key: Option<Setting<[f64; 3]>>| key.is_some_and(Setting::is_auto);
    match is_auto(keys.scale) || is_auto(keys.offset) {
        true => found(keys, ahead).map(Some).map_err(|error| error.at(&keys.path)),
        false => Ok(None),
    }
}

/// The same where something is to be found.
fn found(keys: &WriteKeys, ahead: &PointsAhead<'_>) -> Result<WriteKeys> {
    let (mut keys, source) = (keys.clone(), ahead.source);
    let key = match keys.scale {
        Some(Setting::Auto) => "write.scale",
        _ => "write.offset",
    };
    let (scale, offset) = (keys.given_scale(), keys.given_offset());
    if source.schema().layout.steps && scale.is_none() {
        // The records have steps, which stay as they are.
        if let Some(offset) = offset {
            check_steps(source, offset)?;
        }
        (keys.scale, keys.offset) = (None, offset.map(Setting::Given));
        return Ok(keys);
    }
    if let Some(stage) = ahead.moved_by {
        let told = format!(
            "`{key} = \"auto\"` looks at points where they are read, and `{stage}` moves them"
        );
        return Err(Error::pipeline(told).help("give a scale and an offset"));
    }
    if source.is_read_once() {
        let told = format!("`{key} = \"auto\"` reads the points twice, and these come once");
        return Err(Error::pipeline(told).help("give a scale and an offset"));
    }
    let spread = Spread::of(source, &ahead.walk)?;
    let scale = scale.map_or_else(|| spread.scale(offset), Ok)?;
    let offset = offset.map_or_else(|| spread.offset(scale), Ok)?;
    (keys.scale, keys.offset) = (Some(Setting::Given(scale)), Some(Setting::Given(offset)));
    Ok(keys)
}

/// Refuses an offset from which the steps of the records do not come out even.
fn check_steps(source: &dyn Source, offset: [f64; 3]) -> Result<()> {
    let Some(axes) = source.schema().coordinates() else { return Ok(()) };
    let is_even =
        |(axis, offset): (&&Dimension, f64)| whole_steps(axis.origin, offset, axis.scale).is_some();
    match axes.iter().zip(offset).all(is_even) {
        true => Ok(()),
        false => Err(Error::pipeline(
            "`write.scale = \"auto\"` rounds nothing, and `write.offset` is no whole number of \
             steps from the offset of the input",
        )
        .help("give the scale, to which coordinates are rounded, or another offset")),
    }
}

/// Where the points are on an axis, and on what grid.
#[derive(Debug, Clone, Copy)]
struct AxisSpread {
    lo: f64,
    hi: f64,
    /// The most decimals of a coordinate; one more than are looked for where one has more.
    decimals: u8,
    /// Step and origin where the records have steps.
    grid: Option<(f64, f64)>,
}

/// Where the points are.
#[derive(Debug, Clone, Copy)]
struct Spread([AxisSpread; 3]);

impl Spread {
    fn none(axes: [&Dimension; 3]) -> Self {
        Spread(axes.map(|axis| {
            let grid = (axis.scalar, axis.scale, axis.origin);
            let grid = Some(grid).filter(|(scalar, ..)| !scalar.is_float());
            AxisSpread {
                lo: f64::INFINITY,
                hi: f64::NEG_INFINITY,
                decimals: 0,
                grid: grid.map(|(_, scale, origin)| (scale.abs(), origin)),
            }
        }))
    }

    /// That of all points whose coordinates are finite.
    fn of(source: &dyn Source, walk: &PointWalk) -> Result<Self> {
        let schema = source.schema();
        let axes = schema.coordinates().ok_or_else(|| Error::internal("a scan without places"))?;
        let look = |spread: &mut Spread, _: usize, _: u64, batch: &PointBatch| {
            for (seen, axis) in spread.0.iter_mut().zip(axes) {
                seen.look(axis, schema.endian, batch);
            }
        };
        let failed = |_: &mut Spread, _: usize, error: Error| Err(error);
        let names = schema.dimensions.iter().map(|dimension| dimension.name.clone());
        let unread: Vec<String> = names.filter(|name| !XYZ.contains(&name.as_str())).collect();
        let begin = || Spread::none(axes);
        let all = walk.each_batch(source, &unread, 0, begin, look, failed)?;
        Ok(all.into_iter().fold(Spread::none(axes), Spread::joined))
    }

    fn joined(self, other: Spread) -> Spread {
        Spread(std::array::from_fn(|axis| {
            let (a, b) = (self.0[axis], other.0[axis]);
            let decimals = a.decimals.max(b.decimals);
            AxisSpread { lo: a.lo.min(b.lo), hi: a.hi.max(b.hi), decimals, grid: a.grid }
        }))
    }

    /// The largest steps that round nothing and reach all points, from `offset` where one is given:
    /// one for all axes where that reaches.
    fn scale(&self, offset: Option<[f64; 3]>) -> Result<[f64; 3]> {
        let mut steps = [0.0; 3];
        for (axis, spread) in self.0.iter().enumerate() {
            let offset = offset.map(|offset| offset[axis]);
            steps[axis] = spread.step(offset).ok_or_else(|| self.too_fine(axis))?;
        }
        let finest = steps.into_iter().fold(f64::INFINITY, f64::min);
        let reaches = |scale: [f64; 3]| {
            let mut each = self.0.iter().zip(scale).enumerate();
            each.all(|(axis, (spread, step))| match offset {
                Some(offset) => spread.reaches(offset[axis], step),
                None => spread.offset(step).is_some(),
            })
        };
        let is_one_grid = self.0.iter().all(|spread| spread.grid.is_none());
        if is_one_grid && reaches([finest; 3]) {
            return Ok([finest; 3]);
        }
        match reaches(steps) {
            true => Ok(steps),
            false => Err(self.too_far(offset)),
        }
    }

    /// An offset from which steps of `scale` reach all points.
    fn offset(&self, scale: [f64; 3]) -> Result<[f64; 3]> {
        let mut offset = [0.0; 3];
        for (axis, spread) in self.0.iter().enumerate() {
            offset[axis] = spread.offset(scale[axis]).ok_or_else(|| self.too_far(None))?;
        }
        Ok(offset)
    }

    fn too_fine(&self, axis: usize) -> Error {
        let name = ["x", "y", "z"][axis];
        let told = format!(
            "`write.scale = \"auto\"` rounds nothing, and the {name} of some points has more than \
             {MOST_DECIMALS} decimals"
        );
        Error::pipeline(told).help(self.finest())
    }

    fn too_far(&self, offset: Option<[f64; 3]>) -> Error {
        let told = match offset {
            None => "the points reach farther than 2^32 of the steps that round no coordinate",
            Some(_) => {
                "from `write.offset` the points reach farther than 2^31 of the steps that round no \
                 coordinate"
            }
        };
        Error::pipeline(told).help(self.finest())
    }

    /// The finest power of ten that reaches all points.
    fn finest(&self) -> String {
        let power = |exponent: &i32| format!("1e{exponent}").parse().unwrap_or(f64::MAX);
        let reaches = |step: &f64| self.0.iter().all(|spread| spread.offset(*step).is_some());
        match (-15..300).map(|exponent| power(&exponent)).find(reaches) {
            Some(step) => format!(
                "`write.scale = {}` with `write.offset = \"auto\"` reaches all points and moves \
                 coordinates by {} at most",
                Figure(step),
                Figure(step / 2.0)
            ),
            None => "no scale reaches all points: some lie far from all others".to_owned(),
        }
    }
}

impl AxisSpread {
    fn look(&mut self, axis: &Dimension, endian: Endian, batch: &PointBatch) {
        let is_single = axis.scalar == Scalar::F32;
        for record in batch.iter() {
            let at = axis.world(record, endian);
            if !at.is_finite() {
                continue;
            }
            (self.lo, self.hi) = (self.lo.min(at), self.hi.max(at));
            while self.decimals <= MOST_DECIMALS && !has_decimals(at, self.decimals, is_single) {
                self.decimals += 1;
            }
        }
    }

    /// The largest step that rounds none of the coordinates, nor `offset`.
    fn step(&self, offset: Option<f64>) -> Option<f64> {
        if self.lo > self.hi {
            return Some(STEP_OF_NONE);
        }
        if let Some((step, _)) = self.grid {
            return Some(step);
        }
        let suits = |d: &u8| offset.is_none_or(|offset| has_decimals(offset, *d, false));
        let decimals = (self.decimals..=MOST_DECIMALS).find(suits)?;
        format!("1e-{decimals}").parse().ok()
    }

    fn reaches(&self, offset: f64, step: f64) -> bool {
        self.lo > self.hi || reaches([self.lo, self.hi], offset, step)
    }

    /// An offset from which all points are within reach: 0 or that of the records if it is one.
    fn offset(&self, step: f64) -> Option<f64> {
        let Some((_, own)) = self.grid else {
            let is_empty = self.lo > self.hi;
            return if is_empty { Some(0.0) } else { readable_offset([self.lo, self.hi], step) };
        };
        let middle = f64::midpoint(self.lo, self.hi);
        let stepped = own + ((middle - own) / step).round() * step;
        [own, stepped].into_iter().find(|offset| self.reaches(*offset, step))
    }
}

/// True if `at` is the number that is nearest to so many decimals, but for some bits.
fn has_decimals(at: f64, decimals: u8, is_single: bool) -> bool {
    const POWERS: [f64; MOST_DECIMALS as usize + 1] =
        [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12];
    let power = POWERS[usize::from(decimals.min(MOST_DECIMALS))];
    let near = (at * power).round() / power;
    if is_single { near as f32 == at as f32 } else { (near - at).abs() <= SLACK * at.abs() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(coordinates: &[f64], is_single: bool) -> AxisSpread {
        let mut all =
            AxisSpread { lo: f64::INFINITY, hi: f64::NEG_INFINITY, decimals: 0, grid: None };
        for &at in coordinates {
            let single = if is_single { f64::from(at as f32) } else { at };
            (all.lo, all.hi) = (all.lo.min(single), all.hi.max(single));
            while all.decimals <= MOST_DECIMALS && !has_decimals(single, all.decimals, is_single) {
                all.decimals += 1;
            }
        }
        all
    }

    #[test]
    fn the_step_is_that_of_the_most_decimals() {
        for (coordinates, step) in [
            (&[638.125, 1.5, -3.0][..], Some(1e-3)),
            (&[1.0, 2.0], Some(1.0)),
            (&[0.1, 0.2], Some(1e-1)),
            (&[], Some(STEP_OF_NONE)),
        ] {
            assert_eq!(spread(coordinates, false).step(None), step, "{coordinates:?}");
            assert_eq!(spread(coordinates, true).step(None), step, "{coordinates:?} as f32");
        }
        assert_eq!(spread(&[1.0 / 3.0], false).step(None), None);
        // As a scale in binary has it.
        let steps: Vec<f64> = (63_800_000..63_800_100).map(|step| f64::from(step) * 0.01).collect();
        assert!(steps.iter().any(|at| (at * 100.0).round() / 100.0 != *at));
        assert_eq!(spread(&steps, false).step(None), Some(1e-2));
        assert_eq!(spread(&[0.5], false).step(Some(0.125)), Some(1e-3));
    }

    #[test]
    fn the_offset_is_0_or_near_the_points() {
        let of = |coordinates: &[f64], step| spread(coordinates, false).offset(step);
        assert_eq!(of(&[638_000.0], 1e-3), Some(0.0));
        assert_eq!(of(&[5_638_123.456], 1e-3), Some(6_000_000.0 - 362_000.0));
        assert_eq!(of(&[-1e9, 1e9], 1e-3), None);
        assert_eq!(of(&[], 1e-9), Some(0.0));
    }

    #[test]
    fn one_scale_is_for_all_axes_where_it_reaches() {
        let [fine, coarse] = [spread(&[0.001], false), spread(&[12.5], false)];
        assert_eq!(Spread([fine, coarse, coarse]).scale(None).unwrap(), [1e-3; 3]);
        let [degrees, metres] = [spread(&[7.000_000_1], false), spread(&[-430.5, 8_848.5], false)];
        let low = spread(&[0.5, 188.5], false);
        assert_eq!(Spread([degrees, degrees, low]).scale(None).unwrap(), [1e-7; 3]);
        assert_eq!(Spread([degrees, degrees, metres]).scale(None).unwrap(), [1e-7, 1e-7, 0.1]);
        let far = spread(&[-9e5, 9e5], false);
        assert_eq!(Spread([degrees, degrees, far]).scale(None).unwrap(), [1e-7, 1e-7, 1.0]);
        let third = spread(&[1.0 / 3.0], false);
        let told = Spread([coarse, third, coarse]).scale(None).unwrap_err();
        assert!(told.to_string().contains("y of some points"), "{told}");
        assert!(told.remedy().unwrap().contains("`write.scale = 1e-"), "{:?}", told.remedy());
    }
}
