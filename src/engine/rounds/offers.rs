//! What the tiles of a round offer: the best of the whole scan, and which of those are too near to
//! a better one.
//!
//! How good the last one is that is kept is found by counting digits of scores, so that the offers
//! of a large scan need not be in memory. That an offer stands aside for a better one is decided
//! tile by tile, from those of the tiles around: whether the better one stands aside itself plays
//! no part, or chains of them would lead across any rim.

use std::collections::HashMap;
use std::sync::Arc;

use super::merged::MergedPoints;
use crate::Result;
use crate::engine::job::Job;
use crate::geom::hash::PlaceHashes;
use crate::geom::select::nth_largest;
use crate::point::{Position, distance2};
use crate::stage::Offer;
use crate::store::{
    Block, KeptPoints, KeptReader, Spill, SpillArea, StoredStretch, TileKey, morton_cmp,
};

/// Offers as the tiles of a round left them: in Morton order of the cells that they are from.
pub(super) struct Offers {
    spill: Spill,
    tiles: Vec<StoredStretch>,
}

/// Offers of a tile, and what reading them needs.
#[derive(Default)]
pub(super) struct OfferReader {
    pub offers: Vec<Offer>,
    bytes: Vec<u8>,
}

/// Which offers are the best.
pub(super) struct BestOffers {
    offers: Offers,
    /// The bits of the lowest score among them.
    least: u64,
    /// Of those that have it, the first so many of each tile.
    ties: Vec<u64>,
}

impl Offers {
    pub fn new(area: &Arc<SpillArea>) -> Offers {
        Offers { spill: Spill::new(area, "offers"), tiles: Vec::new() }
    }

    /// Stores those of a tile; from several threads at once.
    pub fn store(&self, offers: &[Offer]) -> Result<StoredStretch> {
        self.spill.store(bytemuck::cast_slice(offers))
    }

    /// Enters what the tiles stored, in their order.
    pub fn enter(&mut self, tiles: Vec<StoredStretch>) {
        self.tiles = tiles;
    }

    /// Replaces what is in `into` by the offers of a tile.
    pub fn load(&self, tile: usize, into: &mut OfferReader) -> Result<()> {
        into.offers.clear();
        let OfferReader { offers, bytes } = into;
        self.of_tile(tile, bytes, |offer| offers.push(offer))
    }

    /// Calls `visit` for the offers of a tile.
    fn of_tile(
        &self,
        tile: usize,
        bytes: &mut Vec<u8>,
        mut visit: impl FnMut(Offer),
    ) -> Result<()> {
        self.spill.load(&self.tiles[tile], bytes)?;
        bytes
            .chunks_exact(size_of::<Offer>())
            .map(bytemuck::pod_read_unaligned)
            .for_each(&mut visit);
        Ok(())
    }

    /// The `want` best: by score, of equal ones in Morton order of their cells.
    pub fn best(self, want: u64) -> Result<BestOffers> {
        let mut bytes = Vec::new();
        let (least, mut left) = nth_largest(want, |visit| {
            let mut tiles = 0..self.tiles.len();
            tiles.try_for_each(|n| {
                self.of_tile(n, &mut bytes, |offer| {
                    if offer.is_open() {
                        visit(offer.score.to_bits());
                    }
                })
            })
        })?;
        let mut ties = Vec::with_capacity(self.tiles.len());
        for tile in 0..self.tiles.len() {
            let mut equal = 0;
            let is_least = |offer: &Offer| offer.is_open() && offer.score.to_bits() == least;
            self.of_tile(tile, &mut bytes, |offer| equal += u64::from(is_least(&offer)))?;
            ties.push(equal.min(left));
            left -= equal.min(left);
        }
        Ok(BestOffers { offers: self, least, ties })
    }
}

impl BestOffers {
    /// The lowest score among them.
    pub fn least(&self) -> f64 {
        f64::from_bits(self.least)
    }

    /// All offers, those that are not the best included.
    pub fn all(self) -> Offers {
        self.offers
    }

    /// Appends to `into` those of a tile.
    fn of_tile(&self, tile: usize, bytes: &mut Vec<u8>, into: &mut Vec<Offer>) -> Result<()> {
        let mut ties = self.ties[tile];
        self.offers.of_tile(tile, bytes, |offer| {
            if !offer.is_open() {
                return;
            }
            let bits = offer.score.to_bits();
            let is_tied = bits == self.least && ties > 0;
            ties -= u64::from(is_tied);
            if bits > self.least || is_tied {
                into.push(offer);
            }
        })
    }
}

/// What is kept when those of the best offers are that no better one is too near to.
pub(super) fn accept(
    job: &Job<'_>,
    keys: &[TileKey],
    best: &BestOffers,
    reach: i64,
    kept: &KeptPoints,
    number: u32,
) -> Result<KeptPoints> {
    let mut new = KeptPoints::new(&job.area);
    let mut blocks = Vec::new();
    job.items(keys.len()).run(
        || (Vec::new(), Vec::new(), KeptReader::default()),
        |(bytes, near, reader), index| {
            near.clear();
            let cube = keys[index].cube();
            let around = cube.grown(reach);
            let meets = |key: &TileKey| key.cube().meets(&around);
            for tile in (0..keys.len()).filter(|n| meets(&keys[*n])) {
                best.of_tile(tile, bytes, near)?;
            }
            let mut chosen = accepted(near);
            chosen.retain(|p| cube.contains(*p));
            chosen.sort_unstable_by(morton_cmp);
            kept.near(&cube, reader)?;
            let merged = MergedPoints::of(reader, chosen.into_iter(), number);
            job.advance(0)?;
            new.pack(&merged.positions, &merged.rounds)
        },
        |of_tile: Vec<Block>| blocks.extend(of_tile),
        |_| Ok(()),
    )?;
    new.enter(blocks)?;
    Ok(new)
}

/// Those of `offers` that do not stand aside for another.
fn accepted(offers: &[Offer]) -> Vec<Position> {
    let farthest = offers.iter().map(|offer| offer.apart).fold(0.0, f64::max);
    if farthest <= 0.0 {
        return offers.iter().map(|offer| offer.at).collect();
    }
    let side = (farthest.ceil() as i64).max(1);
    let place = |p: Position| p.map(|v| v.div_euclid(side));
    let mut cubes: HashMap<[i64; 3], Vec<u32>, PlaceHashes> = HashMap::default();
    for (i, offer) in offers.iter().enumerate() {
        cubes.entry(place(offer.at)).or_default().push(i as u32);
    }
    let is_better = |one: &Offer, other: &Offer| {
        let by_score = one.score.total_cmp(&other.score);
        by_score.then_with(|| morton_cmp(&other.at, &one.at)).is_gt()
    };
    let stands_aside = |offer: &&Offer| {
        let at = place(offer.at);
        let around = (0..27).map(|n| [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1]);
        let cubes = around.filter_map(|by| cubes.get(&std::array::from_fn(|i| at[i] + by[i])));
        cubes.flatten().map(|&i| &offers[i as usize]).any(|other| {
            let near = (distance2(offer.at, other.at) as f64) < offer.apart * offer.apart;
            near && is_better(other, offer)
        })
    };
    offers.iter().filter(|offer| !stands_aside(offer)).map(|offer| offer.at).collect()
}
