//! Coordinates that are stored as steps of a scale from an offset, in i32.

/// Offsets whose distance is this close to whole steps differ by whole steps: decimal offsets are
/// seldom exact in binary.
const WHOLE: f64 = 1e-6;

/// Steps that stored coordinates reach from the offset.
const REACH: f64 = i32::MAX as f64;

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

/// An offset from which steps of `scale` reach all coordinates between these: 0 where that is one,
/// else one of few digits near their middle, so that those of coordinates stay readable.
pub fn readable_offset(place: [f64; 2], scale: f64) -> Option<f64> {
    let middle = f64::midpoint(place[0], place[1]);
    let units = [1e6, 1e3, 1.0].into_iter().filter(|unit| *unit <= scale * REACH / 4.0);
    let near = units.chain([scale]).map(|unit| (middle / unit).round() * unit);
    [0.0].into_iter().chain(near).find(|offset| reaches(place, *offset, scale))
}
