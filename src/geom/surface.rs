//! How far positions are from the surface that kept points say.

use super::nearest::NearestAmong;
use super::planes::{SURFACE, surface_distance};
use super::simd::Simd;
use crate::point::{Position, distance2};

/// Kept points that are asked first. Whether others are as near as the last of those whose plane is
/// the surface is known by one more than these; where some are, more are asked.
const ASKED: usize = SURFACE + 1;

/// Kept points farther from a position than so many times as far as any is from its nearest one are
/// not asked.
pub const ASKED_RADII: i64 = 4;

/// What a position is told by the surface.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceTold {
    /// Index of the nearest kept point.
    pub nearest: u32,
    /// Squared distance to it in steps.
    pub distance2: u128,
    /// Distance to the surface in steps: 0 of a kept point.
    pub off: f64,
}

/// Calls `visit` for each of the positions `at` that has a kept point of `surface` within `within`
/// steps, which nobody is asked beyond. Both are in Morton order.
pub fn ask_surface(
    simd: Simd,
    surface: &[Position],
    at: &[Position],
    within: i64,
    mut visit: impl FnMut(usize, SurfaceTold),
) {
    let within2 = (within.unsigned_abs() as u128).pow(2);
    let mut nearest = NearestAmong::with(simd);
    let mut asking: Option<Vec<u32>> = None;
    let mut asked = ASKED;
    loop {
        let some: Option<Vec<Position>> =
            asking.as_ref().map(|asking| asking.iter().map(|&i| at[i as usize]).collect());
        let positions = some.as_deref().unwrap_or(at);
        let mut tied = Vec::new();
        nearest.search(surface, positions, asked, |n, found| {
            let far = |j: u32| distance2(surface[j as usize], positions[n]);
            let i = asking.as_ref().map_or(n, |asking| asking[n] as usize);
            let Some(&nearest) = found.first().filter(|j| far(**j) <= within2) else { return };
            let distance2 = far(nearest);
            let is_tied = found.len() == asked && far(found[asked - 1]) == far(found[SURFACE - 1]);
            if distance2 > 0 && is_tied && asked < surface.len() {
                tied.push(i as u32);
                return;
            }
            let off = match distance2 {
                0 => 0.0,
                _ => {
                    let near = found.partition_point(|&j| far(j) <= within2);
                    surface_distance(positions[n], &found[..near], surface)
                }
            };
            visit(i, SurfaceTold { nearest, distance2, off });
        });
        if tied.is_empty() {
            return;
        }
        tied.sort_unstable();
        (asking, asked) = (Some(tied), 4 * asked);
    }
}
