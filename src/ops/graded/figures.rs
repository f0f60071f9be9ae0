//! What becomes of each position, and how far what is removed is from the surface of what stays.

use super::super::removal::{keep_once, remove};
use super::refine::ASKED_RADII;
use crate::Result;
use crate::geom::nearest::NearestAmong;
use crate::geom::planes::{SURFACE, surface_distance};
use crate::point::{Position, distance2};
use crate::report::Tally;
use crate::store::{KeptPoints, KeptReader};
use crate::tile::{Fate, Tile};

/// Kept points that are asked first. Whether others are as near as the last of those whose plane is
/// the surface is known by one more than these; where some are, more are asked.
const ASKED: usize = SURFACE + 1;

/// Keeps what is in `kept`, and removes what else is decided about with its distance to the plane
/// of the nearest kept points.
pub(super) fn measure(
    tile: &mut Tile,
    kept: &KeptPoints,
    radius: i64,
    tally: &mut Tally,
) -> Result<()> {
    let mut reader = KeptReader::default();
    let within = radius.saturating_mul(ASKED_RADII);
    kept.near(&tile.cube.grown(within), &mut reader)?;
    let surface = &reader.positions;
    let core = tile.core.clone();
    let mut deviations = vec![f64::NAN; core.len()];
    let mut is_kept = vec![false; core.len()];
    let within2 = (within as u128) * (within as u128);
    let mut nearest = NearestAmong::with(tile.simd());
    let mut asking: Vec<u32> = (core.start as u32..core.end as u32).collect();
    let mut asked = ASKED;
    while !asking.is_empty() {
        let at: Vec<Position> = asking.iter().map(|&i| tile.positions[i as usize]).collect();
        let mut tied = Vec::new();
        nearest.search(surface, &at, asked, |n, found| {
            let far = |j: u32| distance2(surface[j as usize], at[n]);
            let i = asking[n] as usize - core.start;
            let Some(first) = found.first().map(|&j| far(j)) else { return };
            is_kept[i] = first == 0;
            let is_tied = found.len() == asked && far(found[asked - 1]) == far(found[SURFACE - 1]);
            if first > 0 && is_tied && asked < surface.len() {
                tied.push(asking[n]);
            } else if (1..=within2).contains(&first) {
                let near = &found[..found.partition_point(|&j| far(j) <= within2)];
                deviations[i] = surface_distance(at[n], near, surface);
            }
        });
        tied.sort_unstable();
        (asking, asked) = (tied, 4 * asked);
    }
    let (mut coincident, mut represented) = (0, 0);
    for (n, i) in core.enumerate() {
        if !tile.is_chosen(i) {
            continue;
        }
        if is_kept[n] {
            coincident += keep_once(tile, i);
            continue;
        }
        represented += remove(tile, i);
        if tile.fates[i] == Fate::Removed && !deviations[n].is_nan() {
            tile.fates[i] = Fate::Represented { deviation: deviations[n] as f32 };
        }
    }
    tally.remove("graded", "coincident", coincident);
    tally.remove("graded", "represented", represented);
    Ok(())
}
