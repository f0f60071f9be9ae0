//! What becomes of each position, and how far what is removed is from the surface of what stays.

use super::super::removal::{keep_once, remove};
use super::refine::ASKED_RADII;
use crate::Result;
use crate::geom::nearest::NearestAmong;
use crate::geom::planes::surface_distance;
use crate::point::distance2;
use crate::report::Tally;
use crate::store::{KeptPoints, KeptReader};
use crate::tile::{Fate, Tile};

/// Kept points that are asked: there is room for some that are as near as the last of those whose
/// plane is the surface.
const ROOM: usize = 24;

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
    let mut nearest = NearestAmong::with(tile.simd());
    let within2 = (within as u128) * (within as u128);
    let positions = &tile.positions[core.clone()];
    nearest.search(surface, positions, ROOM, |i, found| {
        let near = |j: &u32| distance2(surface[*j as usize], positions[i]) <= within2;
        let found = &found[..found.partition_point(near)];
        let Some(&first) = found.first() else { return };
        if surface[first as usize] == positions[i] {
            is_kept[i] = true;
        } else {
            deviations[i] = surface_distance(positions[i], found, surface);
        }
    });
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
