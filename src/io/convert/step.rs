//! The steps that records are projected by, and which of them a pair of dimensions needs.

use crate::point::names::{SCAN_ANGLE, XYZ};
use crate::point::{Dimension, Endian, Scalar};

/// One step of a projection.
#[derive(Debug, Clone)]
pub(super) enum Move {
    /// Bytes that mean the same in both.
    Copy { from: usize, to: usize, length: usize },
    /// A number in the other byte order.
    Swap { from: usize, to: usize, size: usize },
    /// A stored number in another type; scale and origin are equal.
    Stored { from: Dimension, to: Dimension },
    /// A stored number into some bits of a byte.
    Narrow { from: Dimension, to: Dimension, shift: u8, mask: u8 },
    /// A world value rounded to the target's steps (coordinates).
    Rounded { from: Dimension, to: Dimension },
    /// A world value that the target must hold.
    Exact { from: Dimension, to: Dimension },
    /// A part of the most that the other side holds: `from` is scaled, and what that rounds is not
    /// told.
    Part { from: Dimension, to: Dimension },
}

/// The step from one dimension to another.
pub(super) fn step(
    from: &Dimension,
    from_endian: Endian,
    to: &Dimension,
    to_endian: Endian,
) -> Move {
    let size = from.scalar.size();
    if from.scale == to.scale && from.origin == to.origin {
        let alike = from.scalar == to.scalar && from.bits.is_none() && to.bits.is_none();
        return match alike {
            true if size == 1 || from_endian == to_endian => {
                Move::Copy { from: from.offset, to: to.offset, length: size }
            }
            true => Move::Swap { from: from.offset, to: to.offset, size },
            false => stored(from, to),
        };
    }
    if XYZ.contains(&to.name.as_str()) {
        return Move::Rounded { from: from.clone(), to: to.clone() };
    }
    Move::Exact { from: from.clone(), to: to.clone() }
}

/// The step of a dimension whose type was asked for, or that is a part where `is_part`: between
/// floating-point numbers from 0 to 1 and whole ones up to the most of their type. None where both
/// mean the same numbers anyway.
pub(super) fn asked_step(from: &Dimension, to: &Dimension, is_part: bool) -> Option<Move> {
    let is_plain = |d: &Dimension| d.scale == 1.0 && d.origin == 0.0 && d.bits.is_none();
    let most = |d: &Dimension| match d.scalar {
        Scalar::U8 => Some(f64::from(u8::MAX)),
        Scalar::U16 => Some(f64::from(u16::MAX)),
        Scalar::U32 => Some(f64::from(u32::MAX)),
        _ => None,
    };
    let as_part = |scale: f64| Move::Part { from: from.clone().scaled(scale, 0.0), to: to.clone() };
    if is_part && is_plain(from) && is_plain(to) {
        match (most(from), most(to)) {
            (None, Some(most)) if from.scalar.is_float() => return Some(as_part(most)),
            (Some(most), None) if to.scalar.is_float() => return Some(as_part(1.0 / most)),
            (Some(one), Some(other)) if one != other => return Some(as_part(other / one)),
            _ => {}
        }
    }
    // A whole number is not rounded: what its new type does not hold is refused.
    let is_whole = !from.scalar.is_float() && from.scale == 1.0 && from.origin == 0.0;
    let is_other = (from.scalar, from.scale) != (to.scalar, to.scale);
    let is_rounded = to.bits.is_none() && is_other && !is_whole;
    is_rounded.then(|| Move::Rounded { from: from.clone(), to: to.clone() })
}

/// True for plain numbers of single precision: others that are nearest to the same one are as good.
pub(super) fn is_single(from: &Dimension) -> bool {
    from.scalar == Scalar::F32 && from.scale == 1.0 && from.origin == 0.0
}

/// How far the world value `back` of the target is from the source's, where that is to be told.
pub(super) fn rounding(from: &Dimension, to: &Dimension, world: f64, back: f64) -> f64 {
    // What the arithmetic of scales and offsets rounds is not the point's place.
    let largest = world.abs().max(from.origin.abs()).max(to.origin.abs());
    let rounded = (back - world).abs();
    let same = is_single(from) && back as f32 == world as f32;
    if rounded > 4.0 * f64::EPSILON * largest && !same { rounded } else { 0.0 }
}

/// How far the target's value may be from the source's where the target must hold it: half a step
/// for scan angles, whose whole degrees are steps of 0.006° in newer point formats of LAS and none
/// of them exactly. They are the same whole degrees again when they come back.
pub(super) fn slack(from: &Dimension, to: &Dimension) -> f64 {
    let are_steps = !from.scalar.is_float() && !to.scalar.is_float();
    match to.name == SCAN_ANGLE && are_steps {
        true => from.scale.abs().min(to.scale.abs()) / 2.0,
        false => 0.0,
    }
}

fn stored(from: &Dimension, to: &Dimension) -> Move {
    let (from, to) = (from.clone(), to.clone());
    match to.bits {
        Some(bits) if to.scalar == Scalar::U8 && bits.shift + bits.width <= 8 && bits.width < 8 => {
            Move::Narrow { from, to, shift: bits.shift, mask: (1 << bits.width) - 1 }
        }
        _ => Move::Stored { from, to },
    }
}

/// Adds a step; bytes that follow those of the step before join it.
pub(super) fn push(moves: &mut Vec<Move>, step: Move) {
    if let Move::Copy { from, to, length } = step
        && let Some(Move::Copy { from: from_before, to: to_before, length: before }) =
            moves.last_mut()
        && *from_before + *before == from
        && *to_before + *before == to
    {
        *before += length;
        return;
    }
    moves.push(step);
}
