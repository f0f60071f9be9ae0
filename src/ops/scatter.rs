//! How far normals scatter where the scan is planar: what tells noise from shape.

use crate::geom::angle::is_known;
use crate::geom::plane::{Covariance, across, dot, smallest};
use crate::point::NORMAL;
use crate::tile::Tile;

/// Scatter in radians up to which there is no noise: normals disagree at edges alone.
pub(super) const SMOOTH: f64 = 0.01;
/// Positions that a sample has, at least, if its normals are to be judged.
const FEWEST: usize = 12;
/// Smallest variance over the middle one, up to which positions are planar: an eighth as thick as
/// wide. A gable whose sides rise by 1 in 4 or more is not; nor is vegetation.
const FLAT: f64 = 1.0 / 64.0;
/// Middle variance over the largest one, from which on positions are not a line.
const WIDE: f64 = 1.0 / 64.0;

/// The root of the mean squared angle in radians between the normals of a sample and their linear
/// trend over it, which is what a curved surface has; none if its positions are not planar.
pub(super) fn scatter(tile: &Tile) -> Option<f64> {
    let normals = tile.columns.find(&NORMAL)?;
    let chosen = |i: &usize| tile.is_chosen(*i) && is_known(normals[*i]);
    let members: Vec<usize> = tile.core.clone().filter(chosen).collect();
    let first = tile.positions[*members.first()?];
    if members.len() < FEWEST {
        return None;
    }
    let from_first = |i: usize| -> [i64; 3] {
        std::array::from_fn(|axis| tile.positions[i][axis].saturating_sub(first[axis]))
    };
    let offsets: Vec<[i64; 3]> = members.iter().map(|&i| from_first(i)).collect();
    let matrix = Covariance::of(&offsets[1..]).matrix();
    let (least, up) = smallest(matrix);
    let most = -smallest(matrix.map(|v| -v)).0;
    let middle = matrix[0] + matrix[3] + matrix[5] - least - most;
    if !(least <= FLAT * middle && middle >= WIDE * most && middle > 0.0) {
        return None;
    }
    let (u, v) = across(up);
    let placed = members.iter().zip(&offsets).map(|(&i, offset)| {
        let offset = offset.map(|steps| steps as f64);
        let normal = normals[i].map(f64::from);
        let sign = if dot(up, normal) < 0.0 { -1.0 } else { 1.0 };
        let tilt = [sign * dot(u, normal), sign * dot(v, normal)];
        ([dot(u, offset), dot(v, offset)], tilt)
    });
    let placed: Vec<_> = placed.collect();
    let squares = residual(&placed, 0) + residual(&placed, 1);
    let freedom = (members.len() - 3) as f64;
    Some((squares / freedom).sqrt())
}

/// Σ of the squared differences between component `of` of the tilts and its best linear function of
/// the place.
fn residual(placed: &[([f64; 2], [f64; 2])], of: usize) -> f64 {
    type Value<'a> = dyn Fn(&([f64; 2], [f64; 2])) -> f64 + 'a;
    let count = placed.len() as f64;
    let mean = |value: &Value<'_>| placed.iter().map(value).sum::<f64>() / count;
    let (x, y, t) = (mean(&|p| p.0[0]), mean(&|p| p.0[1]), mean(&|p| p.1[of]));
    let sum = |product: &dyn Fn(f64, f64, f64) -> f64| {
        placed.iter().map(|p| product(p.0[0] - x, p.0[1] - y, p.1[of] - t)).sum::<f64>()
    };
    let (xx, xy, yy) = (sum(&|x, _, _| x * x), sum(&|x, y, _| x * y), sum(&|_, y, _| y * y));
    let (xt, yt, tt) = (sum(&|x, _, t| x * t), sum(&|_, y, t| y * t), sum(&|_, _, t| t * t));
    let determinant = xx * yy - xy * xy;
    let explained = (yy * xt * xt - 2.0 * xy * xt * yt + xx * yt * yt) / determinant;
    // Not finite where the places are on a line, which planar ones are not.
    if explained.is_finite() { (tt - explained).max(0.0) } else { tt }
}

/// The median of the scatters that samples found, rounded to a ten-thousandth of a radian; none if
/// none of them was planar.
pub(super) fn typical(scatters: impl Iterator<Item = f64>) -> Option<f64> {
    let mut scatters: Vec<f64> = scatters.filter(|s| s.is_finite()).collect();
    scatters.sort_unstable_by(f64::total_cmp);
    let median = scatters.get(scatters.len().saturating_sub(1) / 2)?;
    Some((median * 1e4).round() / 1e4)
}
