//! What an expression is for records, block by block.

use super::bind::{Number, Truth};
use super::lanes::{Block, LANES, Lanes};
use super::tree::{Function, Operator, Relation};
use crate::point::PointBatch;

/// Whether something holds for each record of a block.
type Mask = [bool; LANES];

/// The blocks of a batch.
fn blocks(batch: &PointBatch) -> impl Iterator<Item = Block<'_>> {
    let each = (0..batch.len()).step_by(LANES);
    each.map(|first| Block { batch, first, count: LANES.min(batch.len() - first) })
}

/// Appends to `out` for each record of `batch` whether `truth` holds.
pub(super) fn holds(truth: &Truth, batch: &PointBatch, out: &mut Vec<bool>) {
    out.reserve(batch.len());
    for block in blocks(batch) {
        let mut mask = [false; LANES];
        truth.evaluate(block, &mut mask);
        out.extend_from_slice(&mask[..block.count]);
    }
}

/// Appends to `out` the number of each record of `batch`.
pub(super) fn numbers(number: &Number, batch: &PointBatch, out: &mut Vec<f64>) {
    out.reserve(batch.len());
    for block in blocks(batch) {
        let mut lanes = [0.0; LANES];
        number.evaluate(block, &mut lanes);
        out.extend_from_slice(&lanes[..block.count]);
    }
}

impl Number {
    fn evaluate(&self, block: Block<'_>, out: &mut Lanes) {
        match self {
            Number::Literal(value) => out.fill(*value),
            Number::Field(field) => field.load(block, out),
            Number::Negated(of) => {
                of.evaluate(block, out);
                out.iter_mut().for_each(|value| *value = -*value);
            }
            Number::Arithmetic(operator, a, b) => {
                a.evaluate(block, out);
                let mut right = [0.0; LANES];
                b.evaluate(block, &mut right);
                operator.apply(out, &right);
            }
            Number::Call(function, of) => {
                of.first().into_iter().for_each(|of| of.evaluate(block, out));
                let mut second = [0.0; LANES];
                of.get(1).into_iter().for_each(|of| of.evaluate(block, &mut second));
                function.apply(out, &second);
            }
        }
    }
}

/// Changes each lane by that of another.
fn each(out: &mut Lanes, other: &Lanes, change: impl Fn(f64, f64) -> f64) {
    out.iter_mut().zip(other).for_each(|(a, b)| *a = change(*a, *b));
}

impl Operator {
    fn apply(self, out: &mut Lanes, right: &Lanes) {
        match self {
            Operator::Plus => each(out, right, |a, b| a + b),
            Operator::Minus => each(out, right, |a, b| a - b),
            Operator::Times => each(out, right, |a, b| a * b),
            Operator::Over => each(out, right, |a, b| a / b),
            Operator::Remainder => each(out, right, |a, b| a % b),
        }
    }
}

impl Function {
    fn apply(self, out: &mut Lanes, second: &Lanes) {
        match self {
            Function::Abs => each(out, second, |a, _| a.abs()),
            Function::Sqrt => each(out, second, |a, _| a.sqrt()),
            Function::Floor => each(out, second, |a, _| a.floor()),
            Function::Ceil => each(out, second, |a, _| a.ceil()),
            Function::Round => each(out, second, |a, _| a.round()),
            // Unlike `f64::min`, what is unknown stays unknown.
            Function::Min => each(out, second, |a, b| if a < b || a.is_nan() { a } else { b }),
            Function::Max => each(out, second, |a, b| if a > b || a.is_nan() { a } else { b }),
        }
    }
}

impl Truth {
    fn evaluate(&self, block: Block<'_>, out: &mut Mask) {
        match self {
            Truth::Compared(relation, a, b) => relation.evaluate(block, [a, b], out),
            Truth::Among(of, ranges) => among(block, of, ranges, out),
            Truth::IsNan(of) => with(block, of, |lanes| set(out, lanes, f64::is_nan)),
            Truth::Set(of) => with(block, of, |lanes| set(out, lanes, |value| value != 0.0)),
            Truth::Not(of) => {
                of.evaluate(block, out);
                out.iter_mut().for_each(|held| *held = !*held);
            }
            Truth::All(parts) => several(block, parts, out, true),
            Truth::Any(parts) => several(block, parts, out, false),
        }
    }
}

/// Calls `use_lanes` with the numbers of a block.
fn with(block: Block<'_>, number: &Number, use_lanes: impl FnOnce(&Lanes)) {
    let mut lanes = [0.0; LANES];
    number.evaluate(block, &mut lanes);
    use_lanes(&lanes);
}

fn set(out: &mut Mask, lanes: &Lanes, holds: impl Fn(f64) -> bool) {
    out.iter_mut().zip(lanes).for_each(|(held, value)| *held = holds(*value));
}

/// Whether all parts hold (`all`), or any does. Parts that cannot change a block are not looked at.
fn several(block: Block<'_>, parts: &[Truth], out: &mut Mask, all: bool) {
    out.fill(all);
    for part in parts {
        if out[..block.count].iter().all(|held| *held != all) {
            return;
        }
        let mut mask = [false; LANES];
        part.evaluate(block, &mut mask);
        let joined = out.iter_mut().zip(&mask);
        match all {
            true => joined.for_each(|(held, part)| *held &= part),
            false => joined.for_each(|(held, part)| *held |= part),
        }
    }
}

fn among(block: Block<'_>, of: &Number, ranges: &[(Number, Number)], out: &mut Mask) {
    out.fill(false);
    with(block, of, |lanes| {
        for range in ranges {
            if let (Number::Literal(lo), Number::Literal(hi)) = range {
                let within = |value: f64| (value >= *lo) & (value <= *hi);
                out.iter_mut().zip(lanes).for_each(|(held, value)| *held |= within(*value));
                continue;
            }
            with(block, &range.0, |lo| {
                with(block, &range.1, |hi| {
                    for (i, held) in out.iter_mut().enumerate() {
                        *held |= (lanes[i] >= lo[i]) & (lanes[i] <= hi[i]);
                    }
                });
            });
        }
    });
}

impl Relation {
    fn evaluate(self, block: Block<'_>, [a, b]: [&Number; 2], out: &mut Mask) {
        with(block, a, |a| match b {
            Number::Literal(b) => self.apply(out, a, &|_| *b),
            b => with(block, b, |b| self.apply(out, a, &|i| b[i])),
        });
    }

    fn apply(self, out: &mut Mask, a: &Lanes, b: &impl Fn(usize) -> f64) {
        let lanes = out.iter_mut().zip(a).enumerate();
        match self {
            Relation::Equal => lanes.for_each(|(i, (held, a))| *held = *a == b(i)),
            Relation::Unequal => lanes.for_each(|(i, (held, a))| *held = *a != b(i)),
            Relation::Less => lanes.for_each(|(i, (held, a))| *held = *a < b(i)),
            Relation::AtMost => lanes.for_each(|(i, (held, a))| *held = *a <= b(i)),
            Relation::Greater => lanes.for_each(|(i, (held, a))| *held = *a > b(i)),
            Relation::AtLeast => lanes.for_each(|(i, (held, a))| *held = *a >= b(i)),
        }
    }
}
