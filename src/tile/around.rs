//! Exact neighbourhoods of a tile's positions: found among what is loaded, proven against what is
//! not, searched for in the whole scan where the proof fails.

use std::sync::Arc;

use super::key::morton_cmp;
use super::remote::Remote;
use super::sealed::SealedTiles;
use super::sieve::Sieve;
use super::{Bounds, Position, Tile, chosen};
use crate::Result;
use crate::geom::few::{FEW, places};
use crate::geom::nearest::Nearest;
use crate::point::distance2;

/// The search of a tile, and how to look beyond it.
#[derive(Debug, Default)]
pub struct Around {
    search: Nearest,
    remote: Remote,
    /// None if the tile is all there is.
    beyond: Option<Beyond>,
    ranks: Vec<u32>,
    offsets: Vec<Position>,
    /// Neighbourhoods that what was loaded could not prove, since the last [`Around::take_unproven`].
    unproven: u64,
    /// Neighbourhoods whose two farthest are equally far, likewise.
    tied: u64,
}

/// The whole scan, and what of it is not loaded.
#[derive(Debug)]
struct Beyond {
    tiles: Arc<SealedTiles>,
    sieve: Sieve,
    /// The box that is loaded, without limits where the scan has nothing beyond.
    loaded: Bounds,
}

impl Beyond {
    /// None if the scan has nothing beyond `loaded`.
    fn new(tiles: &Arc<SealedTiles>, sieve: &Sieve, loaded: Bounds) -> Option<Beyond> {
        let scan = tiles.bounds();
        let mut open = loaded;
        for axis in 0..3 {
            if loaded.lo[axis] <= scan.lo[axis] {
                open.lo[axis] = i64::MIN;
            }
            if loaded.hi[axis] >= scan.hi[axis] {
                open.hi[axis] = i64::MAX;
            }
        }
        let beyond = || Beyond { tiles: tiles.clone(), sieve: sieve.clone(), loaded: open };
        (!loaded.holds(&scan)).then(beyond)
    }

    /// True if no position that is not loaded can be among the nearest of `p`, of which the farthest
    /// found is at squared distance `d2`: on the first plane not loaded, one at exactly the same
    /// distance might win the tie.
    fn proves(&self, p: Position, d2: u128) -> bool {
        let Bounds { lo, hi } = self.loaded;
        let gap = (0..3).fold(u64::MAX, |gap, axis| {
            gap.min(p[axis].abs_diff(lo[axis])).min(p[axis].abs_diff(hi[axis]))
        });
        let gap = u128::from(gap) + 1;
        d2 < gap.saturating_mul(gap)
    }
}

impl Around {
    /// Allocates for tiles of up to `points` positions.
    pub fn reserve(&mut self, points: usize) {
        self.search.reserve(points);
    }

    /// How many neighbourhoods had their two farthest members at the same distance; begins again
    /// at 0.
    pub fn take_tied(&mut self) -> u64 {
        std::mem::take(&mut self.tied)
    }

    /// How many neighbourhoods had to be searched for beyond the tile; begins again at 0.
    pub fn take_unproven(&mut self) -> u64 {
        std::mem::take(&mut self.unproven)
    }
}

impl Tile {
    pub(super) fn surround(&mut self, tiles: &Arc<SealedTiles>, sieve: &Sieve, loaded: Bounds) {
        self.around.beyond = Beyond::new(tiles, sieve, loaded);
    }

    /// Calls `visit` for every chosen position of the zone with its index in the tile and the offsets,
    /// in Morton order of the positions they lead to, of the `k` nearest *other* positions of the
    /// whole scan: nearest by exact squared distance, ties by Morton order. Fewer only if the scan
    /// has fewer.
    pub fn each_neighborhood(
        &mut self,
        k: usize,
        mut visit: impl FnMut(usize, &[Position]),
    ) -> Result<()> {
        let Tile { positions, zone, around, selections, limits, .. } = self;
        let Around { search, remote, beyond, ranks, offsets, unproven, tied } = around;
        let mut outcome = Ok(());
        search.build(positions);
        search.search(
            positions,
            k,
            |i| zone.contains(positions[i]) && chosen(selections, *limits, i),
            |i, neighbors, d2| {
                if outcome.is_err() {
                    return;
                }
                let p = positions[i];
                let enough = neighbors.len() == k;
                match beyond {
                    Some(beyond) if !(enough && beyond.proves(p, d2)) => {
                        *unproven += 1;
                        offsets.clear();
                        match remote.nearest(
                            (&beyond.tiles, &beyond.sieve),
                            p,
                            k,
                            enough.then_some(d2),
                        ) {
                            Ok(found) => offsets.extend(found),
                            Err(error) => return outcome = Err(error),
                        }
                        offsets.sort_unstable_by(morton_cmp);
                        offsets.iter_mut().for_each(|q| *q = offset(p, *q));
                    }
                    _ => {
                        if let [.., before, _] = *neighbors {
                            *tied += u64::from(distance2(p, positions[before as usize]) == d2);
                        }
                        in_morton_order(p, neighbors, positions, ranks, offsets);
                    }
                }
                visit(i, offsets);
            },
        );
        outcome
    }
}

/// The offsets from `p` of neighbours given by rank. `ranks` is memory to work in.
fn in_morton_order(
    p: Position,
    neighbors: &[u32],
    positions: &[Position],
    ranks: &mut Vec<u32>,
    offsets: &mut Vec<Position>,
) {
    if neighbors.len() <= FEW {
        offsets.resize(neighbors.len(), p);
        for (&rank, place) in neighbors.iter().zip(places(neighbors)) {
            offsets[place as usize] = offset(p, positions[rank as usize]);
        }
        return;
    }
    ranks.clear();
    ranks.extend_from_slice(neighbors);
    ranks.sort_unstable();
    offsets.clear();
    offsets.extend(ranks.iter().map(|&rank| offset(p, positions[rank as usize])));
}

fn offset(p: Position, q: Position) -> Position {
    std::array::from_fn(|axis| q[axis] - p[axis])
}
