//! Areas of polygons: whether a point is in one, exactly, the border included. Knows no file.
//!
//! Whether a point is left of an edge is asked of adaptive predicates (Shewchuk, "Adaptive
//! precision floating-point arithmetic and fast robust geometric predicates", 1997), which are
//! exact. Edges are in rows by their y, so that a point is held against a few of them, however many
//! there are.

use robust::{Coord, orient2d};

/// A corner, or another point: x and y.
pub(crate) type PolygonCorner = [f64; 2];

/// A polygon: its outer ring and its holes, each as its corners. What an odd number of rings goes
/// around is in it.
pub(crate) type PolygonRings = Vec<Vec<PolygonCorner>>;

/// Edges that rows hold for each edge, on average; more rows hold edges more often.
const IN_ROWS: f64 = 4.0;
/// Pairs of edges that are looked at for crossings, seconds of work.
const MOST_PAIRS: usize = 1 << 28;

/// What is in one of several polygons.
#[derive(Debug, Clone)]
pub(crate) struct Area {
    lo: PolygonCorner,
    hi: PolygonCorner,
    rows_per_unit: f64,
    /// End of each row in `members`.
    ends: Vec<usize>,
    /// Indices of edges, row after row, in each those of a polygon one after the other.
    members: Vec<u32>,
    edges: Vec<PolygonEdge>,
}

#[derive(Debug, Clone, Copy)]
struct PolygonEdge {
    /// The end of smaller y; the other one.
    low: PolygonCorner,
    high: PolygonCorner,
    polygon: u32,
}

/// How a point lies to an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum EdgeSide {
    On,
    /// The ray from the point towards larger x meets it.
    Met,
    Missed,
}

impl PolygonEdge {
    fn of(from: PolygonCorner, to: PolygonCorner, polygon: u32) -> Self {
        let (low, high) = if from[1] <= to[1] { (from, to) } else { (to, from) };
        PolygonEdge { low, high, polygon }
    }

    fn left(&self) -> f64 {
        self.low[0].min(self.high[0])
    }

    fn right(&self) -> f64 {
        self.low[0].max(self.high[0])
    }

    /// An edge has its lower end and not its upper one, so that a ray through a corner meets one of
    /// two edges that go on, and both or none of two that turn back.
    #[inline]
    fn side(&self, [x, y]: PolygonCorner) -> EdgeSide {
        if y < self.low[1] || y > self.high[1] || x > self.right() {
            return EdgeSide::Missed;
        }
        let is_below_end = y < self.high[1];
        if x < self.left() {
            return if is_below_end { EdgeSide::Met } else { EdgeSide::Missed };
        }
        match turn(self.low, self.high, [x, y]) {
            0.0 => EdgeSide::On,
            turn if turn > 0.0 && is_below_end => EdgeSide::Met,
            _ => EdgeSide::Missed,
        }
    }

    /// True if the insides of both edges have one point in common.
    fn crosses(&self, other: &PolygonEdge) -> bool {
        let apart = self.right() < other.left() || other.right() < self.left();
        let divides = |edge: &PolygonEdge, of: &PolygonEdge| {
            let [a, b] = [of.low, of.high].map(|end| turn(edge.low, edge.high, end));
            a > 0.0 && b < 0.0 || a < 0.0 && b > 0.0
        };
        !apart && divides(self, other) && divides(other, self)
    }
}

/// Above 0 if `p` is left of the way from `a` to `b`, 0 on the line through both.
fn turn(a: PolygonCorner, b: PolygonCorner, p: PolygonCorner) -> f64 {
    let coord = |[x, y]: PolygonCorner| Coord { x, y };
    orient2d(coord(a), coord(b), coord(p))
}

impl Area {
    /// What is in one of `polygons`, whose corners are finite.
    pub fn of(polygons: &[PolygonRings]) -> Area {
        let mut edges = Vec::new();
        for (polygon, rings) in (0u32..).zip(polygons) {
            for ring in rings {
                let next = ring.iter().cycle().skip(1);
                edges.extend(ring.iter().zip(next).map(|(a, b)| PolygonEdge::of(*a, *b, polygon)));
            }
        }
        let (mut lo, mut hi) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for corner in polygons.iter().flatten().flatten() {
            for axis in 0..2 {
                lo[axis] = lo[axis].min(corner[axis]);
                hi[axis] = hi[axis].max(corner[axis]);
            }
        }
        let height = hi[1] - lo[1];
        let spans: f64 = edges.iter().map(|edge| edge.high[1] - edge.low[1]).sum();
        let most = edges.len().max(1);
        let rows = ((IN_ROWS - 1.0) * edges.len() as f64 * (height / spans)) as usize;
        let rows = rows.clamp(1, most);
        let mut area = Area {
            lo,
            hi,
            rows_per_unit: rows as f64 / height,
            ends: vec![0; rows],
            members: Vec::new(),
            edges,
        };
        area.fill();
        area
    }

    /// Puts each edge into the rows that it is in.
    fn fill(&mut self) {
        let rows: Vec<_> =
            self.edges.iter().map(|edge| self.row(edge.low[1])..=self.row(edge.high[1])).collect();
        rows.iter().cloned().flatten().for_each(|row| self.ends[row] += 1);
        let mut begin = 0;
        for end in &mut self.ends {
            begin += std::mem::replace(end, begin);
        }
        self.members = vec![0; begin];
        for (edge, rows) in (0u32..).zip(rows) {
            for row in rows {
                self.members[self.ends[row]] = edge;
                self.ends[row] += 1;
            }
        }
    }

    /// The row of a y between those of the corners. It never falls as y grows, so that the rows of
    /// an edge hold every y between its ends.
    fn row(&self, y: f64) -> usize {
        // NaN, where all corners have one y, is row 0.
        (((y - self.lo[1]) * self.rows_per_unit) as usize).min(self.ends.len() - 1)
    }

    fn edges_of(&self, row: usize) -> impl Iterator<Item = &PolygonEdge> + Clone {
        let begin = row.checked_sub(1).map_or(0, |before| self.ends[before]);
        self.members[begin..self.ends[row]].iter().map(|&edge| &self.edges[edge as usize])
    }

    /// The smallest and the largest coordinates of its corners.
    pub fn bounds(&self) -> [PolygonCorner; 2] {
        [self.lo, self.hi]
    }

    /// True if the point is in one of the polygons or on the border of one; false of one whose
    /// coordinates are no numbers.
    pub fn contains(&self, p: PolygonCorner) -> bool {
        if !(0..2).all(|axis| self.lo[axis] <= p[axis] && p[axis] <= self.hi[axis]) {
            return false;
        }
        let (mut polygon, mut is_in) = (0, false);
        for edge in self.edges_of(self.row(p[1])) {
            if edge.polygon != polygon {
                if is_in {
                    return true;
                }
                polygon = edge.polygon;
            }
            match edge.side(p) {
                EdgeSide::On => return true,
                EdgeSide::Met => is_in = !is_in,
                EdgeSide::Missed => {}
            }
        }
        is_in
    }

    /// An end of an edge that crosses another of its polygon, if there is one among the pairs of
    /// edges that are looked at: all, but of areas of a million corners and more.
    pub fn crossing(&self) -> Option<PolygonCorner> {
        let mut pairs = 0;
        for row in 0..self.ends.len() {
            let mut others = self.edges_of(row);
            while let Some(edge) = others.next() {
                let of_it = others.clone().filter(|other| other.polygon == edge.polygon);
                if of_it.clone().any(|other| edge.crosses(other)) {
                    return Some(edge.low);
                }
                pairs += of_it.count();
                if pairs > MOST_PAIRS {
                    return None;
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests;
