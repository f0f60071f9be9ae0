//! Exact neighbourhoods of a tile's positions: found among what is loaded, proven against what is
//! not, searched for in the whole scan where the proof fails.
//!
//! A set of neighbours is right if its farthest is nearer than the first plane of positions that
//! are not loaded; at equal distance a position beyond might win the tie. Faces beyond which the
//! scan has nothing do not count. So the width of the rim decides about speed and never about an
//! answer. No width has to be guessed that would do for every place of every scan, and a rim that
//! does not fit the memory is made narrower without harm.

use std::sync::Arc;

use super::remote::{FoundPosition, Remote};
use super::sieve::Sieve;
use super::values::ValuesBeyond;
use crate::Result;
use crate::geom::nearest::Nearest;
use crate::geom::simd::Simd;
use crate::point::{Bounds, ColumnKind, Position, distance2};
use crate::store::SealedTiles;
use crate::store::morton_cmp;

/// The search of a tile, and how to look beyond it.
#[derive(Debug, Default)]
pub struct Around {
    search: Nearest,
    remote: Remote,
    /// None if the tile is all there is.
    beyond: Option<Beyond>,
    /// The offsets of a position's neighbours, and the ranks of what was found beyond the tile.
    offsets: Vec<Position>,
    ranks: Vec<u32>,
    /// Neighbourhoods that what was loaded could not prove, since the last
    /// [`Around::take_unproven`].
    unproven: u64,
    /// Neighbourhoods whose two farthest are equally far, likewise.
    tied: u64,
}

/// The whole scan, and what of it is not loaded.
#[derive(Debug)]
struct Beyond {
    tiles: Arc<SealedTiles>,
    sieve: Sieve,
    /// The box that is loaded.
    loaded: LoadedBox,
}

impl Beyond {
    /// None if the scan has nothing beyond `loaded`.
    fn new(tiles: &Arc<SealedTiles>, sieve: &Sieve, loaded: Bounds) -> Option<Beyond> {
        let scan = tiles.bounds();
        let open = LoadedBox::of(&scan, loaded);
        let beyond = || Beyond { tiles: tiles.clone(), sieve: sieve.clone(), loaded: open };
        (!loaded.holds(&scan)).then(beyond)
    }
}

/// A box of which all positions of a scan are loaded, without limits where the scan has nothing
/// beyond.
#[derive(Debug, Clone, Copy)]
pub struct LoadedBox(Bounds);

impl LoadedBox {
    /// All of a scan in the box `scan` that is in the box `loaded`.
    pub fn of(scan: &Bounds, loaded: Bounds) -> LoadedBox {
        let mut open = loaded;
        for axis in 0..3 {
            if loaded.lo[axis] <= scan.lo[axis] {
                open.lo[axis] = i64::MIN;
            }
            if loaded.hi[axis] >= scan.hi[axis] {
                open.hi[axis] = i64::MAX;
            }
        }
        LoadedBox(open)
    }

    /// True if no position that is not loaded can be among the nearest of `p`, of which the
    /// farthest found is at squared distance `d2`: on the first plane not loaded, one at exactly
    /// the same distance might win the tie.
    pub fn proves(&self, p: Position, d2: u128) -> bool {
        let Bounds { lo, hi } = self.0;
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

    /// Searches by this instruction set from now on. Drops what was reserved.
    pub(super) fn compute_by(&mut self, simd: Simd) {
        self.search = Nearest::with(simd);
    }

    /// The instruction set that neighbours are searched by.
    pub(super) fn simd(&self) -> Simd {
        self.search.simd()
    }

    /// Everything in `loaded` is at hand; what is beyond is in `tiles`.
    pub(super) fn surround(&mut self, tiles: &Arc<SealedTiles>, sieve: &Sieve, loaded: Bounds) {
        self.beyond = Beyond::new(tiles, sieve, loaded);
    }

    /// The values of a column at neighbours that are not loaded.
    pub(super) fn values_beyond(&self, column: ColumnKind) -> ValuesBeyond {
        let scan = self.beyond.as_ref().map(|beyond| (beyond.tiles.clone(), beyond.sieve.clone()));
        ValuesBeyond::new(column, scan)
    }

    /// Calls `visit` for every one of `positions` that `is_asked` with its index and the `k`
    /// nearest *other* positions of the whole scan.
    pub(super) fn each_neighborhood(
        &mut self,
        positions: &[Position],
        k: usize,
        is_asked: impl Fn(usize) -> bool,
        mut visit: impl FnMut(usize, &Neighborhood<'_>),
    ) -> Result<()> {
        let Around { search, remote, beyond, offsets, ranks, unproven, tied } = self;
        let mut outcome = Ok(());
        search.build(positions);
        search.search(positions, k, is_asked, |i, neighbors, d2| {
            if outcome.is_err() {
                return;
            }
            let p = positions[i];
            let enough = neighbors.len() == k;
            offsets.clear();
            if let Some(beyond) = beyond
                && !(enough && beyond.loaded.proves(p, d2))
            {
                *unproven += 1;
                let scan = (&*beyond.tiles, &beyond.sieve);
                let found = match remote.nearest(scan, p, k, enough.then_some(d2)) {
                    Ok(found) => found,
                    Err(error) => return outcome = Err(error),
                };
                offsets.extend(found.iter().map(|found| found.position));
                rank(offsets, ranks);
                offsets.iter_mut().for_each(|q| *q = offset(p, *q));
                let neighborhood = Neighborhood::of_offsets(offsets, ranks);
                return visit(i, &Neighborhood { found: Some(found), ..neighborhood });
            }
            if let [.., before, _] = *neighbors {
                *tied += u64::from(distance2(p, positions[before as usize]) == d2);
            }
            offsets.extend(neighbors.iter().map(|&rank| offset(p, positions[rank as usize])));
            visit(i, &Neighborhood { offsets, ranks: neighbors, farthest2: d2, found: None });
        });
        outcome
    }
}

#[inline(always)]
fn offset(p: Position, q: Position) -> Position {
    [q[0] - p[0], q[1] - p[1], q[2] - p[2]]
}

/// The nearest other positions of a position, nearest first, of equally near ones the Morton-first.
#[derive(Debug, Clone, Copy)]
pub struct Neighborhood<'a> {
    offsets: &'a [Position],
    ranks: &'a [u32],
    farthest2: u128,
    /// Where the neighbours are in the scan, if they had to be searched for there.
    found: Option<&'a [FoundPosition]>,
}

impl<'a> Neighborhood<'a> {
    /// The neighbourhood of a position whose neighbours are at `offsets`, in order; `ranks` grow in
    /// Morton order of where they lead to.
    pub fn of_offsets(offsets: &'a [Position], ranks: &'a [u32]) -> Self {
        let farthest2 = offsets.last().map_or(0, |&o| distance2([0; 3], o));
        Neighborhood { offsets, ranks, farthest2, found: None }
    }

    /// The offsets of the neighbours from the position, in lattice steps.
    pub fn offsets(&self) -> &'a [Position] {
        self.offsets
    }

    /// For each neighbour a number that grows in Morton order.
    pub fn ranks(&self) -> &'a [u32] {
        self.ranks
    }

    /// Those that are no farther than the root of `square`.
    #[must_use]
    pub fn within(&self, square: u128) -> Neighborhood<'a> {
        let count = self.offsets.partition_point(|&o| distance2([0; 3], o) <= square);
        let (offsets, ranks) = (&self.offsets[..count], &self.ranks[..count]);
        let found = self.found.map(|found| &found[..count]);
        Neighborhood { found, ..Neighborhood::of_offsets(offsets, ranks) }
    }

    /// Where the neighbours are in the scan, if they had to be searched for there; else their ranks
    /// are their indices in the tile.
    pub(super) fn found(&self) -> Option<&'a [FoundPosition]> {
        self.found
    }

    /// Squared distance of the farthest neighbour in lattice steps; 0 if there is none.
    pub fn farthest2(&self) -> u128 {
        self.farthest2
    }
}

/// The numbers of the positions in Morton order.
fn rank(positions: &[Position], ranks: &mut Vec<u32>) {
    let before =
        |p: &Position| positions.iter().filter(|q| morton_cmp(q, p).is_lt()).count() as u32;
    ranks.clear();
    ranks.extend(positions.iter().map(before));
}
