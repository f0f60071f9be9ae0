"""The figures against shapes whose distances are known: `python -m unittest` in this folder."""

import unittest

import numpy as np

from figures import Judge, surface_distances
from mesh import Mesher
from scenes import Scene


def ball(count: int, seed: int) -> np.ndarray:
    """Uniform on the unit sphere."""
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1)[:, None]


def square(count: int, seed: int, side: float = 1.0) -> np.ndarray:
    """Uniform on a square at height 0."""
    return np.c_[np.random.default_rng(seed).random((count, 2)) * side, np.zeros(count)]


class Meshes(unittest.TestCase):
    def test_a_sphere_s_mesh_is_closed_and_has_its_number_of_triangles(self):
        kept = ball(300, 1)
        triangles = Mesher(ball(60_000, 2)).triangles(kept, 0.5)
        self.assertEqual(len(triangles), 2 * len(kept) - 4)
        sides = np.sort(np.concatenate([triangles[:, [i, i - 1]] for i in range(3)]), 1)
        self.assertTrue((np.unique(sides, axis=0, return_counts=True)[1] == 2).all())

    def test_a_sphere_is_outside_of_its_mesh_by_the_sagitta(self):
        kept = ball(2_000, 1)
        found = Mesher(ball(60_000, 2)).distances(ball(5_000, 3), kept, 0.3)
        # A triangle whose corners are on a circle of radius r is 1 - sqrt(1 - r²) below the sphere.
        circle = np.sqrt(4 * np.pi / 2_000)
        self.assertLess(found.max(), 1 - np.sqrt(1 - (2.5 * circle) ** 2))
        self.assertGreater(np.median(found), 0.1 * circle**2)

    def test_on_a_plane_the_distance_is_the_height(self):
        kept, samples = square(400, 1), square(2_000, 3, 0.8) + [0.1, 0.1, 0.02]
        found = Mesher(square(20_000, 2)).distances(samples, kept, 0.2)
        np.testing.assert_allclose(found, 0.02, atol=1e-5)

    def test_two_sheets_are_not_joined(self):
        above = [0, 0, 0.3]
        scan = np.concatenate([square(20_000, 2), square(20_000, 4) + above])
        kept = np.concatenate([square(400, 1), square(400, 5) + above])
        triangles = Mesher(scan).triangles(kept, 0.2)
        self.assertGreater(len(triangles), 1_400)
        heights = np.ptp(kept[triangles][:, :, 2], axis=1)
        self.assertEqual(heights.max(), 0)

    def test_a_corner_that_is_not_kept_is_cut_and_one_that_is_kept_is_not(self):
        floor, up = square(20_000, 2), square(20_000, 4)[:, [2, 0, 1]]
        scan = np.concatenate([floor, up])
        inner = scan[np.abs(scan).max(1) > 0.1]
        cut = inner[(inner[:, [0, 2]].max(1) > 0.1)][:: 20]
        edge = np.c_[np.zeros(200), np.linspace(0, 1, 200), np.zeros(200)]
        samples = edge[20:-20] + [0.0, 0.0001, 0.0]
        without = Mesher(scan).distances(samples, cut, 0.2)
        within = Mesher(scan).distances(samples, np.concatenate([cut, edge]), 0.2)
        self.assertGreater(without.min(), 0.05)
        self.assertLess(within.max(), 1e-3)


class Surface(unittest.TestCase):
    def test_distance_to_planes_is_the_height(self):
        samples = square(500, 3) + [0, 0, 0.07]
        for distances in surface_distances(samples, square(300, 1)).values():
            np.testing.assert_allclose(distances, 0.07, atol=1e-9)

    def test_a_scan_that_is_kept_whole_has_no_excess(self):
        scan = square(5_000, 1) + np.random.default_rng(2).normal(size=(5_000, 3)) * [0, 0, 0.01]
        found = Judge(Scene(scan, square(1_000, 3))).figures(scan)
        self.assertEqual((found["p99"], found["coverage_max"]), (0.0, 0.0))
        self.assertGreater(found["mesh_p99"], 0.005)


if __name__ == "__main__":
    unittest.main()
