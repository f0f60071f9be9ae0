//! How far normals scatter where the scan is planar, and what that means for the reduction.

use super::Cells;
use super::division::{Division, Rule};
use super::limit::Limit;
use crate::Result;
use crate::geom::angle::{MaxAngle, is_known};
use crate::geom::plane::{Covariance, across, dot, smallest};
use crate::point::Position;
use crate::stage::Forecast;
use crate::tile::{Cells as Partition, Tile};

/// Positions that a sample has, at least, if its normals are to be judged.
const FEWEST: usize = 12;
/// Smallest variance over the middle one, up to which positions are planar: an eighth as thick as
/// wide. A gable whose sides rise by 1 in 4 or more is not; nor is vegetation.
const FLAT: f64 = 1.0 / 64.0;
/// Middle variance over the largest one, from which on positions are not a line.
const WIDE: f64 = 1.0 / 64.0;

/// What a sample says: the scatter of its normals in radians, NaN if it is not planar, then how many
/// of how many positions are expected to stay; 0 of 0 where a target decides about that.
pub(super) fn sample(cells: &Cells, tile: &mut Tile) -> Result<Vec<f64>> {
    let scatter = scatter(tile).unwrap_or(f64::NAN);
    let (kept, of) = if cells.keep.is_none() { divided(cells, tile)? } else { (0, 0) };
    Ok(vec![scatter, kept as f64, of as f64])
}

/// Divides the initial cells that lie in the sample as the stage would: how many records of how many
/// positions stay. Cells are anchored at the sample's corner, so that whole ones are in it.
fn divided(cells: &Cells, tile: &mut Tile) -> Result<(usize, usize)> {
    let limit = Limit { max_angle: MaxAngle::new(cells.max_angle()), ties: None };
    let rule = Rule { origin: tile.cube.lo, ..cells.rule(limit)? };
    let mut partition = Partition::default();
    let whole = |p: Position| initial_cell(&rule, tile.cube.hi, p);
    let mut placed: Vec<([i64; 3], u32)> = (tile.core.clone())
        .filter(|&i| tile.is_chosen(i))
        .filter_map(|i| Some((whole(tile.positions[i])?, i as u32)))
        .collect();
    let positions = placed.len();
    placed.retain(|&(_, i)| is_known(tile.normals[i as usize]));
    let without_normal = positions - placed.len();
    placed.sort_unstable();
    partition.members = placed.iter().map(|&(_, i)| i).collect();
    partition.turned = vec![false; placed.len()];
    let mut division = Division::new(rule, tile);
    let mut start = 0;
    for cell in placed.chunk_by(|a, b| a.0 == b.0) {
        division.run(start..start + cell.len(), &mut partition, |_, _| {});
        start += cell.len();
    }
    Ok((partition.ends.len() + without_normal, positions))
}

/// Which initial cell `p` is in; none if it is not all within a cube that ends with `last`, unless it
/// is larger than that.
fn initial_cell(rule: &Rule, last: Position, p: Position) -> Option<[i64; 3]> {
    let mut cell = [0; 3];
    for axis in 0..3 {
        cell[axis] = (p[axis].checked_sub(rule.origin[axis])?) / rule.side;
        let begin = rule.origin[axis].checked_add(cell[axis].checked_mul(rule.side)?)?;
        if cell[axis] > 0 && begin.checked_add(rule.side - 1)? > last[axis] {
            return None;
        }
    }
    Some(cell)
}

/// The root of the mean squared angle in radians between the normals of a sample and their linear
/// trend over it, which is what a curved surface has; none if its positions are not planar.
fn scatter(tile: &Tile) -> Option<f64> {
    let chosen = |i: &usize| tile.is_chosen(*i) && is_known(tile.normals[*i]);
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
        let normal = tile.normals[i].map(f64::from);
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

/// The median scatter of the planar samples, and a warning if it exceeds the largest angle.
pub(super) fn forecast(cells: &Cells, samples: &[Vec<f64>]) -> Forecast {
    let column = |at: usize| samples.iter().filter_map(move |s| s.get(at).copied());
    let mut scatters: Vec<f64> = column(0).filter(|s| s.is_finite()).collect();
    scatters.sort_unstable_by(f64::total_cmp);
    let Some(&scatter) = scatters.get(scatters.len().saturating_sub(1) / 2) else {
        return Forecast::default();
    };
    let rounded = (scatter * 1e4).round() / 1e4;
    let mut forecast =
        Forecast { decisions: vec![("normal_scatter".into(), rounded.into())], warning: None };
    // Samples are drawn by rank: each stands for as many records, however many positions it has.
    let shares = samples.iter().filter_map(|s| match s[..] {
        [_, kept, of] if of > 0.0 => Some(kept / of),
        _ => None,
    });
    let (sum, count) = shares.fold((0.0, 0u32), |(sum, count), share| (sum + share, count + 1));
    let max_angle = cells.max_angle();
    if cells.keep.is_none() && count > 0 && scatter > max_angle {
        let percent = (100.0 * sum / f64::from(count)).round();
        forecast.warning = Some(format!(
            "normals scatter {rounded:.2} rad, more than the largest angle of {max_angle}: expect about \
             {percent} % of the points to stay; raise `normals.neighbors` or `cells.max_angle`, \
             or say with `cells.keep` how many are to stay"
        ));
    }
    forecast
}
