#!/usr/bin/env python3
"""The paper's experiment, 30 seeds a row, beside the figures that it printed; README.md says more.

Standard library only, and a pointmill program.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PAGE = ROOT / "docs/paper.md"
BEGIN = "<!-- drawn by bench/paper/run.py; do not edit -->\n"
END = "<!-- end of the thirty seeds -->\n"
SEEDS = 30
# Pattern, points; what the paper prints: points after, RMS before and after.
ROWS = [
    ("random", 500, "430", "0.761 → 0.521"),
    ("random", 2100, "1820", "0.896 → 0.630"),
    ("random", 5500, "5012", "1.89 → 0.932"),
    ("uniform", 500, "492", "0.855 → 0.567"),
    ("uniform", 2100, "2062", "0.923 → 0.698"),
    ("uniform", 5500, "5446", "1.982 → 0.997"),
]
ANGLES = ("0.1deg", "0.1rad")


def reduced(program: Path, folder: Path, pattern: str, points: int, angle: str, seed: int) -> dict:
    """What a run came to: records kept, and RMS of the distances to the scan's plane."""
    report = folder / "report.json"
    line = (f"synth scene=squares-{pattern} points={points} seed={seed} ! normals "
            f"! cells max_angle={angle} ! median ! discard")
    command = [program, "run", line, "--report", report, "--no-provenance", "--quiet"]
    subprocess.run([str(word) for word in command], check=True)
    result = json.loads(report.read_text(encoding="utf-8"))["result"]
    plane = result["totals"]["scan_plane"]
    return {"kept": result["ledger"]["kept"],
            "before": plane["before"]["rms"], "after": plane["after"]["rms"]}


def measured(program: Path) -> list[dict]:
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for pattern, points, *_ in ROWS:
            for angle in ANGLES:
                runs = [reduced(program, Path(folder), pattern, points, angle, seed)
                        for seed in range(SEEDS)]
                row = {"pattern": pattern, "points": points, "angle": angle}
                for name in ("kept", "before", "after"):
                    values = [run[name] for run in runs]
                    row[name] = round(statistics.mean(values), 4)
                    row[f"{name}_deviation"] = round(statistics.stdev(values), 4)
                rows.append(row)
    return rows


def table(rows: list[dict]) -> str:
    text = ("| pattern | points | paper: after | RMS | α = 0.1°: after | RMS | α = 0.1 rad: after "
            "| RMS |\n|---|--:|--:|--:|--:|--:|--:|--:|\n")
    for pattern, points, after, rms in ROWS:
        cells = [pattern, str(points), after, rms]
        for angle in ANGLES:
            row = next(row for row in rows if (row["pattern"], row["points"], row["angle"])
                       == (pattern, points, angle))
            cells += [f"{row['kept']:.0f} ± {row['kept_deviation']:.0f}",
                      f"{row['before']:.3f} ± {row['before_deviation']:.3f} → "
                      f"{row['after']:.3f} ± {row['after_deviation']:.3f}"]
        text += f"| {' | '.join(cells)} |\n"
    return text


def drawn() -> str:
    lines = (HERE / "results.jsonl").read_text(encoding="utf-8").splitlines()
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN, 1)
    behind = rest.split(END, 1)[1]
    return f"{before}{BEGIN}\n{table([json.loads(line) for line in lines])}\n{END}{behind}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pointmill", type=Path, default=ROOT / "target/release/pointmill",
                        help="the program that is measured")
    parser.add_argument("--check", action="store_true",
                        help="measure nothing; whether docs/paper.md is what results.jsonl says")
    given = parser.parse_args()
    if given.check:
        if drawn() != PAGE.read_text(encoding="utf-8"):
            sys.exit("docs/paper.md is not what the results say: python3 bench/paper/run.py")
        return
    rows = measured(given.pointmill.resolve())
    (HERE / "results.jsonl").write_text(
        "".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
    PAGE.write_text(drawn(), encoding="utf-8")


if __name__ == "__main__":
    main()
