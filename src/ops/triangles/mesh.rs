//! A mesh of positions over a plane, which loses triangles one after the other.
//!
//! Triangles wait in a heap by their weight. When one goes, those around it are others, and join
//! the heap; what waited there and is no triangle any more is told from what is by looking for its
//! three corners in the mesh. So nothing needs to be found in the heap.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use spade::handles::{FixedVertexHandle, VertexHandle};
use spade::{DelaunayTriangulation, HasPosition, Point2, PositionInTriangulation, Triangulation};

use super::weights::{curvature, from_to, normal, size};
use crate::Result;
use crate::geom::delaunay::triangulated;
use crate::point::Position;

/// No corner.
const NONE: u32 = u32::MAX;
/// Corners around one that goes, at most: what filling its hole costs grows with their square, and
/// where a border that stays is dense, the last corners within it have all of it around them.
const MOST_AROUND: usize = 512;

/// A corner of the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
struct MeshCorner {
    /// Two axes across, then along the one that is looked along; steps from the scan's corner.
    at: [f64; 3],
    curvature: f64,
    /// Which position it is.
    position: u32,
}

impl HasPosition for MeshCorner {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        Point2::new(self.at[0], self.at[1])
    }
}

/// A triangle that waits: its weight as bits, which compare as it does, and its positions, the
/// smallest first, counter-clockwise.
type Waiting = Reverse<(u64, [u32; 3])>;

/// A mesh that is thinned.
pub(super) struct ThinnedMesh {
    mesh: DelaunayTriangulation<MeshCorner>,
    /// For each position its corner, if it is one that is left.
    handles: Vec<u32>,
    waiting: BinaryHeap<Waiting>,
    /// What counts of the curvature of a triangle wherever it is.
    least: f64,
    lo: Position,
    axis: usize,
}

impl ThinnedMesh {
    /// Bytes of a position: its corner, six half edges, two faces, and six triangles that wait.
    pub const BYTES: usize = 48 + 6 * 16 + 2 * 8 + 8 + 6 * size_of::<Waiting>() + 44;

    /// The mesh of positions, which are in Morton order, across an axis; asks now and then whether
    /// to go on.
    pub fn of(
        positions: &[Position],
        lo: Position,
        axis: usize,
        go_on: impl Fn() -> Result<()>,
    ) -> Result<ThinnedMesh> {
        let mut places: Vec<([u64; 2], u32)> =
            (0..positions.len()).map(|i| (across(positions[i], lo, axis), i as u32)).collect();
        places.sort_unstable();
        places.dedup_by_key(|place| place.0);
        let mut first: Vec<u32> = places.into_iter().map(|place| place.1).collect();
        first.sort_unstable();
        let mut handles = vec![NONE; positions.len()];
        let corner = |(n, &position): (usize, &u32)| {
            handles[position as usize] = n as u32;
            let at = place(positions[position as usize], lo, axis);
            MeshCorner { at, curvature: 0.0, position }
        };
        // Neighbours in Morton order are near each other.
        let mesh = triangulated(first.iter().enumerate().map(corner), go_on)?;
        let waiting = BinaryHeap::new();
        let mut mesh = ThinnedMesh { mesh, handles, waiting, least: 0.0, lo, axis };
        mesh.bend();
        mesh.wait_for_all();
        Ok(mesh)
    }

    /// Corners that are left.
    pub fn corners(&self) -> u64 {
        self.mesh.num_vertices() as u64
    }

    /// Corners on the border.
    pub fn border(&self) -> u64 {
        self.mesh.vertices().filter(is_on_border).count() as u64
    }

    /// Gives each corner its curvature.
    fn bend(&mut self) {
        let curvatures: Vec<f64> = self.mesh.vertices().map(|corner| bend_of(&corner)).collect();
        let triangles = 3.0 * curvatures.iter().sum::<f64>() / (curvatures.len() as f64).max(1.0);
        self.least = if triangles > 0.0 { triangles / 1000.0 } else { 1.0 };
        for (n, curvature) in curvatures.into_iter().enumerate() {
            self.mesh.vertex_data_mut(FixedVertexHandle::from_index(n)).curvature = curvature;
        }
    }

    fn wait_for_all(&mut self) {
        let all: Vec<Waiting> = self
            .mesh
            .inner_faces()
            .map(|face| self.waiting(face.vertices().map(|corner| *corner.data())))
            .collect();
        self.waiting = all.into();
    }

    fn waiting(&self, corners: [MeshCorner; 3]) -> Waiting {
        let bends: f64 = corners.iter().map(|corner| corner.curvature).sum();
        let weight = (bends + self.least) * size(corners.map(|corner| corner.at));
        let mut positions = corners.map(|corner| corner.position);
        let first = (0..3).min_by_key(|&n| positions[n]).unwrap_or_default();
        positions.rotate_left(first);
        Reverse((weight.to_bits(), positions))
    }

    /// Removes triangles until no more than `most` corners are left, or none can go; asks now and
    /// then whether to go on.
    pub fn thin(&mut self, most: u64, go_on: impl Fn() -> Result<()>) -> Result<()> {
        let mut seen = 0u64;
        while self.corners() > most {
            let Some(Reverse((_, positions))) = self.waiting.pop() else { break };
            seen += 1;
            if seen.is_multiple_of(1024) {
                go_on()?;
            }
            if !self.is_triangle(positions) {
                continue;
            }
            let mut by_bend = positions.map(|position| (self.corner(position).curvature, position));
            by_bend.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            let before = self.corners();
            for (_, position) in &by_bend[1..] {
                if self.corners() > most {
                    self.remove(*position);
                }
            }
            // The other two are on the border.
            if self.corners() == before {
                self.remove(by_bend[0].1);
            }
        }
        Ok(())
    }

    fn handle(&self, position: u32) -> Option<FixedVertexHandle> {
        let handle = self.handles[position as usize];
        (handle != NONE).then(|| FixedVertexHandle::from_index(handle as usize))
    }

    fn corner(&self, position: u32) -> MeshCorner {
        let handle = self.handle(position).unwrap_or(FixedVertexHandle::from_index(0));
        *self.mesh.vertex(handle).data()
    }

    /// True if these are the corners of a triangle of the mesh, counter-clockwise.
    fn is_triangle(&self, positions: [u32; 3]) -> bool {
        let [Some(a), Some(b), Some(c)] = positions.map(|position| self.handle(position)) else {
            return false;
        };
        let edge = self.mesh.get_edge_from_neighbors(a, b);
        let opposite = edge.and_then(|edge| edge.opposite_vertex());
        opposite.is_some_and(|opposite| opposite.fix() == c)
    }

    /// Removes a corner and lets the triangles in its place wait, unless it is on the border or has
    /// too many others around it.
    fn remove(&mut self, position: u32) {
        let Some(handle) = self.handle(position) else { return };
        let corner = self.mesh.vertex(handle);
        if is_on_border(&corner) {
            return;
        }
        let ring: Vec<u32> = corner.out_edges().map(|edge| edge.to().data().position).collect();
        if ring.len() > MOST_AROUND {
            return;
        }
        self.mesh.remove(handle);
        self.handles[position as usize] = NONE;
        // The last corner has the place of the one that went.
        if handle.index() < self.mesh.num_vertices() {
            let moved = self.mesh.vertex(handle).data().position;
            self.handles[moved as usize] = handle.index() as u32;
        }
        let new = self.within(&ring);
        self.waiting.extend(new);
    }

    /// The triangles within a ring of corners, counter-clockwise, that has no corner inside. They
    /// hang together as a tree, which is walked from the first edge of the ring inwards: corners of
    /// a border may have thousands of others around them, so each triangle is looked at once.
    fn within(&self, ring: &[u32]) -> Vec<Waiting> {
        let mut next: Vec<(u32, u32)> =
            ring.iter().copied().zip(ring.iter().cycle().skip(1).copied()).collect();
        let Some(ends) = next.first().map(|(from, to)| [self.handle(*from), self.handle(*to)])
        else {
            return Vec::new();
        };
        next.sort_unstable();
        let is_ring = |from: u32, to: u32| next.binary_search(&(from, to)).is_ok();
        let [Some(from), Some(to)] = ends else { return Vec::new() };
        let mut open: Vec<_> = self.mesh.get_edge_from_neighbors(from, to).into_iter().collect();
        let mut found = Vec::new();
        while let Some(edge) = open.pop() {
            let Some(face) = edge.face().as_inner() else { continue };
            found.push(self.waiting(face.vertices().map(|corner| *corner.data())));
            for side in [edge.next(), edge.prev()] {
                let [from, to] = side.vertices().map(|corner| corner.data().position);
                if !is_ring(from, to) {
                    open.push(side.rev());
                }
            }
        }
        found
    }

    /// How far each position is along the axis from the mesh that is left; NaN for its corners.
    pub fn distances(&self, positions: &[Position]) -> Vec<f32> {
        let mut hint = FixedVertexHandle::from_index(0);
        let mut distance = |(i, &p): (usize, &Position)| {
            if self.handles[i] != NONE {
                return f32::NAN;
            }
            let at = place(p, self.lo, self.axis);
            let found = self.mesh.locate_with_hint(Point2::new(at[0], at[1]), hint);
            let depth = match found {
                PositionInTriangulation::OnVertex(corner) => {
                    hint = corner;
                    self.mesh.vertex(corner).data().at[2]
                }
                PositionInTriangulation::OnEdge(edge) => {
                    let [a, b] = self.mesh.directed_edge(edge).vertices();
                    hint = a.fix();
                    along_edge(a.data().at, b.data().at, at)
                }
                PositionInTriangulation::OnFace(face) => {
                    let corners = self.mesh.face(face).vertices();
                    hint = corners[0].fix();
                    in_face(corners.map(|corner| corner.data().at), at)
                }
                // The border stays, so what is outside is on it but for rounding.
                PositionInTriangulation::OutsideOfConvexHull(edge) => {
                    let [a, b] = self.mesh.directed_edge(edge).vertices();
                    along_edge(a.data().at, b.data().at, at)
                }
                PositionInTriangulation::NoTriangulation => at[2],
            };
            (depth - at[2]).abs() as f32
        };
        positions.iter().enumerate().map(&mut distance).collect()
    }
}

/// Steps across the axis from the scan's corner.
fn across(p: Position, lo: Position, axis: usize) -> [u64; 2] {
    [1, 2].map(|by| {
        let axis = (axis + by) % 3;
        p[axis].wrapping_sub(lo[axis]) as u64
    })
}

/// Steps across the axis, and along it.
fn place(p: Position, lo: Position, axis: usize) -> [f64; 3] {
    let [u, v] = across(p, lo, axis);
    [u as f64, v as f64, p[axis].wrapping_sub(lo[axis]) as u64 as f64]
}

fn is_on_border(corner: &VertexHandle<'_, MeshCorner>) -> bool {
    corner.out_edges().any(|edge| edge.is_part_of_convex_hull())
}

fn bend_of(corner: &VertexHandle<'_, MeshCorner>) -> f64 {
    let at = corner.data().at;
    let mut sum = [0.0; 3];
    for edge in corner.out_edges() {
        if let Some(face) = edge.face().as_inner() {
            let [a, b, c] = face.vertices().map(|corner| corner.data().at);
            let normal = normal(a, b, c);
            sum = [sum[0] + normal[0], sum[1] + normal[1], sum[2] + normal[2]];
        }
    }
    curvature(at, sum, corner.out_edges().map(|edge| edge.to().data().at))
}

/// The depth at a place on an edge.
fn along_edge(a: [f64; 3], b: [f64; 3], at: [f64; 3]) -> f64 {
    let (edge, off) = (from_to(a, b), from_to(a, at));
    let length2 = edge[0] * edge[0] + edge[1] * edge[1];
    let part = ((off[0] * edge[0] + off[1] * edge[1]) / length2).clamp(0.0, 1.0);
    a[2] + part * edge[2]
}

/// The depth at a place in a triangle.
fn in_face([a, b, c]: [[f64; 3]; 3], at: [f64; 3]) -> f64 {
    let n = normal(a, b, c);
    let off = from_to(a, at);
    a[2] - (n[0] * off[0] + n[1] * off[1]) / n[2]
}

#[cfg(test)]
mod tests;
