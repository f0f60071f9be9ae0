"""How a number is met, and what a cell keeps: `python -m unittest` in this folder."""

import tempfile
import unittest
from pathlib import Path

import numpy as np

from contenders import Job, poisson, random, voxel
from counts import matched, voxel_kept, voxel_side
from keep import Bench, store
from measure import kept_of, rows, write
from scenes import held_out


def square(count: int) -> np.ndarray:
    return np.c_[np.random.default_rng(1).random((count, 2)), np.zeros(count)]


class Counts(unittest.TestCase):
    def test_a_setting_is_found_that_keeps_the_number(self):
        kept, setting = matched(lambda s: range(int(1000 / s)), 125, 1, 100, 30, 0.01)
        self.assertAlmostEqual(len(kept), 125, delta=2)
        self.assertAlmostEqual(setting, 8, delta=0.2)

    def test_the_nearest_number_is_given_where_none_fits(self):
        kept, _ = matched(lambda s: range(300 if s < 10 else 90), 100, 1, 100, 12, 0.01)
        self.assertEqual(len(kept), 90)

    def test_a_voxel_grid_keeps_one_point_a_cube_the_nearest_to_its_middle(self):
        points = np.array([[0.1, 0.1, 0.1], [0.5, 0.4, 0.5], [0.9, 0.9, 0.9], [1.5, 0.5, 0.5]])
        np.testing.assert_array_equal(voxel_kept(points, 1.0), [1, 3])

    def test_the_side_of_a_voxel_grid_keeps_the_number(self):
        points = square(20_000)
        self.assertAlmostEqual(len(voxel_kept(points, voxel_side(points, 400))), 400, delta=8)


class Contenders(unittest.TestCase):
    def test_they_keep_different_points_of_the_scan_near_the_number(self):
        job = Job(square(5_000), 250, *[Path("-")] * 4)
        for keep in (voxel, random, poisson):
            kept = keep(job)
            self.assertEqual(len(np.unique(kept)), len(kept))
            self.assertAlmostEqual(len(kept), 250, delta=8)

    def test_no_poisson_disk_has_another_point_within_its_radius(self):
        job = Job(square(5_000), 250, *[Path("-")] * 4)
        kept = job.points[poisson(job)]
        apart = np.linalg.norm(kept[:, None] - kept[None], axis=2)
        nearest = np.sort(apart, axis=1)[:, 1]
        gap = np.linalg.norm(job.points[:, None] - kept[None], axis=2).min(1).max()
        self.assertGreater(nearest.min(), 0.9 * gap)


class Cells(unittest.TestCase):
    def test_only_who_keeps_the_number_is_judged(self):
        with tempfile.TemporaryDirectory() as folder:
            bench = Bench(*[Path("-")] * 3, None, Path(folder))
            (bench.folder / "kept").mkdir()
            points = square(1_000)
            for contender, count in (("voxel", 98), ("random", 96)):
                store(bench.kept_file("torus", 0, 0.1, contender), np.arange(count), 1.0)
            found = [kept_of(bench, ("torus", 0, 0.1, name), points)
                     for name in ("voxel", "random", "Poisson disk")]
        self.assertEqual(len(found[0]["kept"]), 98)
        self.assertEqual(found[1:], [None, None])

    def test_results_are_written_in_the_order_of_the_tables_and_read_again(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "results.jsonl"
            cells = [("torus", 1, 0.1, "voxel"), ("torus", 0, 0.1, "voxel"),
                     ("roofs", 1, 0.01, "graded")]
            names = ("scene", "seed", "share", "contender")
            write(path, {cell: dict(zip(names, cell)) for cell in cells})
            self.assertEqual(list(rows(path)), [cells[2], cells[1], cells[0]])

    def test_samples_are_held_out_of_distinct_points(self):
        points = np.repeat(square(1_000) + 700, 2, axis=0)
        made = held_out(points, 3)
        self.assertEqual((len(made.samples), len(made.points)), (200, 800))
        both = np.concatenate([made.samples, made.points])
        self.assertEqual(len(np.unique(both, axis=0)), 1_000)
        self.assertTrue((both.min(0) >= 0).all() and (both.min(0) < 1).all())


if __name__ == "__main__":
    unittest.main()
