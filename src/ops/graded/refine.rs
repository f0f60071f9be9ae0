//! REFINE: where is what is removed farthest from the surface that the kept points say?
//!
//! A removed position asks its nearest kept ones. How far it is from the plane of the nearest five,
//! of the nearest eight and of the nearest twelve says how wrong whoever goes on with the kept
//! points would be there, whatever it is that they do. The positions that have the same nearest
//! kept point are a cell, and the worst cells of the scan each offer the position that would help
//! most. Neither normals nor a model of the noise are asked: a plane through noisy points is off by
//! as much everywhere, so the worst cells are those of shape; and of a cell no position counts more
//! for being much farther off than the others, as those of the most noise are.

use std::collections::HashSet;

use crate::geom::hash::PlaceHashes;
use crate::geom::nearest::NearestAmong;
use crate::geom::planes::{NEAREST, PlaneErrors};
use crate::geom::surface::ASKED_RADII;
use crate::point::Position;
use crate::stage::{Offer, RoundFound, RoundTile};

/// How a round refines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Refining {
    /// Every position that is looked at has a kept one within so many steps.
    pub radius: i64,
    /// An offer stands aside for a better one within this share of its distance to the nearest kept
    /// point.
    pub apart: f64,
    /// True if a position that lies beyond all kept points around it counts as off the surface.
    pub borders: bool,
    /// A cell whose score was lower is not looked at again where something changed.
    pub floor: f64,
}

/// How a round measures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measuring {
    /// As a round would refine.
    pub refining: Refining,
    /// Lattice steps that count as one.
    pub unit: f64,
}

/// An error counts as no more units.
const MOST_UNITS: f64 = (1u64 << 32) as f64;

impl Measuring {
    /// Counts the errors of the positions in the tile's cube, in whole units.
    pub fn measure(self, tile: &RoundTile<'_>, found: &mut RoundFound) {
        let asked = self.refining.asked(tile, tile.positions).into_iter().zip(tile.positions);
        let own = asked.filter(|(asked, p)| asked.cell != NONE && tile.cube.contains(**p));
        let units = |asked: AskedPosition| (asked.error2.sqrt() / self.unit).min(MOST_UNITS);
        found.counted += own.map(|(asked, _)| units(asked).round() as u64).sum::<u64>();
    }
}

/// The part of the squared distance to the nearest kept point that is added to the squared error:
/// where nothing is wrong, the farthest is the worst.
const OF_DISTANCE: f64 = 1e-12;

/// What a removed position says.
#[derive(Clone, Copy)]
struct AskedPosition {
    /// Index of the nearest kept point; none if it is kept itself or has none near.
    cell: u32,
    /// Squared distance to it.
    distance2: f64,
    /// Squared distance within which a further kept point would change what it says.
    asked2: f64,
    /// Squared error.
    error2: f64,
}

/// The part of the squared distance by which a position lies beyond all kept points around it that
/// is added to the squared error: at a border a distance along the surface counts a fourth.
const OF_BORDER: f64 = 1.0 / 16.0;

/// Where a cell chooses, a squared error counts no more than so many times the mean of those of the
/// cell. What is farther off than all around it is of noise rather than of shape: kept, it would
/// bend the planes of its neighbours. Where noise is normal, one position in twelve is such. Of
/// 2, 3, 4, 8 and no bound, 3 is best or next to it on seven scenes.
const MOST_OF_MEAN: f64 = 3.0;

/// No cell.
const NONE: u32 = u32::MAX;

/// The removed positions that have the same nearest kept point.
#[derive(Clone, Copy, Default)]
struct Cell {
    positions: u32,
    /// The largest product of what counts of a squared error and squared distance, and whose it is.
    at: u32,
    best: f64,
    /// Sums of squared errors, of their squares with weights, and of squared distances.
    error2: f64,
    error4: f64,
    distance2: f64,
    /// How far from the kept point another one changes anything.
    reach: f64,
}

impl Cell {
    /// The cells of so many kept points, by what positions say and weigh.
    fn all(asked: &[AskedPosition], weights: &[f64], kept: usize) -> Vec<Cell> {
        let mut cells = vec![Cell::default(); kept];
        let weighed = |i: usize, error2: f64| {
            let weight = weights.get(i).copied().unwrap_or(1.0);
            weight * error2 + OF_DISTANCE * asked[i].distance2
        };
        // In Morton order, on which what the sums round to depends.
        for (i, asked) in asked.iter().enumerate() {
            let Some(cell) = cells.get_mut(asked.cell as usize) else { continue };
            let error2 = weighed(i, asked.error2);
            cell.positions += 1;
            cell.error2 += asked.error2;
            cell.error4 += error2 * error2;
            cell.distance2 += asked.distance2;
            let reach = asked.distance2.sqrt() + asked.asked2.sqrt();
            cell.reach = f64::max(cell.reach, reach * ROUNDED_UP);
        }
        for (i, asked) in asked.iter().enumerate() {
            let Some(cell) = cells.get_mut(asked.cell as usize) else { continue };
            let most = MOST_OF_MEAN * cell.error2 / f64::from(cell.positions);
            let counts = weighed(i, asked.error2.min(most)) * asked.distance2;
            if counts > cell.best {
                cell.best = counts;
                cell.at = i as u32;
            }
        }
        cells
    }
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
    pub fn refine(self, tile: &RoundTile<'_>, found: &mut RoundFound) {
        let unchanged = Unchanged::of(tile, self.floor);
        let touched: (Vec<Position>, Vec<f64>);
        let (positions, weights) = match &unchanged {
            None => (tile.positions, tile.weights),
            Some(unchanged) => {
                touched = self.touched(tile, unchanged);
                (&touched.0[..], &touched.1[..])
            }
        };
        let asked = self.asked(tile, positions);
        let cells = Cell::all(&asked, weights, tile.kept.len());
        for (i, &of) in tile.kept.iter().enumerate().filter(|(_, p)| tile.cube.contains(**p)) {
            let same = unchanged.as_ref().and_then(|unchanged| unchanged.offers[i]);
            let mut offer = same.unwrap_or_else(|| Refining::offer(&cells[i], of, positions));
            offer.apart = self.apart * squared(of, offer.at).sqrt();
            found.offers.push(offer);
        }
    }

    /// What a cell offers.
    fn offer(cell: &Cell, of: Position, positions: &[Position]) -> Offer {
        if cell.best <= 0.0 {
            return Offer { score: 0.0, apart: 0.0, at: of, of, reach: cell.reach };
        }
        let count = f64::from(cell.positions);
        let score = cell.error4 / count * (cell.distance2 / count);
        let at = positions[cell.at as usize];
        Offer { score, apart: 0.0, at, of, reach: cell.reach }
    }

    /// The positions in all octree nodes that a cell which changed may reach into, and what they
    /// weigh.
    fn touched(self, tile: &RoundTile<'_>, unchanged: &Unchanged) -> (Vec<Position>, Vec<f64>) {
        let level = self.radius.unsigned_abs().next_power_of_two().ilog2();
        let place = |p: &Position| p.map(|v| v >> level);
        let mut nodes: HashSet<[i64; 3], PlaceHashes> = HashSet::default();
        let each = tile.kept.iter().zip(&unchanged.offers);
        let changed = each.filter(|(p, offer)| offer.is_none() && tile.cube.contains(**p));
        for (p, _) in changed {
            let [lo, hi] =
                [-self.radius, self.radius].map(|by| p.map(|v| v.saturating_add(by) >> level));
            for x in lo[0]..=hi[0] {
                for y in lo[1]..=hi[1] {
                    nodes.extend((lo[2]..=hi[2]).map(|z| [x, y, z]));
                }
            }
        }
        let (mut touched, mut weights, mut end) = (Vec::new(), Vec::new(), 0);
        for stretch in tile.positions.chunk_by(|a, b| place(a) == place(b)) {
            let begin = end;
            end += stretch.len();
            if nodes.contains(&place(&stretch[0])) {
                touched.extend_from_slice(stretch);
                weights.extend_from_slice(tile.weights.get(begin..end).unwrap_or(&[]));
            }
        }
        (touched, weights)
    }

    /// What each position says.
    fn asked(self, tile: &RoundTile<'_>, positions: &[Position]) -> Vec<AskedPosition> {
        let nothing = AskedPosition { cell: NONE, distance2: 0.0, asked2: 0.0, error2: 0.0 };
        let mut all = vec![nothing; positions.len()];
        let radius2 = (self.radius as f64) * (self.radius as f64);
        let within2 = radius2 * (ASKED_RADII * ASKED_RADII) as f64;
        let mut errors = PlaneErrors::new(tile.simd);
        let mut beyond2 = vec![0.0; if self.borders { positions.len() } else { 0 }];
        let mut nearest = NearestAmong::with(tile.simd);
        nearest.search(tile.kept, positions, NEAREST, |i, found| {
            let Some(&first) = found.first() else { return };
            let p = positions[i];
            let distance2 = squared(tile.kept[first as usize], p);
            if distance2 > 0.0 && distance2 <= radius2 {
                let last = found.get(NEAREST - 1).map(|&j| squared(tile.kept[j as usize], p));
                let asked2 = last.map_or(within2, |last| last.min(within2));
                all[i] = AskedPosition { cell: first, distance2, asked2, error2: 0.0 };
                let offsets = found.iter().map(|&j| offset(tile.kept[j as usize], p));
                let offsets = offsets.take_while(|o| squared_length(*o) <= within2);
                if self.borders {
                    beyond2[i] = OF_BORDER * squared_beyond(offsets.clone());
                }
                errors.push(i as u32, offsets, |i, error2| all[i as usize].error2 = error2);
            }
        });
        errors.flush(|i, error2| all[i as usize].error2 = error2);
        all.iter_mut().zip(beyond2).for_each(|(asked, beyond2)| asked.error2 += beyond2);
        all
    }
}

/// Roots and their sum round by less.
const ROUNDED_UP: f64 = 1.0 + 1e-12;

/// Kept points around which nothing changed since the round before: none was kept near them. What
/// they offer is what they offered then. Most are such, as a round keeps few, and those where the
/// scan is worst. What changed where little was wrong before is not looked at either: points that
/// are added make little worse.
struct Unchanged {
    /// Of each kept point of the tile, what it offers; none where that changed, or is not known.
    offers: Vec<Option<Offer>>,
}

impl Unchanged {
    /// Those of a tile, if the round before left something that can be used.
    fn of(tile: &RoundTile<'_>, floor: f64) -> Option<Unchanged> {
        let before = tile.before?;
        let is_new = |i: &usize| tile.kept_in[*i] == before.number;
        let new: Vec<Position> =
            (0..tile.kept.len()).filter(is_new).map(|i| tile.kept[i]).collect();
        let mut offers = vec![None; tile.kept.len()];
        let mut last = before.offers.iter().peekable();
        for (offer, p) in offers.iter_mut().zip(tile.kept) {
            // Both are in Morton order.
            *offer = last.next_if(|offer| offer.of == *p).copied();
        }
        let mut nearest = NearestAmong::with(tile.simd);
        nearest.search(&new, tile.kept, 1, |i, found| {
            let Some(offer) = offers[i] else { return };
            let near = |j: &u32| squared(new[*j as usize], tile.kept[i]).sqrt() <= offer.reach;
            // What changed before and was not looked at is still to be looked at.
            if offer.reach == f64::INFINITY || found.first().is_some_and(near) {
                let low = offer.score < floor;
                offers[i] = low.then_some(Offer { reach: f64::INFINITY, ..offer });
            }
        });
        Some(Unchanged { offers })
    }
}

/// How far a position lies beyond all kept points around it, squared, of which these are the
/// offsets: in the direction from their mean to it, the distance that is left to the last of them;
/// 0 where they lie on all sides.
fn squared_beyond(offsets: impl Iterator<Item = [f64; 3]> + Clone) -> f64 {
    let mut sum = [0.0; 3];
    for offset in offsets.clone() {
        (0..3).for_each(|axis| sum[axis] -= offset[axis]);
    }
    let length2 = squared_length(sum);
    let along = |[x, y, z]: [f64; 3]| -(x * sum[0] + y * sum[1] + z * sum[2]);
    let last = offsets.map(along).fold(f64::INFINITY, f64::min);
    match last > 0.0 && last.is_finite() && length2 > 0.0 {
        true => last * last / length2,
        false => 0.0,
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
