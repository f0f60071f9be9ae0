"""Plots as SVG: what each contender's figure is beside `graded`'s, scene by scene.

Written by hand, so that the same results give the same bytes; colours follow the reader's light or
dark setting. Standard library only.
"""

import math

from results import Cell, Line, equal, geometric

# A family's members are one dot: the best of them.
FAMILIES = {
    "voxel": ("#3b8fd9", ("voxel",)),
    "Poisson disk": ("#2fa36b", ("Poisson disk",)),
    "CGAL hierarchy, best of four": ("#e08a1e", tuple(
        f"CGAL hierarchy {variation}" for variation in ("0.33", "0.03", "0.01", "0.003"))),
    "MeshLab simplify": ("#b06fd0", ("MeshLab simplify",)),
    "MeshLab curvature": ("#d9534f", ("MeshLab curvature",)),
}
STYLE = """text { font: 12px sans-serif; fill: #6a737d } .line { stroke: #999 } .one { stroke: #6a737d }
@media (prefers-color-scheme: dark) {
text { fill: #ddd } .line { stroke: #666 } .one { stroke: #eee } }"""
LEFT, WIDTH, GAP, TOP, STEP = 84, 250, 22, 74, 20
TICKS = (0.5, 1, 2, 5, 10, 20)
LOW, HIGH = 0.45, 22


def across(value: float) -> float:
    """Place of a ratio within a panel."""
    share = math.log(value / LOW) / math.log(HIGH / LOW)
    return round(WIDTH * min(max(share, 0), 1), 1)


def ratio(cells: list[Cell], names: tuple[str, ...], figure: str) -> float | None:
    """The best of some contenders beside `graded`: the geometric mean over seeds."""
    found = []
    for cell in cells:
        figures = [cell.rows[n][figure] for n in names if n in cell.rows and equal(cell.rows[n])]
        found += [min(figures) / cell.ours[figure]] if figures else []
    return geometric(found) if found else None


def panel(lines: list[Line], figure: str, left: int, named: bool) -> list[str]:
    """One share: a line of dots a scene."""
    bottom = TOP + STEP * len(lines)
    drawn = [f'<text x="{left + WIDTH / 2:g}" y="52" text-anchor="middle">'
             f"{lines[0].share:.0%} kept</text>"]
    for tick in TICKS:
        x = left + across(tick)
        kind = "one" if tick == 1 else "line"
        drawn.append(f'<path class="{kind}" d="M{x:g} {TOP - 10}V{bottom - 6}" '
                     f'stroke-width="{1.5 if tick == 1 else 0.5}"/>'
                     f'<text x="{x:g}" y="{bottom + 10}" text-anchor="middle">{tick:g}</text>')
    for number, line in enumerate(lines):
        y = TOP + STEP * number
        if named:
            drawn.append(f'<text x="{left - 8}" y="{y + 4}" text-anchor="end">{line.scene}</text>')
        for colour, names in FAMILIES.values():
            found = ratio(line.cells, names, figure)
            if found is not None:
                drawn.append(f'<circle cx="{left + across(found):g}" cy="{y}" r="4" '
                             f'fill="{colour}" fill-opacity="0.85"/>')
    return drawn


def legend() -> list[str]:
    drawn, x = [], LEFT
    for name, (colour, _) in FAMILIES.items():
        drawn.append(f'<circle cx="{x}" cy="24" r="4" fill="{colour}"/>'
                     f'<text x="{x + 9}" y="28">{name}</text>')
        x += 34 + 7 * len(name)
    return drawn


def plot(lines: list[Line], figure: str, title: str) -> str:
    """An SVG document; `title` is what a reader who does not see it is told."""
    shares = list(dict.fromkeys(line.share for line in lines))
    drawn = legend()
    most = 0
    for number, share in enumerate(shares):
        some = [line for line in lines if line.share == share]
        most = max(most, len(some))
        drawn += panel(some, figure, LEFT + number * (WIDTH + GAP), number == 0)
    width = LEFT + len(shares) * (WIDTH + GAP)
    height = TOP + STEP * most + 22
    return "\n".join([
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}" role="img">',
        f"<title>{title}</title>", f"<style>{STYLE}</style>", *drawn, "</svg>", ""])
