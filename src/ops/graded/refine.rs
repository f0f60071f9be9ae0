//! REFINE: where is what is removed farthest from the surface that the kept points say?
//!
//! A removed position asks its nearest kept ones. How far it is from the plane of the nearest five,
//! of the nearest eight and of the nearest twelve says how wrong whoever goes on with the kept
//! points would be there, whatever it is that they do. The positions that have the same nearest kept
//! point are a cell, and the worst cells of the scan each offer the position that would help most.
//! Neither normals nor a model of the noise are asked: a plane through noisy points is off by as
//! much everywhere, so the worst cells are those of shape.

use crate::Result;
use crate::geom::nearest::NearestAmong;
use crate::geom::planes::{NEAREST, PlaneErrors};
use crate::point::Position;
use crate::stage::{Found, Offer, RoundTile};

/// How a round refines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Refining {
    /// Every position that is looked at has a kept one within so many steps.
    pub radius: i64,
    /// An offer stands aside for a better one within this share of its distance to the nearest kept
    /// point.
    pub apart: f64,
}

/// Kept points within so many radii are asked.
pub(super) const ASKED_RADII: i64 = 4;
/// The part of the squared distance to the nearest kept point that is added to the squared error:
/// where nothing is wrong, the farthest is the worst.
const OF_DISTANCE: f64 = 1e-12;

/// What a removed position says.
#[derive(Clone, Copy)]
struct Asked {
    /// Index of the nearest kept point; none if it is kept itself or has none near.
    cell: u32,
    /// Squared distance to it.
    distance2: f64,
    /// Squared error.
    error2: f64,
}

/// No cell.
const NONE: u32 = u32::MAX;

/// The removed positions that have the same nearest kept point.
#[derive(Clone, Copy, Default)]
struct Cell {
    positions: u32,
    /// Sums of the squares of squared errors, and of squared distances.
    error4: f64,
    distance2: f64,
    /// The largest product of squared error and squared distance, and whose it is.
    best: f64,
    at: u32,
}

impl Refining {
    /// How far from a tile's cube positions decide about the cells of kept points in it.
    pub fn reach(self) -> i64 {
        self.radius
    }

    /// How far from it kept points do.
    pub fn kept_reach(self) -> i64 {
        self.radius.saturating_mul(1 + ASKED_RADII)
    }

    /// How far from it the cells are from which something is offered that matters in it.
    pub fn offer_reach(self) -> i64 {
        self.radius.saturating_mul(2)
    }

    /// Offers the worst position of each cell.
    pub fn refine(self, tile: &RoundTile<'_>, found: &mut Found) -> Result<()> {
        let mut cells = vec![Cell::default(); tile.kept.len()];
        // In Morton order, on which what the sums round to depends.
        for (i, asked) in self.asked(tile).into_iter().enumerate() {
            let Some(cell) = cells.get_mut(asked.cell as usize) else { continue };
            let error2 = asked.error2 + OF_DISTANCE * asked.distance2;
            cell.positions += 1;
            cell.error4 += error2 * error2;
            cell.distance2 += asked.distance2;
            if error2 * asked.distance2 > cell.best {
                cell.best = error2 * asked.distance2;
                cell.at = i as u32;
            }
        }
        let of_cube = cells.iter().zip(tile.kept).filter(|(_, p)| tile.cube.contains(**p));
        for (cell, kept) in of_cube.filter(|(cell, _)| cell.best > 0.0) {
            let count = f64::from(cell.positions);
            let score = cell.error4 / count * (cell.distance2 / count);
            let at = tile.positions[cell.at as usize];
            let apart = self.apart * squared(*kept, at).sqrt();
            found.offers.push(Offer { score, apart, at });
        }
        Ok(())
    }

    /// What each position says.
    fn asked(self, tile: &RoundTile<'_>) -> Vec<Asked> {
        let nothing = Asked { cell: NONE, distance2: 0.0, error2: 0.0 };
        let mut all = vec![nothing; tile.positions.len()];
        let radius2 = (self.radius as f64) * (self.radius as f64);
        let within2 = radius2 * (ASKED_RADII * ASKED_RADII) as f64;
        let mut errors = PlaneErrors::new(tile.simd);
        let mut nearest = NearestAmong::with(tile.simd);
        nearest.search(tile.kept, tile.positions, NEAREST, |i, found| {
            let Some(&first) = found.first() else { return };
            let p = tile.positions[i];
            let distance2 = squared(tile.kept[first as usize], p);
            if distance2 > 0.0 && distance2 <= radius2 {
                all[i] = Asked { cell: first, distance2, error2: 0.0 };
                let offsets = found.iter().map(|&j| offset(tile.kept[j as usize], p));
                let offsets = offsets.take_while(|o| squared_length(*o) <= within2);
                errors.push(i as u32, offsets, |i, error2| all[i as usize].error2 = error2);
            }
        });
        errors.flush(|i, error2| all[i as usize].error2 = error2);
        all
    }
}

/// From `q` to `p`: exact where they are less than 2^53 steps apart.
fn offset(p: Position, q: Position) -> [f64; 3] {
    std::array::from_fn(|axis| p[axis].saturating_sub(q[axis]) as f64)
}

fn squared(p: Position, q: Position) -> f64 {
    squared_length(offset(p, q))
}

fn squared_length([x, y, z]: [f64; 3]) -> f64 {
    x * x + y * y + z * z
}
