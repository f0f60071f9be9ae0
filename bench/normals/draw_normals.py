#!/usr/bin/env python3
"""Writes the table of docs/paper.md and its plot from results.jsonl; `--check` compares instead.

Standard library only.
"""

import json
import math
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
DOCS = HERE.parent.parent / "docs"
BEGIN = "<!-- drawn by bench/normals/draw_normals.py; do not edit -->\n"
END = "<!-- end of the accuracy of normals -->\n"
K = 10
LINES = {"varady": "#3b8fd9", "delaunay": "#8a8f98", "pca": "#2fa36b", "quadric": "#e08a1e",
         "cubic": "#d9534f", "CGAL jet 2": "#b06fd0"}
STYLE = """text { font: 11px sans-serif; fill: #6a737d } .grid { stroke: #999; stroke-width: 0.4 }
path { fill: none } @media (prefers-color-scheme: dark) { text { fill: #ddd } }"""
WIDTH, HEIGHT, LEFT, TOP, GAP = 128, 110, 78, 66, 18
LOW, HIGH = 0.01, 60


def results() -> list[dict]:
    lines = (HERE / "results.jsonl").read_text(encoding="utf-8").splitlines()
    return [json.loads(line) for line in lines]


def in_order(rows: list[dict], key: str) -> list:
    return list(dict.fromkeys(row[key] for row in rows))


def short(value: float) -> str:
    return f"{value:.3g}" if value >= 0.001 else "0"


def table(rows: list[dict]) -> str:
    names = in_order(rows, "by")
    text = "| surface | noise | " + " | ".join(names) + " |\n|---|--:|" + "--:|" * len(names) + "\n"
    for surface in in_order(rows, "surface"):
        for noise in in_order(rows, "noise"):
            found = {row["by"]: row["rms"] for row in rows
                     if (row["surface"], row["noise"], row["k"]) == (surface, noise, K)}
            best = min(found.values())
            # What is written as 0 is as good as any.
            most = max(1.02 * best, 0.001)
            told = [f"**{short(found[n])}**" if found[n] < most or found[n] == best
                    else short(found[n]) for n in names]
            text += f"| {surface} | {noise:g} | " + " | ".join(told) + " |\n"
    return text


def up(value: float) -> float:
    share = math.log(min(max(value, LOW), HIGH) / LOW) / math.log(HIGH / LOW)
    return round(HEIGHT * (1 - share), 1)


def panel(rows: list[dict], surface: str, noise: float, left: int, top: int) -> list[str]:
    drawn = [f'<path class="grid" stroke="#999" d="M{left} {top + up(v):g}h{WIDTH}"/>'
             for v in (0.01, 0.1, 1, 10)]
    ks = sorted({row["k"] for row in rows})
    across = {k: left + round(WIDTH * (k - ks[0]) / (ks[-1] - ks[0]), 1) for k in ks}
    for name, colour in LINES.items():
        found = [(across[row["k"]], top + up(row["rms"])) for row in rows
                 if (row["surface"], row["noise"], row["by"]) == (surface, noise, name)]
        line = "L".join(f"{x:g} {y:g}" for x, y in found)
        drawn.append(f'<path d="M{line}" stroke="{colour}" stroke-width="1.6"/>')
    return drawn


def plot(rows: list[dict]) -> str:
    surfaces, noises = in_order(rows, "surface"), in_order(rows, "noise")
    wide = LEFT + len(surfaces) * (WIDTH + GAP)
    high = TOP + len(noises) * (HEIGHT + GAP) + 30
    drawn = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide} {high}" role="img" '
             'aria-label="Errors of normals against the number of neighbours">',
             f"<style>{STYLE}</style>",
             '<text x="8" y="18">RMS error of normals in degrees against neighbours, 6 to 20; rows '
             "by noise in multiples of the mean spacing</text>"]
    for number, (name, colour) in enumerate(LINES.items()):
        x = LEFT + 110 * number
        drawn.append(f'<path d="M{x} 34h18" stroke="{colour}" stroke-width="2"/>'
                     f'<text x="{x + 24}" y="38">{name}</text>')
    for row, noise in enumerate(noises):
        top = TOP + row * (HEIGHT + GAP)
        drawn.append(f'<text x="8" y="{top + HEIGHT / 2:g}">{noise:g}</text>')
        drawn += [f'<text x="{LEFT - 6}" y="{top + up(v) + 4:g}" text-anchor="end">{v:g}°</text>'
                  for v in (0.01, 0.1, 1, 10)]
        for column, surface in enumerate(surfaces):
            drawn += panel(rows, surface, noise, LEFT + column * (WIDTH + GAP), top)
    for column, surface in enumerate(surfaces):
        x = LEFT + column * (WIDTH + GAP) + WIDTH / 2
        drawn.append(f'<text x="{x:g}" y="{TOP - 8}" text-anchor="middle">{surface}</text>')
        drawn.append(f'<text x="{x:g}" y="{high - 24}" text-anchor="middle">6 … 20</text>')
    return "\n".join(drawn) + "\n</svg>\n"


def drawn() -> dict[Path, str]:
    rows, page = results(), DOCS / "paper.md"
    text = page.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN, 1)
    behind = rest.split(END, 1)[1]
    return {page: f"{before}{BEGIN}\n{table(rows)}\n{END}{behind}",
            DOCS / "images/normals.svg": plot(rows)}


def write() -> None:
    for path, text in drawn().items():
        path.write_text(text, encoding="utf-8")


def main() -> None:
    if unknown := [word for word in sys.argv[1:] if word != "--check"]:
        sys.exit(f"{unknown[0]}: the only option is --check")
    if "--check" not in sys.argv:
        write()
        return
    for path, text in drawn().items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            sys.exit(f"{path.name} is not what the results say: "
                     "python3 bench/normals/draw_normals.py")


if __name__ == "__main__":
    main()
