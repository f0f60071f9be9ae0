"""Distance to a mesh of kept points: the figure that no contender chooses by.

The mesh is the kept points' Delaunay triangulation restricted to the scan: a triangle of the
three-dimensional triangulation belongs to it where the edge of the Voronoi diagram that is dual
to it meets the scan, that is, where somewhere on the surface its three corners are the nearest
kept points and equally near (Edelsbrunner and Shah 1997; Amenta and Bern 1999). It is what
surface reconstruction from the kept points is after, with the scan to say which triangles are
right, so that no reconstruction's parameter favours anybody. "Meets" is: comes as near to a point
of the scan as the eighth neighbour is of it or of one of these eight.

At the border of a scan the dual edge of a flat triangle passes beside the scan. There triangles
are added whose own middle meets the scan and that have a side with a single triangle.
"""

import numpy as np
import open3d
from scipy.spatial import Delaunay, cKDTree

NEIGHBORS = 8


class Mesher:
    """Meshes of points kept of one scan (n × 3)."""

    def __init__(self, scan: np.ndarray):
        self.tree = cKDTree(scan)
        away, near = self.tree.query(scan, k=NEIGHBORS + 1)
        self.spacing = away[:, -1][near].max(1)

    def triangles(self, kept: np.ndarray, gap: float) -> np.ndarray:
        """Corners of the triangles, as indices of kept points (m × 3).

        No point of the scan is farther than `gap` from a kept one.
        """
        middle, normal, low, high, corners = dual_edges(kept)
        radius2 = ((kept[corners[:, 0]] - middle) ** 2).sum(1)
        # A place that is farther than the gap from its nearest kept points is not on the surface.
        reach = np.sqrt(np.maximum((1.05 * gap) ** 2 - radius2, 0))
        low, high = np.maximum(low, -reach), np.minimum(high, reach)
        possible = np.flatnonzero((reach > 0) & (low <= high))
        met = np.zeros(len(corners), bool)
        met[possible] = self.meets(*(all[possible] for all in (middle, normal, low, high)))
        return corners[self.with_border(kept, corners, met)]

    def with_border(self, kept: np.ndarray, corners: np.ndarray, met: np.ndarray) -> np.ndarray:
        """`met` and the triangles beside its open sides whose middle is on the scan."""
        beside = np.flatnonzero(beside_open_side(corners, met, len(kept)))
        distance, nearest = self.tree.query(kept[corners[beside]].mean(1))
        met = met.copy()
        met[beside] = distance <= self.spacing[nearest]
        return met

    def meets(self, middle: np.ndarray, normal: np.ndarray, at: np.ndarray, end: np.ndarray):
        """Which segments, from `at` to `end` along normals from middles, come near the scan."""
        met = np.zeros(len(at), bool)
        at, walking = at.copy(), np.arange(len(at))
        while len(walking):
            place = middle[walking] + at[walking, None] * normal[walking]
            distance, nearest = self.tree.query(place)
            near = self.spacing[nearest]
            met[walking] = distance <= near
            # Nothing of the scan is nearer than its distance: that far nothing need be looked at.
            # The end itself is looked at, too.
            step = np.maximum(distance - near, 0.25 * near)
            step = np.maximum(step, 1e-3 * (end[walking] - at[walking]) + 1e-12)
            left = ~met[walking] & (at[walking] < end[walking])
            at[walking] = np.minimum(at[walking] + step, end[walking])
            walking = walking[left]
        return met

    def distances(self, samples: np.ndarray, kept: np.ndarray, gap: float) -> np.ndarray:
        """Of samples to the mesh or, in a hole of it, to the nearest kept point if nearer."""
        nearest, _ = cKDTree(kept).query(samples)
        triangles = self.triangles(kept, gap)
        if len(triangles) == 0:
            return nearest
        origin = kept.mean(0)  # Open3D's meshes are of f32
        scene = open3d.t.geometry.RaycastingScene(nthreads=1)
        scene.add_triangles((kept - origin).astype(np.float32), triangles.astype(np.uint32))
        to_mesh = scene.compute_distance((samples - origin).astype(np.float32), nthreads=1).numpy()
        return np.minimum(nearest, to_mesh)


def dual_edges(points: np.ndarray):
    """Triangles of a Delaunay triangulation, and the edges of the Voronoi diagram dual to them.

    An edge lies on the axis of its triangle: from the middle of the circle through its corners
    along the normal, from `low` to `high` (infinite where the triangle is on the hull).
    """
    # Moved by a ten-millionth of the extent: grids and planes have no triangulation of their own.
    random = np.random.default_rng(11)
    moved = points + 1e-7 * np.ptp(points) * random.uniform(-1, 1, points.shape)
    solid = Delaunay(moved)
    tetrahedra, beyond = solid.simplices, solid.neighbors
    centre = circumcentres(moved[tetrahedra])
    which, opposite = np.nonzero((beyond < 0) | (np.arange(len(beyond))[:, None] < beyond))
    other = beyond[which, opposite]
    corners = tetrahedra[which][np.arange(4) != opposite[:, None]].reshape(-1, 3)
    middle, normal = circles(*(moved[corners[:, i]] for i in range(3)))
    outside = -np.sign(dot(moved[tetrahedra[which, opposite]] - middle, normal))
    first = dot(centre[which] - middle, normal)
    second = np.where(other < 0, outside * np.inf, dot(centre[other] - middle, normal))
    return middle, normal, np.minimum(first, second), np.maximum(first, second), corners


def beside_open_side(corners: np.ndarray, met: np.ndarray, count: int) -> np.ndarray:
    """Which of the other triangles have a side that a single triangle of `met` has."""
    sides = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]].astype(np.int64), 2)
    names = sides[:, :, 0] * count + sides[:, :, 1]
    name, times = np.unique(names[met], return_counts=True)
    return np.isin(names, name[times == 1]).any(1) & ~met


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(1)


def circles(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middles of the circles through three corners, and their unit normals."""
    b, c = b - a, c - a
    normal = np.cross(b, c)
    area2 = np.maximum(dot(normal, normal), 1e-300)[:, None]
    toward = np.cross(dot(b, b)[:, None] * c - dot(c, c)[:, None] * b, normal)
    return a + toward / (2 * area2), normal / np.sqrt(area2)


def circumcentres(corners: np.ndarray) -> np.ndarray:
    """Of tetrahedra (n × 4 × 3). Flat ones have theirs far away."""
    edges = corners[:, 1:] - corners[:, :1]
    volume = np.linalg.det(edges)
    flat = np.abs(volume) < 1e-300
    edges[flat] = np.eye(3)
    squares = 0.5 * (edges**2).sum(2)
    return corners[:, 0] + np.linalg.solve(edges, squares[:, :, None])[:, :, 0]
