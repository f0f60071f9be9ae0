//! Records of one format as records of another: every dimension goes where its name is, and what
//! the target cannot hold is told, never changed. Knows no files.

mod asked;
mod columns;
mod step;
mod told;

use std::collections::{BTreeMap, BTreeSet};

pub(crate) use asked::AskedValues;
use asked::SCALE;
pub(super) use asked::TYPES;
use columns::{BLOCK, ColumnStep, RecordBytes, TargetBytes};
use step::{Move, is_single, push, rounding, slack, step};
pub(super) use told::{check_drop, meant_names, quoted};
use told::{kept_otherwise, placed, room};

use crate::point::names::{BLUE, GREEN, NIR, RED, XYZ};
use crate::point::{Dimension, Endian, Scalar, Schema, Value};
use crate::{Error, ErrorKind, Result};

/// What a conversion of coordinates rounded.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct Rounding {
    /// Points of which a coordinate was rounded.
    pub points: u64,
    /// Largest difference in one coordinate, in world units.
    pub largest: f64,
}

/// How records of one schema become records of another, decided once.
#[derive(Debug, Clone)]
pub struct Projection {
    from: Schema,
    to_endian: Endian,
    to_stride: usize,
    moves: Vec<Move>,
    /// What a record holds before the steps: 0, and the numbers that [`Projection::preset`] set.
    blank: Vec<u8>,
    /// The same steps over columns, for those that have such a form.
    columns: Vec<Option<ColumnStep>>,
    /// The stage whose keys messages advise.
    stage: &'static str,
    /// Dimensions of the target whose types were asked for.
    typed: Vec<String>,
    /// See [`AskedValues::unit_intensity`].
    unit_intensity: bool,
}

impl Projection {
    /// The projection from one schema to another. A dimension of `to` that `from` lacks is 0; one
    /// of `from` that `to` lacks must be named in `drop`.
    ///
    /// # Errors
    ///
    /// A dimension of `from` that `to` lacks and `drop` does not name, a name in `drop` that `from`
    /// lacks, and coordinates, which cannot be dropped.
    pub fn new(from: &Schema, to: &Schema, drop: &[String]) -> Result<Projection> {
        let drop = drop.to_vec();
        Projection::asked(from, to, &AskedValues { drop, ..AskedValues::default() })
    }

    /// The same with values as they were asked for.
    ///
    /// # Errors
    ///
    /// As [`new`](Projection::new).
    pub(crate) fn asked(from: &Schema, to: &Schema, asked: &AskedValues) -> Result<Projection> {
        let drop = &asked.drop;
        check_drop(from, drop)?;
        let held: BTreeSet<&str> = to.dimensions.iter().map(|d| d.name.as_str()).collect();
        let lost: Vec<&str> = from
            .dimensions
            .iter()
            .map(|d| d.name.as_str())
            .filter(|name| !held.contains(name) && !drop.iter().any(|d| d == name))
            .collect();
        if !lost.is_empty() {
            let family = to.layout.family;
            let format = match to.layout.form {
                Some(form) => format!("{family} point format {form}"),
                None => format!("this {family} output"),
            };
            return Err(Error::pipeline(format!("{format} cannot hold {}", quoted(&lost)))
                .help(format!("`write.drop = {lost:?}` leaves them out")));
        }
        let sources: BTreeMap<&str, &Dimension> =
            from.dimensions.iter().map(|d| (d.name.as_str(), d)).collect();
        let mut moves = Vec::new();
        for target in to.dimensions.iter().filter(|d| !drop.contains(&d.name)) {
            if let Some(source) = sources.get(target.name.as_str()) {
                let families = [from.layout.family, to.layout.family];
                if let Some(step) = asked.step(families, source, target) {
                    push(&mut moves, step);
                } else if widens(from, source, to, target) {
                    // 257 times a byte is the byte twice.
                    for to in [target.offset, target.offset + 1] {
                        push(&mut moves, Move::Copy { from: source.offset, to, length: 1 });
                    }
                } else {
                    push(&mut moves, step(source, from.endian, target, to.endian));
                }
            }
        }
        let over_columns = moves.iter().map(|step| ColumnStep::of(step, from.endian, to.endian));
        let columns = over_columns.collect();
        let (to_endian, to_stride) = (to.endian, to.stride);
        let blank = vec![0; to_stride];
        let (from, stage) = (from.clone(), "write");
        let (typed, unit_intensity) = (asked.typed.clone(), asked.unit_intensity);
        Ok(Projection {
            from,
            to_endian,
            to_stride,
            moves,
            blank,
            columns,
            stage,
            typed,
            unit_intensity,
        })
    }

    /// The same for records that are brought to another form as they are read.
    pub(crate) fn reading(from: &Schema, to: &Schema) -> Result<Projection> {
        Ok(Projection { stage: "read", ..Projection::new(from, to, &[])? })
    }

    /// What it rounds values to, in words.
    pub(crate) fn rounded_to(&self) -> &'static str {
        let is_other = |step: &Move| match step {
            Move::Rounded { to, .. } => !XYZ.contains(&to.name.as_str()),
            _ => false,
        };
        if self.moves.iter().any(is_other) { TYPES } else { SCALE }
    }

    /// Leaves room behind each record: records become `stride` bytes long, the new ones 0.
    pub(crate) fn widen(&mut self, stride: usize) {
        self.to_stride = self.to_stride.max(stride);
        self.blank.resize(self.to_stride, 0);
    }

    /// Gives the dimension `to` of the target, which the source lacks, this value instead of 0.
    /// False if it cannot hold it.
    #[must_use]
    pub(crate) fn preset(&mut self, to: &Dimension, value: Value) -> bool {
        to.put(&mut self.blank, self.to_endian, value)
    }

    fn clear(&self, targets: &mut [u8]) {
        match self.blank.iter().all(|&byte| byte == 0) {
            true => targets.fill(0),
            false => {
                let each = targets.chunks_exact_mut(self.to_stride.max(1));
                each.for_each(|target| target.copy_from_slice(&self.blank));
            }
        }
    }

    /// True if every record stays as it is, byte for byte.
    pub(crate) fn is_copy(&self) -> bool {
        let all = self.from.stride;
        let whole =
            matches!(self.moves[..], [Move::Copy { from: 0, to: 0, length }] if length == all);
        whole && self.to_stride == all
    }

    /// Bytes of a projected record.
    pub fn stride(&self) -> usize {
        self.to_stride
    }

    /// Appends the projections of `records` to `out`.
    ///
    /// # Errors
    ///
    /// The first value that its target cannot hold, with its dimension and point.
    pub fn project(&self, records: &[u8], out: &mut Vec<u8>) -> Result<Rounding> {
        let start = out.len();
        let points = records.len() / self.from.stride.max(1);
        out.resize(start + points * self.to_stride, 0);
        self.project_into(records, &mut out[start..])
    }

    /// Replaces `out`, which has room for exactly as many, by the projections of `records`; fails
    /// as [`project`](Self::project) does.
    pub(crate) fn project_into(&self, records: &[u8], out: &mut [u8]) -> Result<Rounding> {
        let (from, to) = (self.from.stride.max(1), self.to_stride.max(1));
        let mut rounding = Rounding::default();
        let blocks = records.chunks(BLOCK * from).zip(out.chunks_mut(BLOCK * to));
        for (block, (records, targets)) in blocks.enumerate() {
            let mut rounded = [0.0; BLOCK];
            let rounded = &mut rounded[..records.len() / from];
            if !self.block(records, targets, rounded) {
                self.one_by_one(block * BLOCK, records, targets, rounded)?;
            }
            rounding.points += rounded.iter().map(|&by| u64::from(by > 0.0)).sum::<u64>();
            rounding.largest = rounded.iter().fold(rounding.largest, |all, &by| all.max(by));
        }
        Ok(rounding)
    }

    /// Projects up to [`BLOCK`] records field by field; False if a value may not fit.
    fn block(&self, records: &[u8], targets: &mut [u8], rounded: &mut [f64]) -> bool {
        self.clear(targets);
        let from = RecordBytes { bytes: records, stride: self.from.stride.max(1) };
        let mut to = TargetBytes { bytes: targets, stride: self.to_stride.max(1) };
        self.moves.iter().zip(&self.columns).all(|(step, column)| match column {
            Some(column) => column.apply(from, &mut to, rounded),
            None => {
                let records = from.bytes.chunks_exact(from.stride);
                let targets = to.bytes.chunks_exact_mut(to.stride);
                records.zip(targets).zip(&mut *rounded).all(|((record, target), rounded)| {
                    let by = self.apply(step, record, target);
                    by.map(|by| *rounded = rounded.max(by)).is_ok()
                })
            }
        })
    }

    /// Projects the records from number `first` on one by one.
    fn one_by_one(
        &self,
        first: usize,
        records: &[u8],
        targets: &mut [u8],
        rounded: &mut [f64],
    ) -> Result<()> {
        self.clear(targets);
        let records = records.chunks_exact(self.from.stride.max(1));
        let targets = targets.chunks_exact_mut(self.to_stride.max(1));
        for (index, ((record, target), rounded)) in records.zip(targets).zip(rounded).enumerate() {
            *rounded = 0.0;
            for step in &self.moves {
                match self.apply(step, record, target) {
                    Ok(by) => *rounded = rounded.max(by),
                    Err(unfit) => return Err(self.refuse(unfit, first + index, record)),
                }
            }
        }
        Ok(())
    }

    /// Applies one step; returns by how much it rounded.
    fn apply<'a>(
        &self,
        step: &'a Move,
        record: &[u8],
        target: &mut [u8],
    ) -> Result<f64, UnfitValue<'a>> {
        let endian = self.from.endian;
        match step {
            Move::Copy { from, to, length } => {
                target[*to..to + length].copy_from_slice(&record[*from..from + length]);
                Ok(0.0)
            }
            Move::Swap { from, to, size } => {
                let into = &mut target[*to..to + size];
                into.copy_from_slice(&record[*from..from + size]);
                into.reverse();
                Ok(0.0)
            }
            Move::Stored { from, to } => {
                let value = from.get(record, endian);
                let held = to.put(target, self.to_endian, value);
                if held { Ok(0.0) } else { Err(UnfitValue { to, value }) }
            }
            Move::Narrow { from, to, shift, mask } => {
                let value = from.get(record, endian);
                let Some(bits) = small(value).filter(|bits| bits <= mask) else {
                    return Err(UnfitValue { to, value });
                };
                let byte = &mut target[to.offset];
                *byte = *byte & !(mask << shift) | bits << shift;
                Ok(0.0)
            }
            Move::Part { from, to } => {
                let (stored, _) = nearest(to, from.world(record, endian));
                let held = to.put(target, self.to_endian, stored);
                let value = || Dimension { scale: 1.0, ..from.clone() }.get(record, endian);
                if held { Ok(0.0) } else { Err(UnfitValue { to, value: value() }) }
            }
            Move::Rounded { from, to } => {
                let world = from.world(record, endian);
                let (stored, back) = nearest(to, world);
                let is_beyond = world.is_finite() && !back.is_finite();
                match !is_beyond && to.put(target, self.to_endian, stored) {
                    true => Ok(rounding(from, to, world, back)),
                    false => Err(UnfitValue { to, value: Value::Double(world) }),
                }
            }
            Move::Exact { from, to } => {
                let world = from.world(record, endian);
                let (stored, back) = nearest(to, world);
                if same(from, to, world, back) && to.put(target, self.to_endian, stored) {
                    return Ok(0.0);
                }
                Err(UnfitValue { to, value: Value::Double(world) })
            }
        }
    }

    fn refuse(&self, unfit: UnfitValue, index: usize, record: &[u8]) -> Error {
        let UnfitValue { to, value } = unfit;
        let place = match self.from.coordinates() {
            Some(axes) => {
                let [x, y, z] = axes.map(|axis| axis.world(record, self.from.endian));
                format!("the point at ({x}, {y}, {z})")
            }
            None => format!("point {index} of its batch"),
        };
        let text = match value {
            Value::Unsigned(v) => v.to_string(),
            Value::Signed(v) => v.to_string(),
            Value::Single(v) => v.to_string(),
            Value::Double(v) => v.to_string(),
        };
        let name = &to.name;
        let error = Error::new(
            ErrorKind::Data,
            format!("{name} = {text} of {place} does not fit {}", room(to)),
        );
        if self.typed.contains(name) && value.as_f64().is_finite() {
            return error.help("give it a type in `write.types` that holds it, such as `f64`");
        }
        if XYZ.contains(&name.as_str()) {
            if !value.as_f64().is_finite() {
                return error.help("`run.nonfinite = \"drop\"` leaves such points out");
            }
            let world = self
                .from
                .coordinates()
                .map(|axes| axes.map(|axis| axis.world(record, self.from.endian)));
            return error.help(placed(self.stage, world, to, value.as_f64()));
        }
        let is_float = matches!(value, Value::Single(_) | Value::Double(_));
        let is_fraction = is_float && (self.unit_intensity || value.as_f64().fract() != 0.0);
        match self.stage {
            "write" => error.help(kept_otherwise(to, is_fraction, self.unit_intensity)),
            _ => error.help("give a point format that has room for it, or convert it by itself"),
        }
    }
}

/// A value that its target cannot hold.
struct UnfitValue<'a> {
    to: &'a Dimension,
    value: Value,
}

/// The stored number whose world value is nearest to `world` (halves to the even one), and that
/// world value.
fn nearest(to: &Dimension, world: f64) -> (Value, f64) {
    let steps = (world - to.origin) / to.scale;
    let stored = if to.scalar.is_float() { steps } else { steps.round_ties_even() };
    let stored = if to.scalar == Scalar::F32 { f64::from(stored as f32) } else { stored };
    (Value::Double(stored), stored * to.scale + to.origin)
}

/// True if `back`, what the target holds, is the source's value but for the rounding of arithmetic:
/// the same f32 where the source is one.
fn same(from: &Dimension, to: &Dimension, world: f64, back: f64) -> bool {
    let single = is_single(from);
    let near = f64::max(1e-9 * world.abs().max(to.scale.abs()), slack(from, to));
    (single && back as f32 == world as f32) || (back - world).abs() <= near
}

/// A value as a byte, if it is one.
fn small(value: Value) -> Option<u8> {
    match value {
        Value::Unsigned(v) => u8::try_from(v).ok(),
        Value::Signed(v) => u8::try_from(v).ok(),
        Value::Single(_) | Value::Double(_) => {
            let v = value.as_f64();
            (v.fract() == 0.0 && (0.0..256.0).contains(&v)).then_some(v as u8)
        }
    }
}

/// True if `target` holds 257 times the `source`: colours, of which 255 is the most in 8 bits, as
/// in PLY, and 65535 in 16, as in LAS (LAS 1.4 R15, table 9).
fn widens(from: &Schema, source: &Dimension, to: &Schema, target: &Dimension) -> bool {
    from.layout.family != to.layout.family
        && [RED, GREEN, BLUE, NIR].contains(&target.name.as_str())
        && (source.scalar, target.scalar) == (Scalar::U8, Scalar::U16)
}

#[cfg(test)]
mod tests;
