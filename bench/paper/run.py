#!/usr/bin/env python3
"""The paper's experiment, 30 seeds a row, and what its claims come to; README.md says more.

Standard library only, and a pointmill program.
"""

import argparse
import itertools
import json
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import draw_paper
from plane import far_from_plane, read_points, write_points

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
SEEDS = 30
PATTERNS = ("random", "uniform")
COUNTS = (500, 2100, 5500)
ANGLES = ("0.1deg", "0.1rad")
FRONTS = ("plane", "cap", "step", "freeform")
# Points of the far noise, and standard deviations beyond which it goes.
OUTLIERS, MULTIPLIER = 0.02, 2.0
# Runs of a time: the median counts.
TIMES, MANY = 5, 1_000_000


class Runs:
    """Runs of one program in one folder."""

    def __init__(self, program: Path, folder: Path):
        self.program, self.folder = program, folder
        self.report = folder / "report.json"

    def result(self, line: str) -> dict:
        """The result of a pipeline in one line."""
        command = [self.program, "run", line, "--report", self.report, "--no-provenance", "--quiet"]
        subprocess.run([str(word) for word in command], check=True)
        return json.loads(self.report.read_text(encoding="utf-8"))["result"]

    def figures(self, line: str) -> dict:
        """Points kept, RMS of distances to the scan's plane, and that of what was removed."""
        result = self.result(line)
        plane, removed = result["totals"]["scan_plane"], result["totals"]["deviation"]
        return {"kept": result["ledger"]["kept"], "before": plane["before"]["rms"],
                "after": plane["after"]["rms"], "removed": removed["rms"] if removed else 0.0}

    def seconds(self, line: str) -> float:
        """CPU seconds of a pipeline in one line."""
        def used() -> float:
            usage = resource.getrusage(resource.RUSAGE_CHILDREN)
            return usage.ru_utime + usage.ru_stime
        before = used()
        command = [self.program, "run", line, "--no-provenance", "--quiet"]
        subprocess.run([str(word) for word in command], check=True)
        return used() - before


def scene(pattern: str, points: int, seed: int, **keys) -> str:
    told = "".join(f" {key}={value}" for key, value in keys.items())
    return f"synth scene=squares-{pattern} points={points} seed={seed}{told}"


def reduction(angle: str, neighbors: int = 10, passes: int = 1) -> str:
    return (f"normals neighbors={neighbors} ! cells max_angle={angle} "
            f"! median passes={passes} ! discard")


def summary(row: dict, runs: list[dict]) -> dict:
    """A row with mean and standard deviation of each figure of its runs."""
    for name in runs[0]:
        values = [run[name] for run in runs]
        row[name] = round(statistics.mean(values), 4)
        row[f"{name}_deviation"] = round(statistics.stdev(values), 4)
    return row


def seeds(runs: Runs) -> list[dict]:
    """The tables as printed, with α in degrees and in radians, and noise in depth and in space."""
    rows = []
    settings = [("0.1deg", "depth"), ("0.1rad", "depth"), ("0.1deg", "space")]
    for pattern, points, (angle, noise) in itertools.product(PATTERNS, COUNTS, settings):
        found = [runs.figures(f"{scene(pattern, points, seed, noise_in=noise)} ! {reduction(angle)}")
                 for seed in range(SEEDS)]
        row = {"table": "seeds", "pattern": pattern, "points": points, "angle": angle,
               "noise_in": noise}
        rows.append(summary(row, found))
    return rows


def fronts(runs: Runs) -> list[dict]:
    """2100 random squares on each object."""
    rows = []
    for front, angle in itertools.product(FRONTS, ANGLES):
        found = [runs.figures(f"{scene('random', 2100, seed, front=front)} ! {reduction(angle)}")
                 for seed in range(SEEDS)]
        rows.append(summary({"table": "fronts", "front": front, "angle": angle}, found))
    return rows


def readings(runs: Runs) -> list[dict]:
    """Far noise that goes first: by its neighbours, and by the plane through all points."""
    rows, scan, clean = [], runs.folder / "scan.ply", runs.folder / "clean.ply"
    for pattern, angle in itertools.product(PATTERNS, ANGLES):
        found = {"neighbours": [], "plane": []}
        for seed in range(SEEDS):
            made = f"{scene(pattern, 2100, seed, outliers=OUTLIERS)} ! write {scan} encoding=ascii"
            command = [str(runs.program), "run", made, "--no-provenance", "--quiet"]
            subprocess.run(command, check=True)
            points = read_points(scan)
            all_rms, gone = far_from_plane(points, MULTIPLIER)
            write_points(clean, [p for p, far in zip(points, gone) if not far])
            by_neighbours = f"read {scan} ! outliers multiplier={MULTIPLIER} ! write {clean}2.ply"
            subprocess.run([str(runs.program), "run", by_neighbours, "--no-provenance", "--quiet"],
                           check=True)
            for name, path in (("plane", clean), ("neighbours", f"{clean}2.ply")):
                after = runs.figures(f"read {path} ! {reduction(angle)}")
                found[name].append({"all": all_rms, **after})
        for name, each in found.items():
            row = {"table": "readings", "pattern": pattern, "angle": angle, "removal": name}
            rows.append(summary(row, each))
    return rows


def passes(runs: Runs) -> list[dict]:
    """One to four reductions, one behind the other."""
    rows = []
    for angle, degree in itertools.product(ANGLES, (1, 2, 3, 4)):
        line = reduction(angle, passes=degree)
        found = [runs.figures(f"{scene('random', 5500, seed)} ! {line}") for seed in range(SEEDS)]
        rows.append(summary({"table": "passes", "angle": angle, "passes": degree}, found))
    return rows


def neighbors(runs: Runs) -> list[dict]:
    """6, 10 and 20 neighbours."""
    rows = []
    for pattern, k in itertools.product(PATTERNS, (6, 10, 20, 40)):
        line = reduction("0.1deg", neighbors=k)
        found = [runs.figures(f"{scene(pattern, 5500, seed)} ! {line}") for seed in range(SEEDS)]
        rows.append(summary({"table": "neighbors", "pattern": pattern, "neighbors": k}, found))
    return rows


def times(runs: Runs) -> list[dict]:
    """CPU seconds of a million squares: reading alone, normals, and the whole reduction."""
    rows = []
    for pattern in PATTERNS:
        start = scene(pattern, MANY, 0)
        lines = {"scan": f"{start} ! tap ! grid side=1e-4 pick=first ! discard",
                 "normals": f"{start} ! normals ! discard",
                 "all": f"{start} ! {reduction('0.1deg')}"}
        row = {"table": "times", "pattern": pattern, "points": MANY}
        for name, line in lines.items():
            row[name] = round(statistics.median(runs.seconds(line) for _ in range(TIMES)), 3)
        rows.append(row)
    return rows


TABLES = (seeds, fronts, readings, passes, neighbors, times)


def measured(program: Path, asked: list[str]) -> list[dict]:
    """The rows of all tables: those that are asked for anew, the others as they are."""
    known = draw_paper.results()
    with tempfile.TemporaryDirectory() as folder:
        runs = Runs(program, Path(folder))
        rows = []
        for table in TABLES:
            name = table.__name__
            rows += table(runs) if name in asked else draw_paper.rows_of(known, name)
        return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pointmill", type=Path, default=ROOT / "target/release/pointmill",
                        help="the program that is measured")
    parser.add_argument("--check", action="store_true",
                        help="measure nothing; whether docs/paper.md is what results.jsonl says")
    names = [table.__name__ for table in TABLES]
    parser.add_argument("--tables", default=",".join(names), help="only these, as a,b")
    given = parser.parse_args()
    if unknown := set(given.tables.split(",")) - set(names):
        sys.exit(f"{', '.join(unknown)}: not among {', '.join(names)}")
    if given.check:
        if wrong := draw_paper.differing():
            sys.exit(f"{wrong} is not what the results say: python3 bench/paper/run.py")
        return
    rows = measured(given.pointmill.resolve(), given.tables.split(","))
    draw_paper.RESULTS.write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
    draw_paper.write()


if __name__ == "__main__":
    main()
