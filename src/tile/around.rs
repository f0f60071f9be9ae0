//! Exact neighbourhoods of a tile's positions: found among what is loaded, proven against what is
//! not, searched for in the whole scan where the proof fails.

use std::sync::Arc;

use super::key::morton_cmp;
use super::remote::Remote;
use super::sealed::SealedTiles;
use super::{Bounds, Position, Tile};
use crate::Result;
use crate::geom::nearest::Nearest;
use crate::point::distance2;

/// The search of a tile, and how to look beyond it.
#[derive(Debug, Default)]
pub struct Around {
    search: Nearest,
    remote: Remote,
    /// The whole scan and the box of it that is loaded; None if the tile is all there is.
    beyond: Option<(Arc<SealedTiles>, Bounds)>,
    ranks: Vec<u32>,
    offsets: Vec<Position>,
    /// Neighbourhoods that what was loaded could not prove, since the last [`Around::take_unproven`].
    unproven: u64,
    /// Neighbourhoods whose two farthest are equally far, likewise.
    tied: u64,
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
    pub(super) fn surround(&mut self, tiles: &Arc<SealedTiles>, loaded: Bounds) {
        self.around.beyond = Some((tiles.clone(), loaded));
    }

    /// Calls `visit` for every position of the zone with its index in the tile and the offsets,
    /// in Morton order of the positions they lead to, of the `k` nearest *other* positions of the
    /// whole scan: nearest by exact squared distance, ties by Morton order. Fewer only if the scan
    /// has fewer.
    pub fn each_neighborhood(
        &mut self,
        k: usize,
        mut visit: impl FnMut(usize, &[Position]),
    ) -> Result<()> {
        let Tile { positions, zone, around, .. } = self;
        let Around { search, remote, beyond, ranks, offsets, unproven, tied } = around;
        let mut outcome = Ok(());
        search.build(positions);
        search.search(
            positions,
            k,
            |i| zone.contains(positions[i]),
            |i, neighbors, d2| {
                if outcome.is_err() {
                    return;
                }
                let p = positions[i];
                offsets.clear();
                match beyond {
                    Some((tiles, loaded))
                        if !proven(p, d2, neighbors.len() == k, loaded, &tiles.bounds()) =>
                    {
                        *unproven += 1;
                        let bound = (neighbors.len() == k).then_some(d2);
                        match remote.nearest(tiles, p, k, bound) {
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
                        ranks.clear();
                        ranks.extend_from_slice(neighbors);
                        ranks.sort_unstable();
                        offsets.extend(ranks.iter().map(|&q| offset(p, positions[q as usize])));
                    }
                }
                visit(i, offsets);
            },
        );
        outcome
    }
}

fn offset(p: Position, q: Position) -> Position {
    std::array::from_fn(|axis| q[axis] - p[axis])
}

/// True if no position outside of `loaded` can be among the nearest of `p`, of which the farthest
/// found is at squared distance `d2` (and of which `enough` were found). A face beyond which the
/// scan has nothing leaves nothing to prove; on the first plane not loaded a position at exactly the
/// same distance might win the tie.
fn proven(p: Position, d2: u128, enough: bool, loaded: &Bounds, scan: &Bounds) -> bool {
    let clear = |gap: u64| enough && d2 < u128::from(gap) * u128::from(gap);
    (0..3).all(|axis| {
        let below =
            loaded.lo[axis] <= scan.lo[axis] || clear(p[axis].abs_diff(loaded.lo[axis]) + 1);
        let above =
            loaded.hi[axis] >= scan.hi[axis] || clear(p[axis].abs_diff(loaded.hi[axis]) + 1);
        below && above
    })
}
