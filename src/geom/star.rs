//! The star of a point: the Delaunay triangles incident to it in the plane of its neighbourhood,
//! found as a convex hull. Knows no tiles, no stages.

use super::plane::{across, dot, to_f64, unit};

/// Relative size below which a computed quantity counts as 0.
///
/// Projections to the plane are rounded, so exact coincidences (cocircular grid points, neighbours
/// straight above each other, scan edges that are straight lines) come out as a few 2^-53. They are
/// taken for what they are up to 2^-40; nothing measured lies between.
const ROUNDING: f64 = 1.0 / (1u64 << 40) as f64;
/// The bits of a key that hold a neighbour's place; those above hold its direction, to 2^-46 of a
/// turn: nearer ones count as equal.
const PLACE: u64 = (1 << 18) - 1;
/// Neighbours up to which sorting by counting is faster.
const FEW: usize = 24;

/// Finds first estimates of normals from the triangles around a point; holds scratch memory only.
///
/// With q the projections of the neighbours to the plane, relative to p, inversion s = q/|q|² turns
/// circles through p into lines: an edge of the convex hull of 0 and all s is a triangle with p whose
/// circumcircle is empty. Points are sorted by direction around p and scanned once (Graham), which
/// ends with a polygon around p whatever the rounding does.
#[derive(Debug, Default)]
pub struct Star {
    /// In Morton order.
    projected: Vec<Inverted>,
    /// Direction, then place in `projected`.
    keys: Vec<u64>,
    /// By direction around p, then the hull's vertices.
    points: Vec<Inverted>,
}

/// A neighbour, projected and inverted.
#[derive(Debug, Clone, Copy)]
struct Inverted {
    x: f64,
    y: f64,
    /// |x| + |y|
    size: f64,
    /// Place among the offsets: Morton order.
    rank: u32,
}

impl Star {
    /// The mean of the unit normals of the Delaunay triangles around p, at length 1, on the side of
    /// `normal`, the unit normal of the plane to project to. None if there is no triangle.
    ///
    /// `offsets` are the neighbours relative to p, in steps, in Morton order, none of them 0 and all
    /// smaller than 2^63; no more than the first 2^18 count. Normals are summed counter-clockwise
    /// from the vertex of smallest rank. Points cocircular with a triangle are left out, as are
    /// triangles that the projection turns into lines.
    pub fn normal(&mut self, offsets: &[[i64; 3]], normal: [f64; 3]) -> Option<[f64; 3]> {
        self.project(offsets, normal);
        self.sort_by_direction();
        self.keep_nearest_per_direction();
        let closed = self.hull();
        self.mean_normal(offsets, normal, closed)
    }

    /// Projects and inverts all neighbours that are not straight above or below p.
    fn project(&mut self, offsets: &[[i64; 3]], normal: [f64; 3]) {
        let (u, v) = across(normal);
        self.projected.clear();
        self.keys.clear();
        for (rank, offset) in (0..=PLACE as u32).zip(offsets) {
            let o = offset.map(|c| c as f64);
            let (x, y) = (dot(o, u), dot(o, v));
            let square = x * x + y * y;
            if square <= ROUNDING * ROUNDING * dot(o, o) {
                continue;
            }
            // Grows with the direction, counter-clockwise: 4 to 8, so that its exponent is the same
            // for all (8 itself wraps round to 4, the same direction).
            let slope = y / (x.abs() + y.abs());
            let direction = if x >= 0.0 { 5.0 + slope } else { 7.0 - slope };
            self.keys.push(direction.to_bits() << 12 & !PLACE | self.projected.len() as u64);
            let inverse = 1.0 / square;
            let (x, y) = (x * inverse, y * inverse);
            self.projected.push(Inverted { x, y, size: x.abs() + y.abs(), rank });
        }
    }

    /// Brings the neighbours into counter-clockwise order, those of one direction in Morton order.
    fn sort_by_direction(&mut self) {
        self.points.clear();
        if self.keys.len() > FEW {
            self.keys.sort_unstable();
            let in_order = self.keys.iter().map(|key| self.projected[(key & PLACE) as usize]);
            self.points.extend(in_order);
            return;
        }
        // Counting the smaller ones has no branch to mispredict.
        self.points.extend_from_slice(&self.projected);
        for (key, point) in self.keys.iter().zip(&self.projected) {
            let place = self.keys.iter().map(|other| usize::from(other < key)).sum::<usize>();
            self.points[place] = *point;
        }
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

    /// Reduces the points, sorted by direction, to the vertices of the hull without 0. True if 0 is
    /// inside; otherwise the first and last vertices are 0's neighbours on the hull.
    fn hull(&mut self) -> bool {
        let count = self.points.len();
        if count == 0 {
            return false;
        }
        // A gap of half a turn or more leaves 0 on the hull: begin after it.
        let gap =
            (0..count).find(|&i| !self.points[i].turns_left_to(&self.points[(i + 1) % count]));
        let start = match gap {
            Some(before) => before + 1,
            // The nearest neighbour is a vertex whatever the others are.
            None => (0..count)
                .fold(0, |best, i| if self.points[i].hides(&self.points[best]) { i } else { best }),
        };
        self.points.rotate_left(start % count);
        let mut vertices = 1;
        for i in 1..count {
            let next = self.points[i];
            vertices = self.without_right_turns(vertices, &next);
            self.points[vertices] = next;
            vertices += 1;
        }
        if gap.is_none() {
            vertices = self.without_right_turns(vertices, &self.points[0].clone());
        }
        self.points.truncate(vertices);
        gap.is_none()
    }

    /// How many of the first `vertices` points remain if `next` follows: the last are dropped until
    /// the path turns left.
    fn without_right_turns(&self, mut vertices: usize, next: &Inverted) -> usize {
        while vertices >= 2
            && !left_turn(&self.points[vertices - 2], &self.points[vertices - 1], next)
        {
            vertices -= 1;
        }
        vertices
    }

    /// Sums the unit normals of the triangles of p and two consecutive vertices.
    fn mean_normal(
        &self,
        offsets: &[[i64; 3]],
        normal: [f64; 3],
        closed: bool,
    ) -> Option<[f64; 3]> {
        let count = self.points.len();
        let first = (0..count).min_by_key(|&i| self.points[i].rank)?;
        let mut sum = [0.0; 3];
        for i in (first..count).chain(0..first) {
            if i + 1 == count && !closed {
                continue;
            }
            let next = if i + 1 == count { 0 } else { i + 1 };
            let [a, b] = [i, next].map(|v| offsets[self.points[v].rank as usize]);
            let area = exact_cross(a, b);
            let length = dot(area, area).sqrt();
            if dot(area, normal) > ROUNDING * length {
                for axis in 0..3 {
                    sum[axis] += area[axis] / length;
                }
            }
        }
        unit(sum)
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

/// True if the path a, b, c turns left at b by more than rounding can.
fn left_turn(a: &Inverted, b: &Inverted, c: &Inverted) -> bool {
    let turn = (b.x - a.x) * (c.y - b.y) - (b.y - a.y) * (c.x - b.x);
    turn > ROUNDING * (a.size + b.size) * (b.size + c.size)
}

/// The vector product of two offsets, each component rounded once.
fn exact_cross(a: [i64; 3], b: [i64; 3]) -> [f64; 3] {
    let (a, b) = (a.map(i128::from), b.map(i128::from));
    // Products of offsets below 2^63 differ by less than 2^127.
    let minor = |i: usize, j: usize| to_f64((a[i] * b[j]).wrapping_sub(a[j] * b[i]));
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}
