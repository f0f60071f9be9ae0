"""Tables of docs/paper.md and its plot, from results.jsonl. Standard library only."""

import json
from pathlib import Path

HERE = Path(__file__).resolve().parent
DOCS = HERE.parent.parent / "docs"
PAGE, PLOT = DOCS / "paper.md", DOCS / "images/paper.svg"
RESULTS = HERE / "results.jsonl"
# What the paper prints: points after, RMS before and after.
PRINTED = {
    ("random", 500): (430, "0.761 → 0.521"),
    ("random", 2100): (1820, "0.896 → 0.630"),
    ("random", 5500): (5012, "1.89 → 0.932"),
    ("uniform", 500): (492, "0.855 → 0.567"),
    ("uniform", 2100): (2062, "0.923 → 0.698"),
    ("uniform", 5500): (5446, "1.982 → 0.997"),
}
READINGS = {("0.1deg", "depth"): "α = 0.1°", ("0.1rad", "depth"): "α = 0.1 rad",
            ("0.1deg", "space"): "α = 0.1°, noise in space"}
COLOURS = {"printed": "#8a8f98", ("0.1deg", "depth"): "#3b8fd9", ("0.1rad", "depth"): "#d9534f",
           ("0.1deg", "space"): "#2fa36b"}
STYLE = """text { font: 11px sans-serif; fill: #6a737d } .grid { stroke: #999; stroke-width: 0.4 }
path { fill: none } @media (prefers-color-scheme: dark) { text { fill: #ddd } }"""


def begin(name: str) -> str:
    return f"<!-- drawn by bench/paper/run.py: {name}; do not edit -->\n"


def end(name: str) -> str:
    return f"<!-- end of {name} -->\n"


def rows_of(rows: list[dict], table: str, **keys) -> list[dict]:
    return [row for row in rows if row["table"] == table
            and all(row[key] == value for key, value in keys.items())]


def count(row: dict) -> str:
    return f"{row['kept']:.0f} ± {row['kept_deviation']:.0f}"


def figure(row: dict, name: str) -> str:
    return f"{row[name]:.3f} ± {row[name + '_deviation']:.3f}"


def table(head: list[str], lines: list[list[str]], words: int = 1) -> str:
    rule = ["---"] * words + ["--:"] * (len(head) - words)
    text = f"| {' | '.join(head)} |\n|{'|'.join(rule)}|\n"
    return text + "".join(f"| {' | '.join(line)} |\n" for line in lines)


def seeds(rows: list[dict]) -> str:
    lines = []
    for (pattern, points), (kept, rms) in PRINTED.items():
        line = [pattern, str(points), str(kept), rms]
        for angle, noise in READINGS:
            [row] = rows_of(rows, "seeds", pattern=pattern, points=points, angle=angle,
                            noise_in=noise)
            line += [count(row), f"{figure(row, 'before')} → {figure(row, 'after')}"]
        lines.append(line)
    head = ["pattern", "points", "paper: after", "RMS"]
    for name in READINGS.values():
        head += [f"{name}: after", "RMS"]
    return table(head, lines)


def fronts(rows: list[dict]) -> str:
    lines = [[row["front"], "0.1°" if row["angle"] == "0.1deg" else "0.1 rad", count(row),
              f"{figure(row, 'before')} → {figure(row, 'after')}", figure(row, "removed")]
             for row in rows_of(rows, "fronts")]
    return table(["front", "α", "after", "RMS", "deviation"], lines, 2)


def readings(rows: list[dict]) -> str:
    lines = []
    for row in rows_of(rows, "readings"):
        fall = row["all"] - row["after"]
        share = 100 * (row["all"] - row["before"]) / fall if fall > 0 else float("nan")
        lines.append([row["pattern"], "0.1°" if row["angle"] == "0.1deg" else "0.1 rad",
                      row["removal"], count(row), figure(row, "all"), figure(row, "before"),
                      figure(row, "after"), f"{share:.0f} %"])
    return table(["pattern", "α", "far noise goes by", "after", "RMS of all", "without far noise",
                  "after the reduction", "of the fall by the removal"], lines, 3)


def passes(rows: list[dict]) -> str:
    lines = [["0.1°" if row["angle"] == "0.1deg" else "0.1 rad", str(row["passes"]), count(row),
              figure(row, "after")] for row in rows_of(rows, "passes")]
    return table(["α", "passes", "after", "RMS after"], lines)


def neighbors(rows: list[dict]) -> str:
    lines = [[row["pattern"], str(row["neighbors"]), count(row), figure(row, "after"),
              figure(row, "removed")] for row in rows_of(rows, "neighbors")]
    return table(["pattern", "k", "after", "RMS after", "deviation"], lines)


def times(rows: list[dict]) -> str:
    lines = []
    for row in rows_of(rows, "times"):
        normals, rest = row["normals"] - row["scan"], row["all"] - row["normals"]
        share = 100 * normals / (row["all"] - row["scan"])
        lines.append([row["pattern"], f"{row['scan']:.2f}", f"{normals:.2f}", f"{rest:.2f}",
                      f"{row['all']:.2f}", f"{share:.0f} %"])
    return table(["pattern", "scan, sort", "normals", "cells, median", "all",
                  "normals of the reduction"], lines)


TABLES = {"seeds": seeds, "fronts": fronts, "readings": readings, "passes": passes,
          "neighbors": neighbors, "times": times}


def bars(rows: list[dict], pattern: str, left: int, top: int) -> list[str]:
    """Shares of points that stay, printed and ours, at each number of points."""
    drawn = [f'<path class="grid" stroke="#999" d="M{left} {top + 120 * (1 - v)}h270"/>'
             for v in (0.0, 0.5, 1.0)]
    for group, points in enumerate((500, 2100, 5500)):
        kept = {"printed": (PRINTED[pattern, points][0], 0.0)}
        for angle, noise in READINGS:
            [row] = rows_of(rows, "seeds", pattern=pattern, points=points, angle=angle,
                            noise_in=noise)
            kept[angle, noise] = (row["kept"], row["kept_deviation"])
        for place, (name, (value, spread)) in enumerate(kept.items()):
            high, x = 120 * value / points, left + 8 + 90 * group + 19 * place
            drawn.append(f'<rect x="{x}" y="{top + 120 - high:.1f}" width="16" height="{high:.1f}" '
                         f'fill="{COLOURS[name]}"/>')
            half = 120 * spread / points
            drawn.append(f'<path stroke="#555" d="M{x + 8} {top + 120 - high - half:.1f}'
                         f'v{2 * half:.1f}"/>')
        drawn.append(f'<text x="{left + 45 + 90 * group}" y="{top + 136}" text-anchor="middle">'
                     f"{points}</text>")
    drawn.append(f'<text x="{left + 135}" y="{top - 8}" text-anchor="middle">{pattern} squares</text>')
    return drawn


def plot(rows: list[dict]) -> str:
    drawn = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 640 226" role="img" '
             'aria-label="Share of points that stay, as printed and as measured">',
             f"<style>{STYLE}</style>",
             '<text x="8" y="18">Share of the points that stays, mean and standard deviation of '
             "thirty seeds</text>"]
    names = {"printed": "as printed", **READINGS}
    for number, (name, text) in enumerate(names.items()):
        x = 40 + 140 * number
        drawn.append(f'<rect x="{x}" y="28" width="12" height="12" fill="{COLOURS[name]}"/>'
                     f'<text x="{x + 17}" y="38">{text}</text>')
    drawn += [f'<text x="30" y="{74 + 120 * (1 - v) + 4:g}" text-anchor="end">{100 * v:g}</text>'
              for v in (0.0, 0.5, 1.0)]
    drawn += bars(rows, "random", 40, 74) + bars(rows, "uniform", 345, 74)
    return "\n".join(drawn) + "\n</svg>\n"


def results() -> list[dict]:
    return [json.loads(line) for line in RESULTS.read_text(encoding="utf-8").splitlines()]


def drawn() -> dict[Path, str]:
    rows = results()
    text = PAGE.read_text(encoding="utf-8")
    for name, make in TABLES.items():
        before, rest = text.split(begin(name), 1)
        behind = rest.split(end(name), 1)[1]
        text = f"{before}{begin(name)}\n{make(rows)}\n{end(name)}{behind}"
    return {PAGE: text, PLOT: plot(rows)}


def write() -> None:
    for path, text in drawn().items():
        path.write_text(text, encoding="utf-8")


def differing() -> str | None:
    """The first file that is not what the results say."""
    each = drawn().items()
    wrong = (path for path, text in each
             if not path.exists() or path.read_text(encoding="utf-8") != text)
    return next((path.name for path in wrong), None)
