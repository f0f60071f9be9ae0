"""The section of docs/quality.md on the paper's method and those that it is beside, with its plot,
from methods.jsonl. Standard library only."""

import json
import math
from pathlib import Path

from results import equal, geometric

PAPER = "pointmill paper"
NAMES = {PAPER: "paper, median angle"}
LINES = {"graded": "#111827", PAPER: "#d9534f", "voxel": "#3b8fd9", "random": "#8a8f98",
         "grid and median": "#6cb4ee", "averaging, then grid": "#2fa36b", "Gaussian image": "#e08a1e",
         "wavelet": "#b06fd0", "fourier": "#c9a227", "triangle removal": "#7d6b5d",
         "Poisson disk": "#5b6ee1", "MeshLab simplify": "#4c9a9a"}
STYLE = """text { font: 11px sans-serif; fill: #6a737d } .grid { stroke: #999; stroke-width: 0.4 }
path { fill: none } @media (prefers-color-scheme: dark) { text { fill: #ddd }
.graded { stroke: #eee } }"""
WIDTH, HEIGHT, LEFT, TOP, GAP = 190, 150, 50, 90, 46

TEXT = """## The paper's method, and those that it is beside

The published method with its number given (`reduce --preset paper --keep N`), with the centre of mass
or several sites at once, and the methods that the paper compares with ([paper](paper.md)), as
pointmill's stages have them, beside `graded`, a voxel grid, random points and every nth, Poisson disks,
CGAL, PCL, MeshLab and Open3D, at 1, 2, 5, 10 and 20 % of seven scenes (one seed), of which village and
city are crops of real scans. Points of averaging, Gaussian image, centre of mass, wavelet, Fourier
transform and WLOP are moved; the others are of the scan. Depth images see a closed part from one side,
and merge what is behind with what is in front. A mesh over a plane does so too, and keeps its border,
which on the part without noise is a third of the points: there is no row of triangle removal for it.
PCL's samplings keep what normals or a registration need most, and leave flat parts empty. Of scan lines
these scenes have no times.
"""


def rows(path: Path) -> list[dict]:
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def in_order(found: list[dict], key: str) -> list:
    return list(dict.fromkeys(row[key] for row in found))


def figure(found: list[dict], figure_of: str, **keys) -> float | None:
    values = [row[figure_of] for row in found
              if equal(row) and all(row[key] == value for key, value in keys.items())]
    return values[0] if values else None


def told(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"


def table(found: list[dict], scene: str) -> str:
    """Surface errors of a scene; the smallest of each share in bold."""
    shares = sorted(in_order(found, "share"))
    head = ["", *(f"{share:.0%}" for share in shares)]
    text = f"| {' | '.join(head)} |\n| :-- |{' --: |' * len(shares)}\n"
    names = in_order(found, "contender")
    best = {share: min((v for n in names if (v := figure(found, "p99", scene=scene, share=share,
                                                        contender=n)) is not None), default=0.0)
            for share in shares}
    for name in names:
        cells = []
        for share in shares:
            value = figure(found, "p99", scene=scene, share=share, contender=name)
            cells.append(f"**{told(value)}**" if value == best[share] else told(value))
        text += f"| {NAMES.get(name, name)} | {' | '.join(cells)} |\n"
    return text


def standing(found: list[dict]) -> str:
    """Everybody's figures as multiples of the paper's, over the cells that both have."""
    figures = ("p99", "mesh_p99", "mesh_rms", "coverage_rms", "coverage_max")
    text = ("| | surface error | mesh error | mesh RMS | coverage RMS | coverage max | cells |\n"
            "| :-- | --: | --: | --: | --: | --: | --: |\n")
    for name in in_order(found, "contender"):
        ratios = {each: [] for each in figures}
        for scene in in_order(found, "scene"):
            for share in in_order(found, "share"):
                for each in figures:
                    keys = {"scene": scene, "share": share}
                    own = figure(found, each, contender=PAPER, **keys)
                    other = figure(found, each, contender=name, **keys)
                    if own and other:
                        ratios[each].append(other / own)
        if ratios["p99"]:
            each = " | ".join(f"{geometric(ratios[f]):.2f}" for f in figures)
            text += f"| {NAMES.get(name, name)} | {each} | {len(ratios['p99'])} |\n"
    return text


def lost(found: list[dict]) -> str:
    """Where others that move nothing are truer than the paper's method, by surface error."""
    still = ("voxel", "random", "every nth", "grid and median")
    lines = []
    for scene in in_order(found, "scene"):
        beside = []
        for share in sorted(in_order(found, "share")):
            own = figure(found, "p99", scene=scene, share=share, contender=PAPER)
            truer = [name for name in still
                     if own and (v := figure(found, "p99", scene=scene, share=share,
                                             contender=name)) is not None and v < own]
            if truer:
                beside.append(f"{share:.0%} ({', '.join(truer)})")
        if beside:
            lines.append(f"- {scene}: at {'; '.join(beside)}")
    return "\n".join(lines) or "Nowhere."


def section(found: list[dict]) -> str:
    tables = "\n".join(f"### {scene}\n\n{table(found, scene)}" for scene in in_order(found, "scene"))
    return f"""{TEXT}
![surface error against the share of points kept](images/quality/methods.svg)

As multiples of the paper's method, geometric means over scenes and shares (below 1 is truer than it):

{standing(found)}
By its surface error the paper's method loses to a grid, to random points or to every nth here:

{lost(found)}

Surface errors (99th percentile, the scan's own taken off, in units of the scene):

{tables}"""


def plot(found: list[dict]) -> str:
    scenes, shares = in_order(found, "scene"), sorted(in_order(found, "share"))
    across = 4
    down = -(-len(scenes) // across)
    wide, high = LEFT + across * (WIDTH + GAP), TOP + down * (HEIGHT + GAP) + 8
    drawn = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide} {high}" role="img" '
             'aria-label="Surface error against the share of points kept, by method">',
             f"<style>{STYLE}</style>",
             '<text x="8" y="18">Surface error (99 %, logarithmic) against the share of points kept'
             "</text>"]
    x, y = 8, 36
    for name, colour in LINES.items():
        text = NAMES.get(name, name)
        if x + 32 + 6 * len(text) > wide:
            x, y = 8, y + 16
        drawn.append(f'<path class="{name if name == "graded" else ""}" d="M{x} {y}h16" '
                     f'stroke="{colour}" stroke-width="2"/>'
                     f'<text x="{x + 20}" y="{y + 4}">{text}</text>')
        x += 32 + 6 * len(text)
    for number, scene in enumerate(scenes):
        drawn += panel(found, scene, shares, LEFT + number % across * (WIDTH + GAP),
                       TOP + number // across * (HEIGHT + GAP))
    return "\n".join(drawn) + "\n</svg>\n"


def panel(found: list[dict], scene: str, shares: list[float], left: int, top: int) -> list[str]:
    values = {(name, share): figure(found, "p99", scene=scene, share=share, contender=name)
              for name in LINES for share in shares}
    known = [v for v in values.values() if v]
    low, high = math.log(min(known)), math.log(max(known))

    def place(share: float, value: float) -> str:
        along = math.log(share / shares[0]) / math.log(shares[-1] / shares[0])
        up = (math.log(max(value, math.exp(low))) - low) / max(high - low, 1e-9)
        return f"{left + WIDTH * along:.1f} {top + HEIGHT * (1 - up):.1f}"

    drawn = [f'<text x="{left + WIDTH / 2:g}" y="{top - 6}" text-anchor="middle">{scene}</text>',
             f'<path class="grid" stroke="#999" d="M{left} {top}v{HEIGHT}h{WIDTH}"/>',
             f'<text x="{left - 4}" y="{top + 8}" text-anchor="end">{math.exp(high):.2g}</text>',
             f'<text x="{left - 4}" y="{top + HEIGHT}" text-anchor="end">{math.exp(low):.2g}</text>']
    drawn += [f'<text x="{left + WIDTH * n / (len(shares) - 1):g}" y="{top + HEIGHT + 14}" '
              f'text-anchor="middle">{share:.0%}</text>' for n, share in ((0, shares[0]),
                                                              (len(shares) - 1, shares[-1]))]
    for name, colour in LINES.items():
        points = [place(share, value) for share in shares
                  if (value := values[name, share]) is not None]
        if len(points) > 1:
            kind = ' class="graded"' if name == "graded" else ""
            drawn.append(f'<path{kind} d="M{"L".join(points)}" stroke="{colour}" '
                         'stroke-width="1.6"/>')
    return drawn
