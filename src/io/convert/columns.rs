//! The steps of a projection over many records at once: field by field, each a loop of its own over
//! strided loads and stores. What a step finds unfit it leaves to the road that goes record by
//! record.

use super::step::{Move, is_single, slack};
use crate::point::{Dimension, Endian, Scalar};

/// Records that the steps take at once: with their targets and a column of numbers they stay in the
/// nearest cache.
pub(super) const BLOCK: usize = 256;

/// Below this a float has room for a half behind the point.
const HALVES: f64 = (1u64 << 51) as f64;

/// A step over a column.
#[derive(Debug, Clone)]
pub(super) enum ColumnStep {
    /// Bytes as they are, or in the other order.
    Bytes { from: usize, to: usize, size: usize, swapped: bool },
    /// Some bits of a byte as a byte.
    Bits { from: usize, to: usize, shift: u8, mask: u8 },
    /// A byte of at most `mask` into some bits of a byte.
    IntoBits { from: usize, to: usize, shift: u8, mask: u8 },
    /// A number by way of f64, which holds it exactly.
    Number(Box<Number>),
}

/// A number of one type as one of another.
#[derive(Debug, Clone)]
pub(super) struct Number {
    from: Dimension,
    from_endian: Endian,
    to: Dimension,
    to_endian: Endian,
    rule: NumberRule,
    slack: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum NumberRule {
    Stored,
    Rounded,
    Exact,
    Part,
}

/// Records and how long each is.
#[derive(Clone, Copy)]
pub(super) struct RecordBytes<'a> {
    pub bytes: &'a [u8],
    pub stride: usize,
}

/// Records to write and how long each is.
pub(super) struct TargetBytes<'a> {
    pub bytes: &'a mut [u8],
    pub stride: usize,
}

impl ColumnStep {
    /// The form of `step` over columns; None for steps that f64 cannot carry exactly (64-bit
    /// integers) and for bits of more than a byte.
    pub fn of(step: &Move, from_endian: Endian, to_endian: Endian) -> Option<ColumnStep> {
        let (from, to, rule) = match step {
            &Move::Copy { from, to, length } => {
                return Some(ColumnStep::Bytes { from, to, size: length, swapped: false });
            }
            &Move::Swap { from, to, size } => {
                return Some(ColumnStep::Bytes { from, to, size, swapped: true });
            }
            Move::Stored { from, to } => (from, to, NumberRule::Stored),
            Move::Narrow { from, to, shift, mask } => {
                let plain = from.scalar == Scalar::U8 && from.bits.is_none();
                return plain.then_some(ColumnStep::IntoBits {
                    from: from.offset,
                    to: to.offset,
                    shift: *shift,
                    mask: *mask,
                });
            }
            Move::Rounded { from, to } => (from, to, NumberRule::Rounded),
            Move::Exact { from, to } => (from, to, NumberRule::Exact),
            Move::Part { from, to } => (from, to, NumberRule::Part),
        };
        if let (Scalar::U8, Some(bits), NumberRule::Stored) = (from.scalar, from.bits, rule)
            && to.scalar == Scalar::U8
            && to.bits.is_none()
            && bits.width < 8
        {
            let mask = (1 << bits.width) - 1;
            return Some(ColumnStep::Bits {
                from: from.offset,
                to: to.offset,
                shift: bits.shift,
                mask,
            });
        }
        let wide = |d: &Dimension| matches!(d.scalar, Scalar::U64 | Scalar::I64);
        let plain = from.bits.is_none() && to.bits.is_none();
        (plain && !wide(from) && !wide(to)).then(|| {
            let (from, to, slack) = (from.clone(), to.clone(), slack(from, to));
            ColumnStep::Number(Box::new(Number { from, from_endian, to, to_endian, rule, slack }))
        })
    }

    /// Applies the step to up to [`BLOCK`] records; `rounded` has for each by how much it was
    /// rounded. False if a value may not fit: the block then is for the other road.
    pub fn apply(
        &self,
        from: RecordBytes<'_>,
        to: &mut TargetBytes<'_>,
        rounded: &mut [f64],
    ) -> bool {
        match *self {
            ColumnStep::Bytes { from: at, to: into, size, swapped } => {
                bytes(from, at, to, into, size, swapped);
                true
            }
            ColumnStep::Bits { from: at, to: into, shift, mask } => {
                each(from, at, to, into, |&[byte]: &[u8; 1], target: &mut [u8; 1]| {
                    *target = [byte >> shift & mask];
                });
                true
            }
            ColumnStep::IntoBits { from: at, to: into, shift, mask } => {
                let (mut all, hole) = (0, !(mask << shift));
                each(from, at, to, into, |&[byte]: &[u8; 1], target: &mut [u8; 1]| {
                    all |= byte;
                    target[0] = target[0] & hole | (byte & mask) << shift;
                });
                all & !mask == 0
            }
            ColumnStep::Number(ref number) => number.apply(from, to, rounded),
        }
    }
}

/// Calls `step` with `N` bytes at `at` of each record and `M` at `into` of its target.
#[inline(always)]
fn each<const N: usize, const M: usize>(
    from: RecordBytes<'_>,
    at: usize,
    to: &mut TargetBytes<'_>,
    into: usize,
    mut step: impl FnMut(&[u8; N], &mut [u8; M]),
) {
    let records = from.bytes.chunks_exact(from.stride);
    for (record, target) in records.zip(to.bytes.chunks_exact_mut(to.stride)) {
        let field = record.get(at..).and_then(<[u8]>::first_chunk);
        let place = target.get_mut(into..).and_then(<[u8]>::first_chunk_mut);
        if let (Some(field), Some(place)) = (field, place) {
            step(field, place);
        }
    }
}

fn bytes(
    from: RecordBytes<'_>,
    at: usize,
    to: &mut TargetBytes<'_>,
    into: usize,
    size: usize,
    swapped: bool,
) {
    macro_rules! of {
        ($n:literal) => {
            match swapped {
                false => each(from, at, to, into, |a: &[u8; $n], b: &mut [u8; $n]| *b = *a),
                true => each(from, at, to, into, |a: &[u8; $n], b: &mut [u8; $n]| {
                    *b = *a;
                    b.reverse();
                }),
            }
        };
    }
    match size {
        1 => of!(1),
        2 => of!(2),
        4 => of!(4),
        8 => of!(8),
        // Only what is not swapped joins.
        size => {
            let records = from.bytes.chunks_exact(from.stride);
            for (record, target) in records.zip(to.bytes.chunks_exact_mut(to.stride)) {
                target[into..into + size].copy_from_slice(&record[at..at + size]);
            }
        }
    }
}

impl Number {
    fn apply(&self, from: RecordBytes<'_>, to: &mut TargetBytes<'_>, rounded: &mut [f64]) -> bool {
        let mut column = [0.0; BLOCK];
        let values = &mut column[..rounded.len()];
        load(&self.from, self.from_endian, from, values);
        let fit = match (self.rule, self.to.scalar) {
            (NumberRule::Stored, _) => true,
            (rule, Scalar::F64) => self.rescale(rule, values, rounded, |steps| (steps, true)),
            (rule, Scalar::F32) => {
                self.rescale(rule, values, rounded, |steps| (f64::from(steps as f32), true))
            }
            (rule, _) => self.rescale(rule, values, rounded, whole),
        };
        fit && store(&self.to, self.to_endian, values, to)
    }

    #[inline(always)]
    fn rescale(
        &self,
        rule: NumberRule,
        values: &mut [f64],
        rounded: &mut [f64],
        to_stored: impl Fn(f64) -> (f64, bool),
    ) -> bool {
        let from = &self.from;
        let single = is_single(from);
        match (rule, single) {
            (NumberRule::Rounded, _) => self.rounding(values, rounded, to_stored),
            (NumberRule::Part, _) => {
                let mut untold = [0.0; BLOCK];
                self.rounding(values, &mut untold[..rounded.len()], to_stored)
            }
            (_, true) => self.exactly::<true>(values, to_stored),
            (_, false) => self.exactly::<false>(values, to_stored),
        }
    }

    /// Stored numbers of the source become those of the target that are nearest to the same world
    /// value; `rounded` grows to how far that is off. The same operations in the same order as
    /// those of the other road, without branches, so that several values go side by side.
    #[inline(always)]
    fn rounding(
        &self,
        values: &mut [f64],
        rounded: &mut [f64],
        to_stored: impl Fn(f64) -> (f64, bool),
    ) -> bool {
        let (from, to) = (&self.from, &self.to);
        let origins = from.origin.abs().max(to.origin.abs());
        let single = is_single(from);
        let mut unfit = 0;
        for (value, rounded) in values.iter_mut().zip(rounded) {
            let world = *value * from.scale + from.origin;
            let (stored, fits) = to_stored((world - to.origin) / to.scale);
            let back = stored * to.scale + to.origin;
            let is_beyond = world.is_finite() & !back.is_finite();
            let by = (back - world).abs();
            // What the arithmetic of scales and offsets rounds is not the point's place.
            let largest = if world.abs() > origins { world.abs() } else { origins };
            let same = single & (back as f32 == world as f32);
            let told = (by > 4.0 * f64::EPSILON * largest) & (by > *rounded) & !same;
            *rounded = if told { by } else { *rounded };
            *value = stored;
            unfit |= u64::from(!fits | is_beyond);
        }
        unfit == 0
    }

    /// The same for values that the target must hold; `SINGLE` if the source's are plain f32.
    #[inline(always)]
    fn exactly<const SINGLE: bool>(
        &self,
        values: &mut [f64],
        to_stored: impl Fn(f64) -> (f64, bool),
    ) -> bool {
        let (from, to) = (&self.from, &self.to);
        let least = to.scale.abs();
        let mut unfit = 0;
        for value in values {
            let world = *value * from.scale + from.origin;
            let (stored, fits) = to_stored((world - to.origin) / to.scale);
            let back = stored * to.scale + to.origin;
            let largest = if world.abs() > least { world.abs() } else { least };
            let near = (back - world).abs() <= f64::max(1e-9 * largest, self.slack);
            let same = near | (SINGLE && back as f32 == world as f32);
            *value = stored;
            unfit |= u64::from(!(fits & same));
        }
        unfit == 0
    }
}

/// The nearest integer, halves to the even one; False where a float may have no half.
#[inline(always)]
fn whole(steps: f64) -> (f64, bool) {
    // The sum has no bit behind the point, so adding rounds, to even as all arithmetic does.
    const SHIFT: f64 = (3u64 << 51) as f64;
    ((steps + SHIFT) - SHIFT, steps.abs() < HALVES)
}

fn load(field: &Dimension, endian: Endian, from: RecordBytes<'_>, values: &mut [f64]) {
    macro_rules! of {
        ($t:ty) => {{
            let take = |read: fn([u8; size_of::<$t>()]) -> $t| read;
            match endian {
                Endian::Little => column(from, field.offset, values, take(<$t>::from_le_bytes)),
                Endian::Big => column(from, field.offset, values, take(<$t>::from_be_bytes)),
            }
        }};
    }
    match field.scalar {
        Scalar::U8 => of!(u8),
        Scalar::I8 => of!(i8),
        Scalar::U16 => of!(u16),
        Scalar::I16 => of!(i16),
        Scalar::U32 => of!(u32),
        Scalar::I32 => of!(i32),
        Scalar::F32 => of!(f32),
        Scalar::F64 => of!(f64),
        Scalar::U64 | Scalar::I64 => {}
    }
}

#[inline(always)]
fn column<const N: usize, T: Into<f64>>(
    from: RecordBytes<'_>,
    at: usize,
    values: &mut [f64],
    read: impl Fn([u8; N]) -> T,
) {
    for (value, record) in values.iter_mut().zip(from.bytes.chunks_exact(from.stride)) {
        if let Some(field) = record.get(at..).and_then(<[u8]>::first_chunk) {
            *value = read(*field).into();
        }
    }
}

/// Stores the values; false if one does not fit.
fn store(field: &Dimension, endian: Endian, values: &[f64], to: &mut TargetBytes<'_>) -> bool {
    macro_rules! of {
        ($t:ty) => {
            match endian {
                Endian::Little => fill(values, to, field.offset, |v| {
                    let stored = v as $t;
                    (stored.to_le_bytes(), f64::from(stored) == v)
                }),
                Endian::Big => fill(values, to, field.offset, |v| {
                    let stored = v as $t;
                    (stored.to_be_bytes(), f64::from(stored) == v)
                }),
            }
        };
    }
    match field.scalar {
        Scalar::U8 => of!(u8),
        Scalar::I8 => of!(i8),
        Scalar::U16 => of!(u16),
        Scalar::I16 => of!(i16),
        Scalar::U32 => of!(u32),
        Scalar::I32 => of!(i32),
        // NaN does not fit here, and does on the other road.
        Scalar::F32 => of!(f32),
        Scalar::F64 => match endian {
            Endian::Little => fill(values, to, field.offset, |v| (v.to_le_bytes(), true)),
            Endian::Big => fill(values, to, field.offset, |v| (v.to_be_bytes(), true)),
        },
        Scalar::U64 | Scalar::I64 => false,
    }
}

#[inline(always)]
fn fill<const N: usize>(
    values: &[f64],
    to: &mut TargetBytes<'_>,
    at: usize,
    write: impl Fn(f64) -> ([u8; N], bool),
) -> bool {
    let mut fit = true;
    for (value, target) in values.iter().zip(to.bytes.chunks_exact_mut(to.stride)) {
        let (bytes, fits) = write(*value);
        fit &= fits;
        if let Some(place) = target.get_mut(at..).and_then(<[u8]>::first_chunk_mut) {
            *place = bytes;
        }
    }
    fit
}
