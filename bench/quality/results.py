"""What `results.jsonl` and `bars.json` say: ratios between contenders. Standard library only."""

import json
import math
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

OURS = "graded"
# Not among the others that `graded` is beside: pointmill's own, and who makes new points.
OWN = (OURS, "pointmill paper")
MOVES = ("CGAL WLOP",)
# A contender is at an equal number if what it keeps is off by less than this share.
EQUAL = 0.03

Row = dict[str, float]


@dataclass
class Cell:
    """One scene, seed and share: the figures of all contenders, by name."""

    scene: str
    seed: int
    share: float
    rows: dict[str, Row]
    prototype: float | None = None

    @property
    def compared(self) -> bool:
        """Whether others are measured, too."""
        return "voxel" in self.rows

    @property
    def ours(self) -> Row:
        return self.rows[OURS]

    def others(self) -> dict[str, Row]:
        """Who keeps as many records of the scan and is not pointmill."""
        return {name: row for name, row in self.rows.items()
                if name not in OWN + MOVES and equal(row)}

    def best(self, figure: str) -> str:
        """The other contender of the smallest figure."""
        others = self.others()
        return min(others, key=lambda name: others[name][figure])

    def beside_best(self, figure: str) -> float:
        """`graded` as a share of the best other."""
        return self.ours[figure] / self.rows[self.best(figure)][figure]

    def beside_prototype(self) -> float | None:
        return self.ours["p99"] / self.prototype if self.prototype else None

    def beside_voxel(self, figure: str) -> float:
        return self.ours[figure] / self.rows["voxel"][figure]


def equal(row: Row) -> bool:
    return abs(row["kept"] / row["wanted"] - 1) < EQUAL


def cells(results: Path, bars: Path) -> list[Cell]:
    """Cells in which `graded` is measured, in file order."""
    prototype = {(bar["scene"], bar["seed"], bar["share"]): bar["p99"]
                 for bar in json.loads(bars.read_text(encoding="utf-8"))["cells"]}
    rows: dict[tuple, dict[str, Row]] = defaultdict(dict)
    for line in results.read_text(encoding="utf-8").splitlines():
        row = json.loads(line)
        rows[row["scene"], row["seed"], row["share"]][row["contender"]] = row
    return [Cell(*key, found, prototype.get(key)) for key, found in rows.items() if OURS in found]


@dataclass
class Line:
    """One line of a table: the cells of a scene and a share, one a seed. Ratios are their means."""

    scene: str
    share: float
    cells: list[Cell]

    def mean(self, ratio) -> float | None:
        found = [value for cell in self.cells if (value := ratio(cell)) is not None]
        return sum(found) / len(found) if found else None

    def best(self, figure: str) -> str:
        """The best others of the seeds."""
        return ", ".join(dict.fromkeys(cell.best(figure) for cell in self.cells))


def lines(all_cells: list[Cell]) -> list[Line]:
    grouped: dict[tuple[float, str], list[Cell]] = defaultdict(list)
    for cell in all_cells:
        grouped[cell.share, cell.scene].append(cell)
    shares = sorted({share for share, _ in grouped})
    return [Line(scene, share, found) for wanted in shares
            for (share, scene), found in grouped.items() if share == wanted]


def geometric(values: list[float]) -> float:
    return math.exp(sum(map(math.log, values)) / len(values))


def beside_ours(all_cells: list[Cell], name: str, figure: str) -> tuple[float, int] | None:
    """A contender's figure as a multiple of `graded`'s: geometric mean, and over how many cells."""
    found = [cell.rows[name][figure] / cell.ours[figure] for cell in all_cells
             if name in cell.rows and equal(cell.rows[name])]
    return (geometric(found), len(found)) if found else None
