"""The page docs/quality.md from the results. Standard library only."""

from collections.abc import Callable

from results import OURS, Cell, Line, beside_ours, geometric
from results import lines as lines_of

HEAD = """# How true a reduction by `graded` is

<!-- written by `python3 bench/quality/draw.py` from bench/quality/results.jsonl; do not edit -->

`pointmill reduce --keep N` beside other ways of keeping as many points, on ten scenes at 1, 3 and
10 % with two seeds, by one command: [bench/quality](../bench/quality/README.md). Six scenes are
made, of which the true surface is known; of a made airborne scan and three real ones, 40,000
points are held out (a fifth of the smallest). These samples of the surface are what judges:

- *Surface error*: the distance of a sample to the least-squares plane of its 5, 8 or 12 nearest
  kept points, less what the unreduced scan has (its noise): √(E² − F²) of the two 99th
  percentiles, averaged over the three. `graded` chooses points by distances of this kind, so it
  is the figure that it ought to be good at.
- *Mesh error*: the distance of a sample to a mesh of the kept points, 99th percentile and root
  mean square (RMS), noise included. The mesh is the kept points' Delaunay triangulation
  restricted to the scan: those triangles of the three-dimensional triangulation whose dual
  Voronoi edge meets the scan. It fits no planes and knows no number of neighbours, and nobody
  here chooses points by it. A wrong triangle, a cut corner, a border that is not reached and a
  hole all count. As noise is not taken off, ratios are nearer to 1 where noise is most of it.
- *Coverage*: the distance of points of the scan to the nearest kept one, RMS and largest, as
  multiples of those of a voxel grid that keeps as many.

The others are set so that they keep the same number, within 3 %; those that cannot are left out
of that row. A ratio is `graded`'s figure divided by that of the *best* other, whichever that is
in that cell: below 1 `graded` is truer. Rows are means of the two seeds. The others are: a voxel
grid that keeps the point nearest to the middle of each cube, random points, Poisson disks by dart
throwing, CGAL's hierarchy with four bounds of variation, MeshLab's simplified point cloud,
MeshLab's Poisson disks whose radius follows the curvature, and Open3D's farthest points up to
3,000 kept (time grows with their square). pointmill's published method is measured, too, and
not counted among them.
"""

NOISE = """A mesh passes through the points that are kept, and `graded` keeps positions that are far off the
surface of the others: on a smooth surface, where little is wrong but the noise, these are the ones
of much noise. At 10 % what it keeps of the noisy sphere is off the true one by 1.7 times the noise
of the scan (RMS, seed 0, measured apart), of the torus by 1.5 times; Poisson disks by once. Planes
of several points average that; meshes do not. Where points are to be meshed as they are, and little
of the scan bends, Poisson disks are the better choice, or the scan is to be smoothed first.

Chance moves all of these figures: of eight other seeds of `graded` itself the surface errors of one
cell lay within 8 to 14 % of each other on part_clean, part_noisy and torus at 10 % (measured apart,
with an earlier version). On als at 10 % they lay between 0.68 and 1.14 times the prototype's on the
scene of seed 0 and between 0.91 and 1.68 times on that of seed 1. There the error of the reduction,
before that of the scan itself is taken from it, is at most a fortieth larger than the latter: what
is left of two numbers so near to each other moves ten times as much as they do, and means little.
"""


def table(head: list[str], rows: list[list[str]]) -> str:
    align = [":--" if name in ("scene", "contender", "best other", "best other by it", "share")
             else "--:" for name in head]
    return "\n".join("| " + " | ".join(row) + " |" for row in [head, align, *rows])


def short(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def bold(value: float) -> str:
    """Losses stand out."""
    return f"**{short(value)}**" if value > 1 else short(value)


def scene_rows(lines: list[Line]) -> list[list[str]]:
    return [[line.scene, short(line.mean(Cell.beside_prototype)),
             bold(line.mean(lambda c: c.beside_best("p99"))), line.best("p99"),
             bold(line.mean(lambda c: c.beside_best("mesh_p99"))), line.best("mesh_p99"),
             bold(line.mean(lambda c: c.beside_best("mesh_rms"))),
             short(line.mean(lambda c: c.beside_voxel("coverage_rms"))),
             short(line.mean(lambda c: c.beside_voxel("coverage_max")))] for line in lines]


def scenes(lines: list[Line]) -> str:
    head = ["scene", "by the prototype", "surface error", "best other", "mesh error",
            "best other by it", "mesh RMS", "coverage RMS", "coverage max"]
    parts = []
    for share in dict.fromkeys(line.share for line in lines):
        some = [line for line in lines if line.share == share]
        parts.append(f"### {share:.0%} kept\n\n" + table(head, scene_rows(some)))
    return "\n\n".join(parts)


def contenders(all_cells: list[Cell]) -> str:
    """Everybody's figures as multiples of `graded`'s."""
    figures = ("p99", "mesh_p99", "mesh_rms", "coverage_rms", "coverage_max")
    names = dict.fromkeys(name for cell in all_cells for name in cell.rows if name != OURS)
    rows = []
    for name in names:
        found = [beside_ours(all_cells, name, figure) for figure in figures]
        if all(found):
            rows.append([name, *(short(each[0]) for each in found), str(found[0][1])])
    head = ["contender", "surface error", "mesh error", "mesh RMS", "coverage RMS",
            "coverage max", "cells"]
    return table(head, rows)


def standing(lines: list[Line], ratio: Callable, figure: str) -> str:
    """One sentence about a ratio to the best other, over rows and over cells."""
    rows = [line.mean(ratio) for line in lines]
    each = [ratio(cell) for line in lines for cell in line.cells]
    below = sum(value <= 1 for value in rows)
    half = sum(value <= 0.5 for value in rows)
    return (f"{figure}: {geometric(each):.2f} × the best other (geometric mean of {len(each)} "
            f"cells), at most {max(each):.2f};"
            f" ≤ 1 on {below} of {len(rows)} rows, ≤ 0.5 on {half}.")


def against_prototype(cells: list[Cell]) -> str:
    """Of all cells in which `graded` is measured, whether others are or not."""
    found = lines_of([cell for cell in cells if cell.prototype])
    ratios = {(c.scene, c.seed, c.share): c.beside_prototype()
              for line in found for c in line.cells}
    rows = [line for line in found if line.mean(Cell.beside_prototype) > 1.05]
    over = [f"{scene} at {share:.0%}, seed {seed} ({value:.3f})"
            for (scene, seed, share), value in ratios.items() if value > 1.05]
    text = (f"Surface error beside the Python prototype that it was written after "
            f"(`bars.json`): {geometric(list(ratios.values())):.3f} × (geometric mean), at most "
            f"{max(ratios.values()):.3f}; above 1.05 on {len(rows)} of {len(found)} rows")
    return text + (f" and in {len(over)} cells: {', '.join(over)}." if over else ".")


def coverage(lines: list[Line]) -> str:
    cells = [cell for line in lines for cell in line.cells]
    rms = max(cell.beside_voxel("coverage_rms") for cell in cells)
    largest = max(cell.beside_voxel("coverage_max") for cell in cells)
    return f"Coverage: RMS at most {rms:.2f} ×, largest at most {largest:.2f} × the voxel grid's."


def lost(all_cells: list[Cell], figure: str, name: str) -> list[str]:
    """Each cell in which somebody else has the smaller figure."""
    return [f"- {name}: {cell.scene} at {cell.share:.0%}, seed {cell.seed}: "
            f"{cell.best(figure)} is truer; `graded` has {cell.beside_best(figure):.2f} × "
            "its figure."
            for cell in all_cells if cell.beside_best(figure) > 1]


def losses(all_cells: list[Cell]) -> str:
    each = (("p99", "surface error"), ("mesh_p99", "mesh error"), ("mesh_rms", "mesh RMS"))
    found = [text for figure, name in each for text in lost(all_cells, figure, name)]
    return "\n".join(found) or "None in the cells that are measured."


def half(lines: list[Line]) -> str:
    """Rows that are not half of the best other's surface error, the worst first."""
    ratios = sorted(((line.mean(lambda c: c.beside_best("p99")), line) for line in lines),
                    key=lambda pair: -pair[0])
    return ", ".join(f"{line.scene} at {line.share:.0%} ({value:.2f})"
                     for value, line in ratios if value > 0.5)


def missing(all_cells: list[Cell]) -> str:
    """Which cells have no figures of others."""
    left = [f"{cell.scene} at {cell.share:.0%}, seed {cell.seed}"
            for cell in all_cells if not cell.compared]
    return f"The others are not measured yet in {', '.join(left)}.\n\n" if left else ""


def page(all_cells: list[Cell]) -> str:
    cells = [cell for cell in all_cells if cell.compared]
    lines = lines_of(cells)
    surface, mesh, rms = (lambda c, f=f: c.beside_best(f) for f in ("p99", "mesh_p99", "mesh_rms"))
    summary = [against_prototype(all_cells), standing(lines, surface, "Surface error"),
               standing(lines, mesh, "Mesh error"), standing(lines, rms, "Mesh RMS"),
               coverage(lines)]
    return f"""{HEAD}
## In short

{missing(all_cells)}{chr(10).join("- " + text for text in summary)}

Surface error of each contender as a multiple of `graded`'s (a dot left of the 1 is truer):

![surface error of the others beside graded's](images/quality/surface.svg)

The same by the mesh error:

![mesh error of the others beside graded's](images/quality/mesh.svg)

## Losses

Where somebody else is truer:

{losses(cells)}

{NOISE}

Rows whose surface error is more than half of the best other's: {half(lines) or "none"}.

## Scene by scene

{scenes(lines)}

## Everybody

Figures as multiples of `graded`'s, geometric means of the cells in which the contender keeps as
many points and is measured (random points and the published method are in some only). Coverage
below 1 is nearer than `graded`'s, which spends points where the surface
bends.

{contenders(cells)}
"""
