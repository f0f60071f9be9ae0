//! Coordinates that are stored as steps of a scale from an offset, in i32.

/// Offsets whose distance is this close to whole steps differ by whole steps: decimal offsets are
/// seldom exact in binary.
const WHOLE: f64 = 1e-6;

/// Steps that stored coordinates reach from the offset.
pub const REACH: f64 = i32::MAX as f64;

/// The steps of `scale` from one offset to another, if they are whole and stored coordinates, which
/// are i32, can move by them.
pub fn whole_steps(from: f64, to: f64, scale: f64) -> Option<i64> {
    if from == to {
        return Some(0);
    }
    let steps = (to - from) / scale;
    let whole = steps.round();
    let rounding = 4.0 * f64::EPSILON * (from.abs().max(to.abs()) / scale).abs();
    let near = (steps - whole).abs() <= WHOLE + rounding && whole.abs() < 2f64.powi(32);
    near.then_some(whole as i64)
}

/// True if steps of `scale` from `offset` reach all coordinates between these.
pub fn reaches([lo, hi]: [f64; 2], offset: f64, scale: f64) -> bool {
    (lo - offset).abs().max((hi - offset).abs()) / scale < REACH
}
