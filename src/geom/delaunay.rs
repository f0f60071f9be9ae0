//! The Delaunay triangulation of places in a plane, as polygons that are the same whatever was
//! triangulated besides.
//!
//! A triangulation of points on a grid is not unique: the four corners of a square lie on one
//! circle, and either diagonal does. Which one a library draws depends on the order in which it
//! came to the points, so two triangulations that overlap would not fit together. Unique are the
//! *Delaunay polygons*: all points on a circle that holds no other. So triangles whose circles are
//! the same, by exact arithmetic, are merged here again, and whoever draws a polygon as a fan from
//! its first corner draws the same triangles as anybody else.
//!
//! Places are whole numbers, of which a `f64` holds those below 2^53, and the predicates are exact
//! (`robust`, Shewchuk), so nothing depends on rounding but the radius that is compared, which is a
//! function of three corners alone.

use std::ops::Range;

use robust::{Coord, incircle};
use spade::handles::{DirectedEdgeHandle, FixedVertexHandle};
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};

use crate::{Error, Result};

/// Places may be so far apart on an axis, in steps: a `f64` holds all whole numbers up to here.
pub const WIDEST: u64 = 1 << 53;

type PlaneMesh = DelaunayTriangulation<Point2<f64>>;
type MeshEdge<'a> = DirectedEdgeHandle<'a, Point2<f64>, (), (), ()>;

/// A triangulation.
pub struct Delaunay(PlaneMesh);

impl Delaunay {
    /// Bytes that it holds for each place: a corner, three edges of two halves, two faces, and
    /// whether these were seen.
    pub const BYTES: usize = 24 + 3 * 32 + 2 * 8 + 2;

    /// [Triangulates](triangulated) places that are whole numbers below [`WIDEST`], each once.
    ///
    /// # Errors
    ///
    /// Places that are no numbers, and those of `go_on`.
    pub fn of(
        places: impl ExactSizeIterator<Item = [f64; 2]>,
        go_on: impl Fn() -> Result<()>,
    ) -> Result<Delaunay> {
        let count = places.len();
        let mesh = triangulated(places.map(|[x, y]| Point2::new(x, y)), go_on)?;
        match mesh.num_vertices() == count {
            true => Ok(Delaunay(mesh)),
            false => Err(Error::internal("a place came to be triangulated twice")),
        }
    }

    /// Calls `visit` with the corners of each polygon whose first corner is one of `mine` and whose
    /// circle has a radius of up to `max_radius`: numbers of places, counter-clockwise from the
    /// smallest on.
    pub fn each_polygon(
        &self,
        mine: &Range<usize>,
        max_radius: Option<f64>,
        mut visit: impl FnMut(&[u32]),
    ) {
        let mut seen = vec![false; self.0.num_all_faces()];
        let (mut ring, mut open) = (Vec::new(), Vec::new());
        for face in self.0.inner_faces() {
            let is_mine = |edge: &MeshEdge<'_>| mine.contains(&edge.from().index());
            let edges = face.adjacent_edges();
            if seen[face.index()] || !edges.iter().any(is_mine) {
                continue;
            }
            seen[face.index()] = true;
            ring.clear();
            open.extend(edges.into_iter().rev());
            while let Some(edge) = open.pop() {
                match same_circle(&edge) {
                    None => ring.push(edge.from().index() as u32),
                    Some(across) => {
                        if let Some(face) = across.face().as_inner() {
                            seen[face.index()] = true;
                        }
                        open.extend([across.prev(), across.next()]);
                    }
                }
            }
            let first = (0..ring.len()).min_by_key(|&n| ring[n]).unwrap_or_default();
            ring.rotate_left(first);
            let is_small = || max_radius.is_none_or(|most| self.is_within(&ring, most));
            if mine.contains(&(ring[0] as usize)) && is_small() {
                visit(&ring);
            }
        }
    }

    /// True if the circle of a polygon has a radius of up to `most`, by its first three corners: a
    /// radius is the product of a triangle's sides over four times its area.
    fn is_within(&self, ring: &[u32], most: f64) -> bool {
        let [a, b, c] = [0, 1, 2]
            .map(|n| self.0.vertex(FixedVertexHandle::from_index(ring[n] as usize)).position());
        let side = |p: Point2<f64>, q: Point2<f64>| [q.x - p.x, q.y - p.y];
        let (ab, bc, ca) = (side(a, b), side(b, c), side(c, a));
        let square = |[x, y]: [f64; 2]| x * x + y * y;
        let twice = (ab[0] * bc[1] - ab[1] * bc[0]) * most;
        square(ab) * square(bc) * square(ca) <= 4.0 * twice * twice
    }
}

/// The triangulation of corners in their order; fastest where one is near the one before, from
/// which it is looked for. `go_on` is asked now and then.
///
/// # Errors
///
/// Corners that are nowhere, and those of `go_on`.
pub fn triangulated<V: HasPosition<Scalar = f64>>(
    corners: impl ExactSizeIterator<Item = V>,
    go_on: impl Fn() -> Result<()>,
) -> Result<DelaunayTriangulation<V>> {
    let count = corners.len();
    let mut mesh = DelaunayTriangulation::with_capacity(count, 3 * count, 2 * count);
    let mut last = None;
    for (n, corner) in corners.enumerate() {
        if n.is_multiple_of(1 << 14) {
            go_on()?;
        }
        let added = match last {
            None => mesh.insert(corner),
            Some(near) => mesh.insert_with_hint(corner, near),
        };
        let failed = |e| Error::internal("a corner cannot be triangulated").because(e);
        last = Some(added.map_err(failed)?);
    }
    Ok(mesh)
}

/// The other half of an edge, if the triangle there has the circle of the one here.
fn same_circle<'a>(edge: &MeshEdge<'a>) -> Option<MeshEdge<'a>> {
    let across = edge.rev();
    let opposite = across.opposite_vertex()?;
    let coordinate = |p: Point2<f64>| Coord { x: p.x, y: p.y };
    let corners = [edge.from(), edge.to(), edge.opposite_vertex()?, opposite];
    let [a, b, c, d] = corners.map(|corner| coordinate(corner.position()));
    (incircle(a, b, c, d) == 0.0).then_some(across)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygons(places: &[[i64; 2]], mine: Range<usize>, most: Option<f64>) -> Vec<Vec<u32>> {
        let numbers = places.iter().map(|p| p.map(|v| v as f64));
        let mut all = Vec::new();
        Delaunay::of(numbers, || Ok(()))
            .unwrap()
            .each_polygon(&mine, most, |ring| all.push(ring.to_vec()));
        all.sort();
        all
    }

    /// All circles through three places that hold no other, with all places on them.
    fn by_definition(places: &[[i64; 2]]) -> Vec<Vec<u32>> {
        let at = |n: usize| [i128::from(places[n][0]), i128::from(places[n][1])];
        let turn = |a: usize, b: usize, c: usize| {
            let ([ax, ay], [bx, by], [cx, cy]) = (at(a), at(b), at(c));
            (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        };
        let in_circle = |a: usize, b: usize, c: usize, d: usize| {
            let row = |p: usize| {
                let (x, y) = (at(p)[0] - at(d)[0], at(p)[1] - at(d)[1]);
                [x, y, x * x + y * y]
            };
            let [a, b, c] = [row(a), row(b), row(c)];
            a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
                + a[2] * (b[0] * c[1] - b[1] * c[0])
        };
        let n = places.len();
        let mut all = Vec::new();
        for a in 0..n {
            for b in 0..n {
                for c in 0..n {
                    let others = || (0..n).filter(|d| ![a, b, c].contains(d));
                    let is_first = a < b && a < c && turn(a, b, c) > 0;
                    if !is_first || others().any(|d| in_circle(a, b, c, d) > 0) {
                        continue;
                    }
                    let mut on: Vec<usize> =
                        others().filter(|&d| in_circle(a, b, c, d) == 0).collect();
                    on.extend([b, c]);
                    if on.iter().any(|&d| d < a) {
                        continue;
                    }
                    // On one circle, in the order of directions from the first.
                    on.sort_by(|&p, &q| 0.cmp(&turn(a, p, q)));
                    all.push([a].into_iter().chain(on).map(|d| d as u32).collect());
                }
            }
        }
        all.sort();
        all.dedup();
        all
    }

    #[test]
    fn polygons_are_the_circles_that_hold_no_other_place() {
        let grid: Vec<[i64; 2]> = (0..25).map(|n| [3 * (n % 5), 3 * (n / 5)]).collect();
        let mut octagon: Vec<[i64; 2]> =
            vec![[5, 2], [2, 5], [-2, 5], [-5, 2], [-5, -2], [-2, -5], [2, -5], [5, -2], [9, 9]];
        octagon.push([-9, 4]);
        let random: Vec<[i64; 2]> = (0..22u64)
            .map(|n| {
                let at = |seed| (crate::geom::hash::of_position(seed, [n as i64, 0, 0]) % 9) as i64;
                [at(1), at(2)]
            })
            .collect();
        for mut places in [grid, octagon, random, vec![[0, 0], [4, 0], [8, 0]], vec![[1, 1]]] {
            places.sort_unstable();
            places.dedup();
            let all = polygons(&places, 0..places.len(), None);
            assert_eq!(all, by_definition(&places), "{places:?}");
            // Each has its first corner in one part.
            let half = places.len() / 2;
            let mut parts = polygons(&places, 0..half, None);
            parts.extend(polygons(&places, half..places.len(), None));
            assert_eq!(parts, all);
        }
    }

    #[test]
    fn circles_are_held_against_a_radius() {
        let places = [[0, 0], [0, 8], [6, 0], [100, 100]];
        let ring = || vec![vec![0, 2, 1]];
        assert_eq!(polygons(&places[..3], 0..3, Some(5.0)), ring(), "a radius of 5");
        assert!(polygons(&places[..3], 0..3, Some(4.99)).is_empty());
        assert_eq!(polygons(&places, 0..4, Some(20.0)), ring());
    }
}
