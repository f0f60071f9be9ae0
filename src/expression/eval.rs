//! What an expression is for records, block by block.

use super::bind::{NumberNode, TruthNode};
use super::lanes::{BatchBlock, LANES, LoadedField, NumberLanes};
use super::tree::{Function, Operator, Relation};
use crate::point::PointBatch;

/// Whether something holds for each record of a block.
type HeldLanes = [bool; LANES];

/// Calls `visit` with the stored numbers of `field` in `batch`, block by block.
pub(super) fn each_stored(field: &LoadedField, batch: &PointBatch, visit: &mut dyn FnMut(&[f64])) {
    for block in blocks(batch) {
        let mut lanes = [0.0; LANES];
        field.load_stored(block, &mut lanes);
        visit(&lanes[..block.count]);
    }
}

/// The blocks of a batch.
fn blocks(batch: &PointBatch) -> impl Iterator<Item = BatchBlock<'_>> {
    let each = (0..batch.len()).step_by(LANES);
    each.map(|first| BatchBlock { batch, first, count: LANES.min(batch.len() - first) })
}

/// Appends to `out` for each record of `batch` whether `truth` holds.
pub(super) fn holds(truth: &TruthNode, batch: &PointBatch, out: &mut Vec<bool>) {
    out.reserve(batch.len());
    for block in blocks(batch) {
        let mut mask = [false; LANES];
        truth.evaluate(block, &mut mask);
        out.extend_from_slice(&mask[..block.count]);
    }
}

/// Appends to `out` the number of each record of `batch`.
pub(super) fn numbers(number: &NumberNode, batch: &PointBatch, out: &mut Vec<f64>) {
    out.reserve(batch.len());
    for block in blocks(batch) {
        let mut lanes = [0.0; LANES];
        number.evaluate(block, &mut lanes);
        out.extend_from_slice(&lanes[..block.count]);
    }
}

impl NumberNode {
    fn evaluate(&self, block: BatchBlock<'_>, out: &mut NumberLanes) {
        match self {
            NumberNode::Literal(value) => out.fill(*value),
            NumberNode::Field(field) => field.load(block, out),
            NumberNode::Negated(of) => {
                of.evaluate(block, out);
                out.iter_mut().for_each(|value| *value = -*value);
            }
            NumberNode::Arithmetic(operator, a, b) => {
                a.evaluate(block, out);
                let mut right = [0.0; LANES];
                b.evaluate(block, &mut right);
                operator.apply(out, &right);
            }
            NumberNode::Call(function, of) => {
                of.first().into_iter().for_each(|of| of.evaluate(block, out));
                let mut second = [0.0; LANES];
                of.get(1).into_iter().for_each(|of| of.evaluate(block, &mut second));
                function.apply(out, &second);
            }
        }
    }
}

/// Changes each lane by that of another.
fn each(out: &mut NumberLanes, other: &NumberLanes, change: impl Fn(f64, f64) -> f64) {
    out.iter_mut().zip(other).for_each(|(a, b)| *a = change(*a, *b));
}

impl Operator {
    fn apply(self, out: &mut NumberLanes, right: &NumberLanes) {
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
    fn apply(self, out: &mut NumberLanes, second: &NumberLanes) {
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

impl TruthNode {
    fn evaluate(&self, block: BatchBlock<'_>, out: &mut HeldLanes) {
        match self {
            TruthNode::Compared(relation, a, b) => relation.evaluate(block, [a, b], out),
            TruthNode::Among(of, ranges) => among(block, of, ranges, out),
            TruthNode::IsNan(of) => with(block, of, |lanes| set(out, lanes, f64::is_nan)),
            TruthNode::Set(of) => with(block, of, |lanes| set(out, lanes, |value| value != 0.0)),
            TruthNode::Not(of) => {
                of.evaluate(block, out);
                out.iter_mut().for_each(|held| *held = !*held);
            }
            TruthNode::All(parts) => several(block, parts, out, true),
            TruthNode::Any(parts) => several(block, parts, out, false),
        }
    }
}

/// Calls `use_lanes` with the numbers of a block.
fn with(block: BatchBlock<'_>, number: &NumberNode, use_lanes: impl FnOnce(&NumberLanes)) {
    let mut lanes = [0.0; LANES];
    number.evaluate(block, &mut lanes);
    use_lanes(&lanes);
}

fn set(out: &mut HeldLanes, lanes: &NumberLanes, holds: impl Fn(f64) -> bool) {
    out.iter_mut().zip(lanes).for_each(|(held, value)| *held = holds(*value));
}

/// Whether all parts hold (`all`), or any does. Parts that cannot change a block are not looked at.
fn several(block: BatchBlock<'_>, parts: &[TruthNode], out: &mut HeldLanes, all: bool) {
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

fn among(
    block: BatchBlock<'_>,
    of: &NumberNode,
    ranges: &[(NumberNode, NumberNode)],
    out: &mut HeldLanes,
) {
    out.fill(false);
    with(block, of, |lanes| {
        for range in ranges {
            if let (NumberNode::Literal(lo), NumberNode::Literal(hi)) = range {
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
    fn evaluate(self, block: BatchBlock<'_>, [a, b]: [&NumberNode; 2], out: &mut HeldLanes) {
        with(block, a, |a| match b {
            NumberNode::Literal(b) => self.apply(out, a, &|_| *b),
            b => with(block, b, |b| self.apply(out, a, &|i| b[i])),
        });
    }

    fn apply(self, out: &mut HeldLanes, a: &NumberLanes, b: &impl Fn(usize) -> f64) {
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
