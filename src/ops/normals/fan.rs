//! The closed fans of Delaunay triangles around eight points side by side: what
//! [`Star`](crate::geom::star::Star) finds for one point, where that point is clearly inside of its
//! neighbours' polygon and no four points are nearly on one circle.

use super::bundle::{Row, load};
use crate::geom::plane::{across, choose, dot, unit_or_nan};
use crate::geom::simd::{EIGHT, Lanes, Mask, Real};
use crate::geom::star::{Projected, ROUNDING, cross};

/// Relative size of a turn that leaves no doubt: far above what a star takes for none, so that every
/// way around the hull meets the same corners.
const CLEAR: f64 = 1.0 / (1u64 << 20) as f64;
/// The nearest neighbour is in no doubt where no other is as near, up to this factor (of squares).
const RIVAL: f64 = 1.0 + 1.0 / (1u64 << 36) as f64;

/// The neighbours of eight points in their planes, a row for each; memory that stays.
#[derive(Debug, Default)]
pub(super) struct Fan {
    /// The inverted projections, and |x| + |y| of each.
    inverted: Vec<[Row; 3]>,
    /// Distances in the plane, squared.
    squares: Vec<Row>,
    /// The place of the neighbour at each corner of the hull, counter-clockwise.
    corners: Vec<Row>,
}

/// A neighbour in each lane: its inverted projection, |x| + |y|, and its place.
#[derive(Clone, Copy)]
struct Corner<T> {
    x: T,
    y: T,
    size: T,
    place: T,
}

impl<T: Real> Corner<T> {
    #[inline(always)]
    fn choose(mask: T::Mask, a: Corner<T>, b: Corner<T>) -> Corner<T> {
        Corner {
            x: T::choose(mask, a.x, b.x),
            y: T::choose(mask, a.y, b.y),
            size: T::choose(mask, a.size, b.size),
            place: T::choose(mask, a.place, b.place),
        }
    }
}

impl Fan {
    /// The mean of the unit normals of each fan's triangles, at length 1, on the side of `normals`,
    /// those of the planes to project to; and the lanes where there is no doubt about it.
    #[inline(always)]
    pub fn mean_normals<L: Lanes>(
        &mut self,
        lanes: L,
        at: &[[Row; 3]],
        ranks: &[u32],
        normals: [L::F64; 3],
    ) -> ([L::F64; 3], u32) {
        self.project(lanes, at, normals);
        let (start, clear) = self.nearest(lanes);
        let (counts, clear) = self.walk(lanes, start, clear);
        let first = self.first(ranks, &counts);
        (self.mean(lanes, at, normals, &first, &counts), clear)
    }

    /// Projects all neighbours to the planes with the given normals, and inverts them.
    #[inline(always)]
    fn project<L: Lanes>(&mut self, lanes: L, at: &[[Row; 3]], normals: [L::F64; 3]) {
        let Fan { inverted, squares, corners } = self;
        inverted.resize(at.len(), [[0.0; EIGHT]; 3]);
        squares.resize(at.len(), [0.0; EIGHT]);
        corners.resize(at.len(), [0.0; EIGHT]);
        let (u, v) = across(normals);
        for ((at, inverted), square) in at.iter().zip(inverted).zip(squares) {
            let p = Projected::of(load(lanes, at), u, v);
            let size = p.x.size() + p.y.size();
            *inverted = [lanes.store_eight(p.x), lanes.store_eight(p.y), lanes.store_eight(size)];
            *square = lanes.store_eight(p.square);
        }
    }

    /// Each lane's nearest neighbour in the plane, which is a corner of the hull, and the lanes
    /// where rounding leaves no doubt about it.
    #[inline(always)]
    fn nearest<L: Lanes>(&self, lanes: L) -> (L::F64, u32) {
        let zero = lanes.load_eight(&[0.0; EIGHT]);
        let (mut least, mut place) = (zero.of(f64::MAX), zero);
        for (row, this) in self.squares.iter().zip(0u32..) {
            let square = lanes.load_eight(row);
            let nearer = square.below(least);
            least = L::F64::choose(nearer, square, least);
            place = L::F64::choose(nearer, zero.of(f64::from(this)), place);
        }
        let (limit, mut rivals) = (least * zero.of(RIVAL), zero);
        for row in &self.squares {
            let far = limit.below(lanes.load_eight(row));
            rivals = rivals + L::F64::choose(far, zero, zero.of(1.0));
        }
        (place, rivals.equals(zero.of(1.0)).bits())
    }

    /// The corner of each lane whose place is given.
    #[inline(always)]
    fn corner<L: Lanes>(&self, lanes: L, place: L::F64) -> Corner<L::F64> {
        let zero = place.of(0.0);
        let mut corner = Corner { x: zero, y: zero, size: zero, place };
        for (row, this) in self.inverted.iter().zip(0u32..) {
            let [x, y, size] = load(lanes, row);
            let here = place.equals(place.of(f64::from(this)));
            corner = Corner::choose(here, Corner { x, y, size, place }, corner);
        }
        corner
    }

    /// Walks around the hull of every lane in `clear`, from corner to corner (gift wrapping), until
    /// it is back; returns how many corners each has, and the lanes where none was in doubt.
    #[inline(always)]
    fn walk<L: Lanes>(&mut self, lanes: L, start: L::F64, clear: u32) -> ([usize; EIGHT], u32) {
        let mut counts = [0; EIGHT];
        let (mut walking, mut done) = (clear, 0);
        let mut corner = self.corner(lanes, start);
        for step in 0..self.inverted.len() {
            self.corners[step] = lanes.store_eight(corner.place);
            let (next, clear) = self.next(lanes, corner);
            walking &= clear;
            let back = next.place.equals(start).bits();
            let mut arrived = walking & back;
            done |= arrived;
            walking &= !back;
            while arrived != 0 {
                counts[arrived.trailing_zeros() as usize & (EIGHT - 1)] = step + 1;
                arrived &= arrived - 1;
            }
            if walking == 0 {
                break;
            }
            corner = next;
        }
        (counts, done)
    }

    /// The next corner of each lane's hull, counter-clockwise, and the lanes where there is no doubt
    /// about it: no neighbour is to the right of the way there, and the point itself is to the left.
    #[inline(always)]
    fn next<L: Lanes>(&self, lanes: L, a: Corner<L::F64>) -> (Corner<L::F64>, u32) {
        let (zero, clear) = (a.x.of(0.0), a.x.of(CLEAR));
        let mut best = Corner { x: zero, y: zero, size: zero, place: a.x.of(-1.0) };
        let mut doubt = zero.below(zero);
        for (row, place) in self.inverted.iter().zip(0u32..) {
            let [x, y, size] = load(lanes, row);
            let place = zero.of(f64::from(place));
            let turn = (best.x - a.x) * (y - a.y) - (best.y - a.y) * (x - a.x);
            let sizes = clear * (a.size + best.size) * (best.size + size);
            let itself = place.equals(a.place);
            let first = best.place.below(zero);
            doubt = doubt | !(itself | first | sizes.below(turn.size()));
            let taken = !itself & (first | turn.below(zero));
            best = Corner::choose(taken, Corner { x, y, size, place }, best);
        }
        let turn = a.x * best.y - a.y * best.x;
        doubt = doubt | !(clear * a.size * best.size).below(turn);
        (best, !doubt.bits())
    }

    /// Sums the unit normals of the triangles counter-clockwise from each lane's `first` corner.
    #[inline(always)]
    fn mean<L: Lanes>(
        &self,
        lanes: L,
        at: &[[Row; 3]],
        normals: [L::F64; 3],
        first: &[usize; EIGHT],
        counts: &[usize; EIGHT],
    ) -> [L::F64; 3] {
        let zero = normals[0].of(0.0);
        let most = counts.iter().fold(0, |most, &n| if n > most { n } else { most });
        let mut left = [0.0; EIGHT];
        for lane in 0..EIGHT {
            left[lane] = counts[lane] as f64;
        }
        let left = lanes.load_eight(&left);
        let mut sum = [zero; 3];
        let mut a = load(lanes, &self.gather(at, first, counts, 0));
        for step in 1..=most {
            let b = load(lanes, &self.gather(at, first, counts, step));
            let area = cross(a, b);
            let length = dot(area, area).root();
            let counts = (zero.of(ROUNDING) * length).below(dot(area, normals))
                & !left.below(zero.of(step as f64));
            let unit = [area[0] / length, area[1] / length, area[2] / length];
            let unit = choose(counts, unit, [zero; 3]);
            sum = [sum[0] + unit[0], sum[1] + unit[1], sum[2] + unit[2]];
            a = b;
        }
        unit_or_nan(sum)
    }

    /// For each lane, which of its corners is the Morton-first.
    #[inline(always)]
    fn first(&self, ranks: &[u32], counts: &[usize; EIGHT]) -> [usize; EIGHT] {
        let mut first = [0; EIGHT];
        for (lane, ranks) in ranks.chunks_exact(self.inverted.len()).enumerate().take(EIGHT) {
            let mut least = u32::MAX;
            for step in 0..counts[lane] {
                let rank = ranks[self.corners[step][lane] as usize];
                first[lane] = if rank < least { step } else { first[lane] };
                least = if rank < least { rank } else { least };
            }
        }
        first
    }

    /// The offsets of the corners `step` behind `first`.
    #[inline(always)]
    fn gather(
        &self,
        at: &[[Row; 3]],
        first: &[usize; EIGHT],
        counts: &[usize; EIGHT],
        step: usize,
    ) -> [Row; 3] {
        let mut corner = [[0.0; EIGHT]; 3];
        for lane in 0..EIGHT {
            let (count, step) = (counts[lane], first[lane] + step);
            let step = if step < count { step } else { step - count };
            // Lanes with fewer corners are read somewhere and do not count.
            let place = self.corners[if step < count { step } else { 0 }][lane];
            let at = &at[place as usize];
            for axis in 0..3 {
                corner[axis][lane] = at[axis][lane];
            }
        }
        corner
    }
}
