"""How true a reduction is: kept points beside samples of the surface. Knows no contender.

surface   e_k of a sample is its distance to the least-squares plane of its k nearest kept points,
          for k = 5, 8 and 12. The unreduced scan has such distances, too (noise, and what k
          costs); their quantile F is taken from that of the reduction, E: the excess
          sqrt(E² - F²), averaged over the three k. `graded` chooses by planes of the same k.
mesh      distance of a sample to a mesh of the kept points, see mesh.py; nothing is subtracted.
          No contender chooses by it.
coverage  distance of points of the scan to the nearest kept one.
"""

import numpy as np
from scipy.spatial import cKDTree

from mesh import Mesher
from scenes import Scene

NEAREST = (5, 8, 12)
LOOKED_AT = 100_000


def plane_distances(samples: np.ndarray, kept: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Of each sample to the plane of the kept points whose indices are its row of `near`."""
    distances = np.empty(len(samples))
    for start in range(0, len(samples), 50_000):
        some = slice(start, start + 50_000)
        offsets = kept[near[some]]
        mean = offsets.mean(1)
        offsets = offsets - mean[:, None]
        _, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))
        distances[some] = np.abs(((samples[some] - mean) * axes[:, :, 0]).sum(1))
    return distances


def surface_distances(samples: np.ndarray, kept: np.ndarray) -> dict[int, np.ndarray]:
    """By number of nearest kept points."""
    _, near = cKDTree(kept).query(samples, k=max(NEAREST))
    return {k: plane_distances(samples, kept, near[:, :k]) for k in NEAREST}


class Judge:
    """Measures reductions of one scene."""

    def __init__(self, scene: Scene):
        self.samples = scene.samples
        random = np.random.default_rng(0)
        count = min(len(scene.points), LOOKED_AT)
        self.looked_at = scene.points[random.choice(len(scene.points), count, False)]
        self.unreduced = surface_distances(scene.samples, scene.points)
        self.mesher = Mesher(scene.points)

    def excess(self, distances: dict[int, np.ndarray], quantile: float) -> float:
        def of(k: int) -> float:
            reduced, floor = (np.quantile(d[k], quantile) for d in (distances, self.unreduced))
            return np.sqrt(max(reduced**2 - floor**2, 0))

        return float(np.mean([of(k) for k in NEAREST]))

    def figures(self, kept: np.ndarray) -> dict[str, float]:
        """Of kept positions, m × 3, m at least 12; lengths in the scene's unit."""
        distances = surface_distances(self.samples, kept)
        gaps, _ = cKDTree(kept).query(self.looked_at)
        to_mesh = self.mesher.distances(self.samples, kept, float(gaps.max()))
        return {
            "p99": self.excess(distances, 0.99),
            "mesh_p99": float(np.quantile(to_mesh, 0.99)),
            "mesh_rms": float(np.sqrt((to_mesh**2).mean())),
            "coverage_rms": float(np.sqrt((gaps**2).mean())),
            "coverage_max": float(gaps.max()),
        }
