//! How far normals scatter where the scan is planar, and what that means for the reduction.

use super::auto::{self, LADDER, Sampled};
use super::division::{Division, DivisionRule};
use super::keys::Cells;
use super::limit::Limit;
use super::target::Keep;
use crate::Result;
use crate::geom::angle::{MaxAngle, is_known};
use crate::ops::scatter::{scatter, typical};
use crate::point::Position;
use crate::quantity::{Angle, Setting};
use crate::report::Grouped;
use crate::stage::Forecast;
use crate::tile::{Partition, Tile};

/// `min_spacing` of what samples are divided into, as a share of the side.
const QUARTER: i64 = 4;

/// What a sample says: the scatter of its normals in radians, NaN if it is not planar; how many of
/// how many positions are expected to stay, 0 of 0 where a target or the scatter decides about
/// that; how many of how many positions the stage decides about; and where the target is left to
/// the scan, how many are expected to stay at each angle of [`LADDER`].
pub(super) fn sample(cells: &Cells, tile: &mut Tile) -> Result<Vec<f64>> {
    let scatter = scatter(tile).unwrap_or(f64::NAN);
    let is_given = cells.keep.is_none() && !cells.max_angle.is_some_and(Setting::is_auto);
    let given = cells.rule(limit(cells.max_angle()))?;
    let (kept, mut of) = if is_given { divided(given, tile) } else { (0, 0) };
    let mut steps = Vec::new();
    if cells.keep == Some(Keep::Auto) {
        for angle in LADDER {
            let min_spacing = given.min_spacing.max((given.side / QUARTER).unsigned_abs());
            let rule = DivisionRule { limit: limit(angle), min_spacing, ..given };
            let (kept, positions) = divided(rule, tile);
            steps.push(kept as f64);
            of = positions;
        }
    }
    let decided = tile.core.clone().filter(|&i| tile.is_chosen(i)).count();
    let counts = [kept, of, decided, tile.core.len()].map(|n| n as f64);
    Ok([&[scatter], &counts[..], &steps].concat())
}

fn limit(angle: f64) -> Limit {
    Limit { max_angle: MaxAngle::new(angle), ties: None }
}

/// Divides the initial cells that lie in the sample as the stage would: how many records of how
/// many positions stay. Cells are anchored at the sample's corner, so that whole ones are in it.
fn divided(rule: DivisionRule, tile: &mut Tile) -> (usize, usize) {
    let rule = DivisionRule { origin: tile.cube.lo, ..rule };
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
    (partition.ends.len() + without_normal, positions)
}

/// Which initial cell `p` is in; none if it is not all within a cube that ends with `last`, unless
/// it is larger than that.
fn initial_cell(rule: &DivisionRule, last: Position, p: Position) -> Option<[i64; 3]> {
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

/// Settles what is "auto" by the samples, and says what they tell: the median scatter of the planar
/// ones, with a warning if it exceeds the largest angle that was given; and a number of points that
/// looks like a share.
pub(super) fn forecast(cells: &mut Cells, samples: &[Vec<f64>]) -> Forecast {
    let column = |at: usize| samples.iter().filter_map(move |s| s.get(at).copied());
    let scatter = typical(column(0));
    let (decided, seen) = (column(3).sum::<f64>(), column(4).sum::<f64>());
    let chosen = if seen > 0.0 { decided / seen } else { 1.0 };
    let sampled = Sampled { scatter, chosen, shares: shares(samples) };
    let chosen = auto::choose(cells, &sampled);
    let decisions = scatter.map(|scatter| ("normal_scatter".into(), scatter.into()));
    let warning = few_asked_for(cells).or_else(|| noisy(cells, samples, scatter?));
    Forecast { decisions: decisions.into_iter().collect(), chosen, warning }
}

/// The share that stays at each angle of [`LADDER`]. Samples are drawn by rank: each stands for as
/// many records, however many positions it has.
fn shares(samples: &[Vec<f64>]) -> Option<[f64; LADDER.len()]> {
    let each = samples.iter().filter_map(|sample| match sample[..] {
        [_, _, of, _, _, ref steps @ ..] if of > 0.0 && steps.len() == LADDER.len() => {
            Some((of, steps))
        }
        _ => None,
    });
    let (mut sums, mut count) = ([0.0; LADDER.len()], 0.0);
    for (of, steps) in each {
        sums.iter_mut().zip(steps).for_each(|(sum, kept)| *sum += kept / of);
        count += 1.0;
    }
    (count > 0.0).then(|| sums.map(|sum| sum / count))
}

/// Warns of a `keep` that is a handful of a large scan: a percent sign may have been forgotten.
fn few_asked_for(cells: &Cells) -> Option<String> {
    let records = cells.outlook.as_ref()?.records();
    let Some(Keep::Records(count @ ..=100)) = cells.keep else { return None };
    (records > 100 * count).then(|| {
        format!(
            "`cells.keep = {count}` leaves {count} of {} points; for that share of them give \
             `cells.keep = \"{count}%\"`",
            Grouped(records)
        )
    })
}

/// Warns of a largest angle that noise exceeds.
fn noisy(cells: &Cells, samples: &[Vec<f64>], scatter: f64) -> Option<String> {
    let Some(Setting::Given(given)) = cells.angle() else {
        return None;
    };
    // Samples are drawn by rank: each stands for as many records, however many positions it has.
    let shares = samples.iter().filter_map(|s| match s[..] {
        [_, kept, of, ..] if of > 0.0 => Some(kept / of),
        _ => None,
    });
    let (sum, count) = shares.fold((0.0, 0u32), |(sum, count), share| (sum + share, count + 1));
    if count == 0 || scatter <= given.in_radians() {
        return None;
    }
    let percent = (100.0 * sum / f64::from(count)).round();
    Some(format!(
        "normals scatter {}, more than the largest angle of a cell, {}: expect about {percent} % \
         of the points to stay; raise `normals.neighbors` or `cells.max_angle`, or give \
         `cells.keep`",
        Angle::told_like(scatter, given),
        given.told(),
    ))
}
