//! The fans of Delaunay triangles around eight points side by side: what
//! [`Star`](crate::geom::star::Star) finds for one point, where that point is clearly inside of its
//! neighbours' polygon or clearly at its edge, and no four points are nearly on one circle.

#![expect(clippy::needless_range_loop, reason = "one index walks several arrays of lanes")]

use crate::geom::plane::{across, choose, dot, unit_or_nan};
use crate::geom::simd::{EIGHT, Lanes, Mask, Real};
use crate::geom::star::{ProjectedPoint, ROUNDING, cross};

/// Most neighbours of a neighbourhood that is not estimated alone.
pub(super) const MOST: usize = 64;
/// Size of a turn that leaves no doubt, relative to the square of the largest inverted distance:
/// far above what a star takes for none, so that every way around the hull meets the same corners.
const CLEAR: f64 = 1.0 / (1u64 << 24) as f64;
/// The nearest neighbour is in no doubt where no other is as near, up to this factor (of squares).
const RIVAL: f64 = 1.0 + 1.0 / (1u64 << 36) as f64;

/// One number of each neighbourhood.
pub(super) type LaneRow = [f64; EIGHT];

/// The neighbours of eight points in their planes, a row for each; memory that stays.
#[derive(Debug, Default)]
pub(super) struct Fan {
    /// The inverted projections.
    inverted: Vec<[LaneRow; 2]>,
    /// Distances in the plane, squared.
    squares: Vec<LaneRow>,
    /// The offsets of the corners of the hull, counter-clockwise, and of the first once more.
    corners: Vec<[LaneRow; 3]>,
}

/// For each lane the places of the neighbours at the corners of its hull, counter-clockwise.
struct Hulls {
    places: [[u8; MOST]; EIGHT],
    counts: [usize; EIGHT],
    /// The corner behind which the point itself is one: no triangle joins it and the next.
    gaps: [Option<usize>; EIGHT],
}

impl Fan {
    /// The mean of the unit normals of each fan's triangles, at length 1, on the side of `normals`,
    /// those of the planes to project to; and the lanes where there is no doubt about it.
    ///
    /// `ranks` are those of the neighbours in Morton order, neighbourhood after neighbourhood.
    #[inline(always)]
    pub fn mean_normals<L: Lanes>(
        &mut self,
        lanes: L,
        at: &[[LaneRow; 3]],
        ranks: &[u32],
        normals: [L::F64; 3],
    ) -> ([L::F64; 3], u32) {
        self.project(lanes, at, normals);
        let (start, clear) = self.nearest(lanes);
        let (hulls, clear) = self.walk(lanes, start, clear);
        let gaps = self.gather(at, ranks, &hulls);
        (self.mean(lanes, normals, &hulls.counts, &gaps), clear)
    }

    /// Projects all neighbours to the planes with the given normals, and inverts them.
    #[inline(always)]
    fn project<L: Lanes>(&mut self, lanes: L, at: &[[LaneRow; 3]], normals: [L::F64; 3]) {
        let Fan { inverted, squares, corners } = self;
        inverted.resize(at.len(), [[0.0; EIGHT]; 2]);
        squares.resize(at.len(), [0.0; EIGHT]);
        corners.resize(at.len() + 1, [[0.0; EIGHT]; 3]);
        let (u, v) = across(normals);
        for ((at, inverted), square) in at.iter().zip(inverted).zip(squares) {
            let p = ProjectedPoint::of(load(lanes, at), u, v);
            *inverted = [lanes.store_eight(p.x), lanes.store_eight(p.y)];
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

    /// Walks around the hull of every lane in `clear` (gift wrapping), from the neighbour at place
    /// `start` until it is back; and tells the lanes where no corner was in doubt.
    #[inline(always)]
    fn walk<L: Lanes>(&self, lanes: L, start: L::F64, clear: u32) -> (Hulls, u32) {
        let mut hulls =
            Hulls { places: [[0; MOST]; EIGHT], counts: [1; EIGHT], gaps: [None; EIGHT] };
        let place = lanes.store_eight(start);
        let mut corner = [[0.0; EIGHT]; 2];
        for lane in 0..EIGHT {
            let at = &self.inverted[place[lane] as usize];
            (corner[0][lane], corner[1][lane]) = (at[0][lane], at[1][lane]);
            hulls.places[lane][0] = place[lane] as u8;
        }
        let mut at = Corner::<L> {
            x: lanes.load_eight(&corner[0]),
            y: lanes.load_eight(&corner[1]),
            place: start,
            is_left: start.below(start),
        };
        // The nearest neighbour is the farthest when inverted.
        let doubt = at.x.of(CLEAR) * (at.x * at.x + at.y * at.y);
        let (mut walking, mut done) = (clear, 0);
        // Every neighbour may be a corner, and the point itself.
        for _ in 0..=self.inverted.len() {
            let (next, clear) = self.next(lanes, at, doubt);
            walking &= clear;
            let left = next.is_left.bits();
            let back = next.place.equals(start).bits() & walking & !left;
            done |= back;
            walking &= !back;
            if walking == 0 {
                break;
            }
            let place = lanes.store_eight(next.place);
            for lane in 0..EIGHT {
                let is_in = |mask: u32| walking & mask & 1 << lane != 0;
                let count = hulls.counts[lane];
                if is_in(!left) && count < MOST {
                    hulls.places[lane][count] = place[lane] as u8;
                    hulls.counts[lane] = count + 1;
                } else if is_in(left) {
                    hulls.gaps[lane] = Some(count - 1);
                }
            }
            at = next;
        }
        (hulls, done)
    }

    /// What follows corner `a` of each lane's hull, counter-clockwise: no neighbour is to the right
    /// of the way there, and the point itself is not either. Where that is the point itself, the
    /// corner is the same once more, but left. Also the lanes where it is in no doubt.
    ///
    /// Who is to the right of the way from `a` to the point comes first, and whoever is to the
    /// right of the way to the one before takes its place; from the point on, who is to the right
    /// of the way to the corner that was left. Turns up to `doubt` do not count.
    #[inline(always)]
    fn next<L: Lanes>(&self, lanes: L, a: Corner<L>, doubt: L::F64) -> (Corner<L>, u32) {
        let zero = doubt.of(0.0);
        let right = zero - doubt;
        let from = [L::F64::choose(a.is_left, zero, a.x), L::F64::choose(a.is_left, zero, a.y)];
        let mut x = L::F64::choose(a.is_left, a.x, zero - a.x);
        let mut y = L::F64::choose(a.is_left, a.y, zero - a.y);
        let mut best = zero.of(-1.0);
        let mut clear = zero.equals(zero);
        for (row, this) in self.inverted.iter().zip(0u32..) {
            let this = zero.of(f64::from(this));
            let to_x = lanes.load_eight(&row[0]) - from[0];
            let to_y = lanes.load_eight(&row[1]) - from[1];
            let turn = x * to_y - y * to_x;
            clear = clear & (this.equals(a.place) | doubt.below(turn.size()));
            let taken = turn.below(right);
            x = L::F64::choose(taken, to_x, x);
            y = L::F64::choose(taken, to_y, y);
            best = L::F64::choose(taken, this, best);
        }
        let found = zero.of(-0.5).below(best);
        // From the point itself there is a way on.
        let clear = clear & (found | !a.is_left);
        let next = Corner {
            // Up to a rounding the inverted projection: far less than what is in doubt.
            x: L::F64::choose(found, from[0] + x, a.x),
            y: L::F64::choose(found, from[1] + y, a.y),
            place: L::F64::choose(found, best, a.place),
            is_left: !found,
        };
        (next, clear.bits())
    }

    /// Lays out the offsets of the corners, from the Morton-first on, and tells where the gaps are
    /// then: the number of the triangle that is none, counted from 1.
    #[inline(always)]
    fn gather(&mut self, at: &[[LaneRow; 3]], ranks: &[u32], hulls: &Hulls) -> LaneRow {
        let mut gaps = [0.0; EIGHT];
        for (lane, ranks) in ranks.chunks_exact(at.len()).enumerate().take(EIGHT) {
            let count = hulls.counts[lane];
            let places = &hulls.places[lane][..count];
            let (mut first, mut least) = (0, u32::MAX);
            for (step, &place) in places.iter().enumerate() {
                let rank = ranks[place as usize];
                first = if rank < least { step } else { first };
                least = if rank < least { rank } else { least };
            }
            if let Some(gap) = hulls.gaps[lane] {
                gaps[lane] = ((gap + count - first) % count + 1) as f64;
            }
            let (before, behind) = places.split_at(first);
            let around = behind.iter().chain(before).chain(behind.first());
            for (corner, &place) in self.corners.iter_mut().zip(around) {
                let at = &at[place as usize];
                for axis in 0..3 {
                    corner[axis][lane] = at[axis][lane];
                }
            }
        }
        gaps
    }

    /// Sums the unit normals of the triangles in the order of their corners, but for those at gaps.
    #[inline(always)]
    fn mean<L: Lanes>(
        &self,
        lanes: L,
        normals: [L::F64; 3],
        counts: &[usize; EIGHT],
        gaps: &LaneRow,
    ) -> [L::F64; 3] {
        let zero = normals[0].of(0.0);
        let gaps = lanes.load_eight(gaps);
        let (mut left, mut most) = ([0.0; EIGHT], 0);
        for lane in 0..EIGHT {
            left[lane] = counts[lane] as f64;
            most = if counts[lane] > most { counts[lane] } else { most };
        }
        let left = lanes.load_eight(&left);
        let mut sum = [zero; 3];
        let mut a = load(lanes, &self.corners[0]);
        for (step, corner) in (1u32..).zip(&self.corners[1..=most]) {
            let b = load(lanes, corner);
            let area = cross(a, b);
            let length = dot(area, area).root();
            let counts = (zero.of(ROUNDING) * length).below(dot(area, normals))
                & !left.below(zero.of(f64::from(step)))
                & !gaps.equals(zero.of(f64::from(step)));
            let unit = [area[0] / length, area[1] / length, area[2] / length];
            let unit = choose(counts, unit, [zero; 3]);
            sum = [sum[0] + unit[0], sum[1] + unit[1], sum[2] + unit[2]];
            a = b;
        }
        unit_or_nan(sum)
    }
}

/// Three rows.
#[inline(always)]
pub(super) fn load<L: Lanes>(lanes: L, rows: &[LaneRow; 3]) -> [L::F64; 3] {
    [lanes.load_eight(&rows[0]), lanes.load_eight(&rows[1]), lanes.load_eight(&rows[2])]
}

/// A corner of each lane's hull, and where the walk around it has come to.
#[derive(Clone, Copy)]
struct Corner<L: Lanes> {
    x: L::F64,
    y: L::F64,
    place: L::F64,
    /// Where the way went on from the corner to the point itself.
    is_left: <L::F64 as Real>::Mask,
}
