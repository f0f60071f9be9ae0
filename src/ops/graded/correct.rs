//! Rounds towards a tolerance: where is what is removed farther from the surface than it may be?

use crate::geom::surface::{ASKED_RADII, ask_surface};
use crate::point::Position;
use crate::stage::{Offer, RoundFound, RoundTile};

/// How a round corrects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Correcting {
    /// Every position has a kept one within so many steps.
    pub radius: i64,
    /// No position may be farther from the surface, in steps.
    pub tolerance: f64,
    /// An offer stands aside for a better one within this share of its distance to the nearest kept
    /// point.
    pub apart: f64,
}

/// The removed positions of a kept point that are too far off.
#[derive(Clone, Copy, Default)]
struct Wrong {
    /// The largest error.
    most: f64,
    /// The largest product of error and distance, whose it is, and that distance.
    best: f64,
    at: u32,
    distance: f64,
}

impl Correcting {
    /// Offers of each cell the position that is too far off and would help most; counts those of
    /// the cube that are too far off.
    pub fn correct(self, tile: &RoundTile<'_>, found: &mut RoundFound) {
        let mut cells = vec![Wrong::default(); tile.kept.len()];
        let radius2 = u128::from(self.radius.unsigned_abs()).pow(2);
        let within = self.radius.saturating_mul(ASKED_RADII);
        let mut wrong: Vec<(u32, u32, f64, f64)> = Vec::new();
        ask_surface(tile.simd, tile.kept, tile.positions, within, |i, told| {
            if told.distance2 <= radius2 && is_beyond(told.off, self.tolerance) {
                wrong.push((i as u32, told.nearest, told.off, (told.distance2 as f64).sqrt()));
            }
        });
        // In Morton order, so that of equal ones the first is offered.
        wrong.sort_unstable_by_key(|(i, ..)| *i);
        for (i, cell, off, distance) in wrong {
            let position: Position = tile.positions[i as usize];
            found.counted += u64::from(tile.cube.contains(position));
            let cell = &mut cells[cell as usize];
            cell.most = cell.most.max(off);
            if off * distance > cell.best {
                (cell.best, cell.at, cell.distance) = (off * distance, i, distance);
            }
        }
        let of_cube = cells.iter().zip(tile.kept).filter(|(_, p)| tile.cube.contains(**p));
        found.offers.extend(of_cube.map(|(cell, &of)| match cell.best > 0.0 {
            true => Offer {
                score: cell.most,
                apart: self.apart * cell.distance,
                at: tile.positions[cell.at as usize],
                of,
                reach: f64::MAX,
            },
            false => Offer { score: 0.0, apart: 0.0, at: of, of, reach: f64::MAX },
        }));
    }
}

/// True if a distance is beyond the tolerance, or so little below that another order of sums might
/// say so.
pub(super) fn is_beyond(off: f64, tolerance: f64) -> bool {
    off > tolerance * (1.0 - 1.0 / (1u32 << 20) as f64)
}
