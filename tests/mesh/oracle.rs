//! What a mesh is to be, by a triangulation of the whole scan and whole numbers.

use std::collections::BTreeMap;

use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};

/// A place of the plane and the number of its point.
#[derive(Clone, Copy)]
struct Corner {
    at: [i64; 2],
    number: usize,
}

impl HasPosition for Corner {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        Point2::new(self.at[0] as f64, self.at[1] as f64)
    }
}

/// Bits of both coordinates by turns, from the highest on.
fn morton(at: [i64; 2]) -> u128 {
    let bits = at.map(|v| (v as u64) ^ 1 << 63);
    (0..64).fold(0, |path, n| {
        let bit = |axis: usize| u128::from(bits[axis] >> n & 1);
        path | bit(0) << (2 * n) | bit(1) << (2 * n + 1)
    })
}

fn square(a: [i64; 2], b: [i64; 2]) -> i128 {
    let [x, y] = [0, 1].map(|n| i128::from(a[n] - b[n]));
    x * x + y * y
}

fn turn(a: [i64; 2], b: [i64; 2], c: [i64; 2]) -> i128 {
    let side = |p: [i64; 2]| [0, 1].map(|n| i128::from(p[n] - a[n]));
    let ([bx, by], [cx, cy]) = (side(b), side(c));
    bx * cy - by * cx
}

/// Above 0 if d is in the circle through a, b and c, which turn to the left.
fn in_circle(a: [i64; 2], b: [i64; 2], c: [i64; 2], d: [i64; 2]) -> i128 {
    let row = |p: [i64; 2]| {
        let [x, y] = [0, 1].map(|n| i128::from(p[n] - d[n]));
        [x, y, x * x + y * y]
    };
    let [a, b, c] = [row(a), row(b), row(c)];
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

/// The root of a set, of sets that are joined.
fn root(of: &mut [usize], mut n: usize) -> usize {
    while of[n] != n {
        of[n] = of[of[n]];
        n = of[n];
    }
    n
}

/// The triangles of points across the z axis whose circles have a radius of up to `most`, in the
/// order in which they are to be written. Of points in one place the lowest is a corner.
pub fn triangles(points: &[[i64; 3]], most: Option<i64>) -> Vec<[usize; 3]> {
    let mut lowest: BTreeMap<[i64; 2], usize> = BTreeMap::new();
    for (number, p) in points.iter().enumerate() {
        let known = lowest.entry([p[0], p[1]]).or_insert(number);
        if p[2] < points[*known][2] {
            *known = number;
        }
    }
    let corners = lowest.iter().map(|(&at, &number)| Corner { at, number }).collect();
    let mesh = DelaunayTriangulation::<Corner>::bulk_load(corners).unwrap();
    let faces: Vec<_> = mesh.inner_faces().collect();
    let number: BTreeMap<usize, usize> =
        faces.iter().enumerate().map(|(n, face)| (face.index(), n)).collect();
    // Faces of one circle are one polygon.
    let mut of: Vec<usize> = (0..faces.len()).collect();
    for edge in mesh.undirected_edges() {
        let edge = edge.as_directed();
        let (Some(a), Some(b)) = (edge.face().as_inner(), edge.rev().face().as_inner()) else {
            continue;
        };
        let [p, q, r] = a.vertices().map(|corner| corner.data().at);
        let opposite = edge.rev().opposite_vertex().unwrap().data().at;
        if in_circle(p, q, r, opposite) == 0 {
            let [a, b] = [a.index(), b.index()].map(|face| root(&mut of, number[&face]));
            of[a] = b;
        }
    }
    let mut polygons: BTreeMap<usize, Vec<Corner>> = BTreeMap::new();
    for (n, face) in faces.iter().enumerate() {
        let polygon = polygons.entry(root(&mut of, n)).or_default();
        polygon.extend(face.vertices().map(|corner| *corner.data()));
    }
    let mut fans = Vec::new();
    for mut polygon in polygons.into_values() {
        polygon.sort_by_key(|corner| morton(corner.at));
        polygon.dedup_by_key(|corner| corner.at);
        let (first, rest) = polygon.split_first_mut().unwrap();
        rest.sort_by(|p, q| 0.cmp(&turn(first.at, p.at, q.at)));
        let (a, b, c) = (first.at, rest[0].at, rest[1].at);
        let sides = square(a, b) * square(b, c) * square(c, a);
        let area = turn(a, b, c);
        if most.is_none_or(|most| sides <= 4 * area * area * i128::from(most) * i128::from(most)) {
            fans.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        }
    }
    fans.sort_by_key(|fan| fan.map(|corner| morton(corner.at)));
    fans.into_iter().map(|fan| fan.map(|corner| corner.number)).collect()
}
