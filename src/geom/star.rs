//! The star of a point: the Delaunay triangles incident to it in the plane of its neighbourhood,
//! found as a convex hull. Knows no tiles, no stages.

use super::plane::{across, dot, to_f64, unit};
use super::simd::Real;

/// Relative size below which a computed quantity counts as 0.
///
/// Projections to the plane are rounded, so exact coincidences (cocircular grid points, neighbours
/// straight above each other, scan edges that are straight lines) come out as a few 2^-53. They are
/// taken for what they are up to 2^-40; nothing measured lies between.
pub const ROUNDING: f64 = 1.0 / (1u64 << 40) as f64;
/// The bits of a key that hold a neighbour's place; those above hold its direction, to 2^-46 of a
/// turn: nearer ones count as equal.
const PLACE: u64 = (1 << 18) - 1;

/// Finds first estimates of normals from the triangles around a point; holds scratch memory only.
///
/// With q the projections of the neighbours to the plane, relative to p, inversion s = q/|q|² turns
/// circles through p into lines: an edge of the convex hull of 0 and all s is a triangle with p
/// whose circumcircle is empty. Points are sorted by direction around p and scanned once (Graham),
/// which ends with a polygon around p whatever the rounding does.
#[derive(Debug, Default)]
pub struct Star {
    /// True if a neighbour on the circle of a triangle is a corner, too.
    takes_circles: bool,
    /// In Morton order.
    projected: Vec<Inverted>,
    /// Direction, then place in `projected`.
    keys: Vec<u64>,
    /// By direction around p.
    points: Vec<Inverted>,
    /// Those on the hull.
    vertices: Vec<Inverted>,
}

/// A neighbour in the plane, relative to p; or several side by side.
#[derive(Debug, Clone, Copy)]
pub struct ProjectedPoint<T> {
    /// The inverted projection; NaN if the neighbour is straight above or below p.
    pub x: T,
    /// Likewise.
    pub y: T,
    /// Square of the distance to p in the plane, before the inversion.
    pub square: T,
}

impl<T: Real> ProjectedPoint<T> {
    /// Projects a neighbour at `offset` to the plane of the unit vectors `u` and `v`.
    #[inline(always)]
    pub fn of(offset: [T; 3], u: [T; 3], v: [T; 3]) -> ProjectedPoint<T> {
        let (x, y) = (dot(offset, u), dot(offset, v));
        let square = x * x + y * y;
        let clear = (x.of(ROUNDING * ROUNDING) * dot(offset, offset)).below(square);
        let inverse = T::choose(clear, x.of(1.0) / square, x.of(f64::NAN));
        ProjectedPoint { x: x * inverse, y: y * inverse, square }
    }
}

/// What grows with the direction of (x, y), counter-clockwise: 4 to 8, so that its exponent is the
/// same for all. Nothing is at 8 itself, which is the direction of 4.
fn turn(x: f64, y: f64) -> f64 {
    let slope = y / (x.abs() + y.abs());
    let turn = if x >= 0.0 { 5.0 + slope } else { 7.0 - slope };
    if turn == 8.0 { 4.0 } else { turn }
}

/// A neighbour, projected and inverted.
#[derive(Debug, Clone, Copy)]
pub struct Inverted {
    x: f64,
    y: f64,
    /// |x| + |y|
    size: f64,
    /// Place among the offsets: Morton order.
    rank: u32,
}

impl Inverted {
    /// The neighbour of the given place in Morton order.
    #[inline(always)]
    pub fn new(x: f64, y: f64, rank: u32) -> Inverted {
        Inverted { x, y, size: x.abs() + y.abs(), rank }
    }
}

impl Star {
    /// One of which neighbours that are cocircular with a triangle are corners, too: of a square
    /// three triangles instead of one.
    pub fn with_circles() -> Star {
        Star { takes_circles: true, ..Star::default() }
    }

    /// The mean of the unit normals of the Delaunay triangles around p, at length 1, on the side of
    /// `normal`, the unit normal of the plane to project to. None if there is no triangle.
    ///
    /// `offsets` are the neighbours relative to p, in steps, in Morton order, none of them 0 and
    /// all smaller than 2^63; no more than the first 2^18 count. Normals are summed
    /// counter-clockwise from the vertex of smallest rank. Points cocircular with a triangle are
    /// left out, unless it is a star [with circles](Star::with_circles), as are triangles that the
    /// projection turns into lines.
    pub fn normal(&mut self, offsets: &[[i64; 3]], normal: [f64; 3]) -> Option<[f64; 3]> {
        let rounded = offsets.iter().map(|offset| offset.map(|c| c as f64));
        let closed = self.around(rounded, normal);
        self.mean_normal(normal, closed, |rank| offsets[rank as usize], exact_cross)
    }

    /// The same of offsets that are whole numbers below 2^26, whose products f64 holds exactly.
    pub fn normal_of_short(&mut self, offsets: &[[f64; 3]], normal: [f64; 3]) -> Option<[f64; 3]> {
        let closed = self.around(offsets.iter().copied(), normal);
        self.mean_normal(normal, closed, |rank| offsets[rank as usize], cross)
    }

    /// Finds the vertices around p in the plane normal to `normal`, and whether p is inside.
    #[inline(always)]
    fn around(&mut self, offsets: impl Iterator<Item = [f64; 3]>, normal: [f64; 3]) -> bool {
        self.project(offsets, normal);
        self.keys.sort_unstable();
        let Star { projected, keys, points, .. } = self;
        points.clear();
        points.extend(keys.iter().map(|key| projected[(key & PLACE) as usize]));
        self.keep_nearest_per_direction();
        let closed = self.turns_left_throughout();
        self.hull(closed.then(|| self.nearest()));
        closed
    }

    /// Projects and inverts all neighbours that are not straight above or below p.
    #[inline(always)]
    fn project(&mut self, offsets: impl Iterator<Item = [f64; 3]>, normal: [f64; 3]) {
        let (u, v) = across(normal);
        self.projected.clear();
        self.keys.clear();
        for (rank, offset) in (0..=PLACE as u32).zip(offsets) {
            let at = ProjectedPoint::of(offset, u, v);
            if !at.x.is_nan() {
                let place = self.projected.len() as u64;
                self.keys.push(turn(at.x, at.y).to_bits() << 12 & !PLACE | place);
                self.projected.push(Inverted::new(at.x, at.y, rank));
            }
        }
    }

    /// True if every point is less than half a turn counter-clockwise of the one before it, and no
    /// two are in one direction: p is then inside of their polygon.
    fn turns_left_throughout(&self) -> bool {
        let [first, .., last] = &self.points[..] else { return false };
        let pairs = self.points.windows(2);
        pairs.fold(last.turns_left_to(first), |all, pair| all & pair[0].turns_left_to(&pair[1]))
    }

    /// Of neighbours in one direction only the nearest can be in a triangle; of equal ones the
    /// Morton-first stays.
    fn keep_nearest_per_direction(&mut self) {
        self.points.dedup_by(|next, kept| {
            let same = next.same_direction(kept);
            if same && next.hides(kept) {
                *kept = *next;
            }
            same
        });
        if let [first, .., last] = self.points[..]
            && first.same_direction(&last)
        {
            if last.hides(&first) {
                self.points[0] = last;
            }
            self.points.pop();
        }
    }

    /// The place of the neighbour nearest to p.
    fn nearest(&self) -> usize {
        let points = &self.points;
        (0..points.len()).fold(0, |best, i| if points[i].hides(&points[best]) { i } else { best })
    }

    /// Finds the vertices of the hull of the points, sorted by direction, and 0. If 0 is inside,
    /// the place of the `nearest` neighbour is told, which is a vertex whatever the others are.
    /// Otherwise the first and last vertices are 0's neighbours on the hull.
    fn hull(&mut self, nearest: Option<usize>) {
        let Star { points, vertices, takes_circles, .. } = self;
        // By how much the path must turn left: by more than rounding, or not to the right by more.
        let least = if *takes_circles { -ROUNDING } else { ROUNDING };
        vertices.clear();
        let count = points.len();
        let start = nearest.unwrap_or_else(|| {
            // A gap of half a turn or more leaves 0 on the hull: begin after it.
            let before = (0..count).find(|&i| !points[i].turns_left_to(&points[(i + 1) % count]));
            before.map_or(0, |before| (before + 1) % count)
        });
        for next in points[start..].iter().chain(&points[..start]) {
            drop_right_turns(vertices, next, least);
            vertices.push(*next);
        }
        if let (Some(_), Some(&first)) = (nearest, vertices.first()) {
            drop_right_turns(vertices, &first, least);
        }
    }

    /// Sums the unit normals of the triangles of p and two consecutive vertices, given their
    /// offsets and how to multiply two of them.
    #[inline(always)]
    fn mean_normal<T: Copy>(
        &self,
        normal: [f64; 3],
        closed: bool,
        offset: impl Fn(u32) -> T,
        cross: impl Fn(T, T) -> [f64; 3],
    ) -> Option<[f64; 3]> {
        let vertices = &self.vertices[..];
        // Rank and place in one number: a minimum without branches.
        let ranks = vertices.iter().zip(0u64..).map(|(v, i)| u64::from(v.rank) << 32 | i);
        let first = ranks.min()? as u32 as usize;
        let mut sum = [0.0; 3];
        let mut a = offset(vertices[first].rank);
        for next in (first + 1..vertices.len()).chain(0..=first) {
            let b = offset(vertices[next].rank);
            let area = cross(a, b);
            a = b;
            let length = dot(area, area).sqrt();
            let counts = closed || next != 0;
            if dot(area, normal) > ROUNDING * length && counts {
                for axis in 0..3 {
                    sum[axis] += area[axis] / length;
                }
            }
        }
        unit(sum)
    }
}

/// Drops the last vertices until the path turns left to `next`.
#[inline(always)]
fn drop_right_turns(vertices: &mut Vec<Inverted>, next: &Inverted, least: f64) {
    while let [.., a, b] = &vertices[..]
        && !left_turn(a, b, next, least)
    {
        vertices.pop();
    }
}

impl Inverted {
    /// True if the direction of `next` is less than half a turn counter-clockwise of this one's.
    fn turns_left_to(&self, next: &Inverted) -> bool {
        self.x * next.y - self.y * next.x > ROUNDING * self.size * next.size
    }

    fn same_direction(&self, other: &Inverted) -> bool {
        let across = self.x * other.y - self.y * other.x;
        let along = self.x * other.x + self.y * other.y;
        along > 0.0 && across.abs() <= ROUNDING * self.size * other.size
    }

    /// True if this neighbour is nearer to p than `other`, or as near and before it in rank.
    fn hides(&self, other: &Inverted) -> bool {
        let [mine, theirs] = [self, other].map(|s| s.x * s.x + s.y * s.y);
        if (mine - theirs).abs() <= ROUNDING * theirs {
            return self.rank < other.rank;
        }
        mine > theirs
    }
}

/// True if the path a, b, c turns left at b by more than `least`, relative to its sizes.
fn left_turn(a: &Inverted, b: &Inverted, c: &Inverted, least: f64) -> bool {
    let turn = (b.x - a.x) * (c.y - b.y) - (b.y - a.y) * (c.x - b.x);
    turn > least * (a.size + b.size) * (b.size + c.size)
}

/// The vector product.
#[inline(always)]
pub fn cross<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The vector product of two offsets, each component rounded once.
fn exact_cross(a: [i64; 3], b: [i64; 3]) -> [f64; 3] {
    let (a, b) = (a.map(i128::from), b.map(i128::from));
    // Products of offsets below 2^63 differ by less than 2^127.
    let minor = |i: usize, j: usize| to_f64((a[i] * b[j]).wrapping_sub(a[j] * b[i]));
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}
