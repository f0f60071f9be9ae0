"""The page from made-up results; needs nothing but Python: `python3 -m unittest test_page`."""

import json
import tempfile
import unittest
from pathlib import Path

import draw
from results import beside_ours, cells, lines

FIGURES = ("p99", "mesh_p99", "mesh_rms", "coverage_rms", "coverage_max")


def row(contender: str, value: float, kept: int = 100, **more) -> dict:
    head = {"scene": "sphere", "seed": 0, "share": 0.1, "contender": contender}
    counts = {"wanted": 100, "kept": kept, "seconds": 1.0}
    return head | counts | dict.fromkeys(FIGURES, value) | more


class Pages(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def files(self, rows: list[dict], prototype: float = 1.0) -> tuple[Path, Path]:
        results, bars = self.folder / "results.jsonl", self.folder / "bars.json"
        results.write_text("".join(json.dumps(each) + "\n" for each in rows), encoding="utf-8")
        bar = {"scene": "sphere", "seed": 0, "share": 0.1, "p99": prototype}
        bars.write_text(json.dumps({"cells": [bar]}), encoding="utf-8")
        return results, bars

    def cell(self, *rows: dict):
        (found,) = cells(*self.files(list(rows)))
        return found

    def test_the_best_other_keeps_as_many_records_and_is_not_pointmill(self):
        found = self.cell(row("graded", 1.0), row("voxel", 4.0), row("random", 2.0),
                          row("Poisson disk", 0.5, kept=104), row("CGAL WLOP", 0.5),
                          row("pointmill paper", 0.5))
        self.assertEqual(found.best("p99"), "random")
        self.assertEqual(found.beside_best("mesh_p99"), 0.5)

    def test_a_figure_has_a_best_of_its_own(self):
        found = self.cell(row("graded", 1.0), row("voxel", 2.0), row("random", 3.0, mesh_rms=0.5))
        self.assertEqual((found.best("p99"), found.best("mesh_rms")), ("voxel", "random"))

    def test_rows_are_means_over_seeds(self):
        other = {"seed": 1}
        (line,) = lines(cells(*self.files([
            row("graded", 1.0), row("voxel", 2.0),
            row("graded", 1.0, **other), row("voxel", 10.0, **other)])))
        self.assertAlmostEqual(line.mean(lambda cell: cell.beside_best("p99")), 0.3)
        self.assertEqual(line.mean(lambda cell: cell.beside_prototype()), 1.0)

    def test_a_contender_s_mean_is_geometric_over_cells_of_equal_number(self):
        found = cells(*self.files([row("graded", 1.0), row("voxel", 2.0),
                                   row("graded", 1.0, seed=1), row("voxel", 8.0, seed=1),
                                   row("graded", 1.0, seed=2), row("voxel", 90.0, 110, seed=2)]))
        mean, count = beside_ours(found, "voxel", "p99")
        self.assertAlmostEqual(mean, 4.0)
        self.assertEqual(count, 2)

    def test_every_loss_is_said(self):
        texts = draw.drawn(*self.files([row("graded", 1.0), row("voxel", 2.0, mesh_p99=0.8)]))
        self.assertIn("mesh error: sphere at 10%, seed 0: voxel is truer; `graded` has 1.25 ×",
                      texts["quality.md"])
        self.assertNotIn("surface error: sphere", texts["quality.md"])

    def test_a_cell_above_the_prototype_is_said(self):
        rows = [row("graded", 1.0), row("voxel", 2.0)]
        above = draw.drawn(*self.files(rows, prototype=0.9))["quality.md"]
        self.assertIn("in 1 cells: sphere at 10%, seed 0 (1.111)", above)
        self.assertNotIn("sphere at 10%, seed 0", draw.drawn(*self.files(rows))["quality.md"])

    def test_a_cell_without_others_is_said_and_counts_beside_the_prototype_alone(self):
        alone = row("graded", 3.0, share=0.03)
        files = self.files([row("graded", 1.0), row("voxel", 2.0), alone])
        bar = {"scene": "sphere", "seed": 0, "share": 0.03, "p99": 1.0}
        files[1].write_text(json.dumps({"cells": [bar]}), encoding="utf-8")
        text = draw.drawn(*files)["quality.md"]
        self.assertIn("not measured yet in sphere at 3%, seed 0.", text)
        self.assertIn("in 1 cells: sphere at 3%, seed 0 (3.000)", text)
        self.assertNotIn("### 3% kept", text)

    def test_where_the_paper_loses_is_said(self):
        beside = self.folder / "methods.jsonl"
        shares = (0.05, 0.1)
        rows = [row(name, p99 * (1 + share), share=share) for share in shares
                for name, p99 in (("pointmill paper", 2.0), ("voxel", 1.0), ("graded", 0.5),
                                  ("every nth", 3.0), ("wavelet", 1.0))]
        beside.write_text("".join(json.dumps(each) + "\n" for each in rows), encoding="utf-8")
        files = self.files([row("graded", 1.0), row("voxel", 2.0)])
        texts = draw.drawn(*files, beside)
        self.assertIn("- sphere: at 5% (voxel); 10% (voxel)", texts["quality.md"])
        self.assertIn("| every nth | 1.50 |", texts["quality.md"])
        self.assertIn("<svg", texts["images/quality/methods.svg"])

    def test_the_check_finds_a_page_that_was_edited_or_is_missing(self):
        texts = draw.drawn(*self.files([row("graded", 1.0), row("voxel", 2.0)]))
        for name, text in texts.items():
            (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
            (self.folder / name).write_text(text, encoding="utf-8")
        self.assertEqual(draw.differing(self.folder, texts), [])
        (self.folder / "quality.md").write_text("edited", encoding="utf-8")
        (self.folder / "images/quality/mesh.svg").unlink()
        self.assertEqual(draw.differing(self.folder, texts),
                         ["quality.md", "images/quality/mesh.svg"])


if __name__ == "__main__":
    unittest.main()
