"""Runs and measures what the results do not have yet; `run.py` calls it in its environment."""

import argparse
import itertools
import json
import sys
from pathlib import Path

import numpy as np

from contenders import ALL, BESIDE_METHODS, CONTENDERS, METHODS
from figures import Judge
from keep import METHOD_SCENES, METHOD_SEEDS, METHOD_SHARES, SEEDS, SHARES, Bench, keep_scene
from results import equal
from scenes import SCENES, Maker

Cell = tuple[str, int, float, str]


def rows(path: Path) -> dict[Cell, dict]:
    """What is measured, by scene, seed, share and contender."""
    if not path.exists():
        return {}
    found = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return {(row["scene"], row["seed"], row["share"], row["contender"]): row for row in found}


def write(path: Path, measured: dict[Cell, dict]) -> None:
    """A line a cell, in the order of the tables."""
    scenes, names = list(SCENES), list(ALL)
    order = sorted(measured, key=lambda c: (scenes.index(c[0]), c[1], c[2], names.index(c[3])))
    part = path.with_suffix(".part")
    part.write_text("".join(json.dumps(measured[cell]) + "\n" for cell in order), encoding="utf-8")
    part.rename(path)


def kept_of(bench: Bench, cell: Cell, points: np.ndarray) -> dict | None:
    """What a contender kept in a cell, if it did and came near enough to the number to be judged."""
    path = bench.kept_file(*cell)
    if not path.exists():
        return None
    with np.load(path) as stored:
        found = {"kept": stored["kept"], "seconds": float(stored["seconds"])}
    found["wanted"] = round(cell[2] * len(points))
    counts = {"kept": len(found["kept"]), "wanted": found["wanted"]}
    return found if equal(counts) else None


def row(judge: Judge, points: np.ndarray, cell: Cell, found: dict) -> dict:
    """The figures of a cell."""
    kept = found["kept"]
    figures = judge.figures(points[kept] if kept.ndim == 1 else kept)
    short = {key: float(f"{value:.5g}") for key, value in figures.items()}
    head = dict(zip(("scene", "seed", "share", "contender"), cell))
    counts = {"wanted": found["wanted"], "kept": len(kept)}
    return head | counts | {"seconds": round(found["seconds"], 1)} | short


def measure_scene(bench: Bench, scene: str, seed: int, shares: tuple[float, ...],
                  names: list[str], results: Path) -> None:
    """Measures what is kept of a scene and not measured yet."""
    done = rows(results)
    missing = [cell for share in shares for name in names
               if (cell := (scene, seed, share, name)) not in done]
    made = bench.maker.scene(scene, seed)
    kept = {cell: found for cell in missing if (found := kept_of(bench, cell, made.points))}
    judge = Judge(made) if kept else None
    for cell, found in kept.items():
        done[cell] = row(judge, made.points, cell, found)
        print(json.dumps(done[cell]), flush=True)
    if kept:
        write(results, done)


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pointmill", type=Path, required=True)
    parser.add_argument("--cgal", type=Path, required=True)
    parser.add_argument("--pcl", type=Path, required=True)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--scans", type=Path)
    parser.add_argument("--results", type=Path, required=True)
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--methods", action="store_true")
    parser.add_argument("--scenes")
    parser.add_argument("--contenders")
    return parser.parse_args()


def forget(bench: Bench, asked: tuple, results: Path) -> None:
    """Removes what is kept and measured of the chosen scenes by the chosen contenders."""
    scenes, _, _, names = asked
    done = rows(results)
    for cell in [c for c in done if c[0] in scenes and c[3] in names]:
        del done[cell]
    write(results, done)
    for cell in itertools.product(*asked):
        bench.kept_file(*cell).unlink(missing_ok=True)


def chosen(text: str, known) -> list[str]:
    names = text.split(",")
    if unknown := [name for name in names if name not in known]:
        sys.exit(f"{', '.join(unknown)}: not among {', '.join(known)}")
    return names


def main() -> None:
    given = options()
    (given.folder / "kept").mkdir(parents=True, exist_ok=True)
    maker = Maker(given.pointmill, given.scans, given.folder / "scenes")
    bench = Bench(given.pointmill, given.cgal, given.pcl, maker, given.folder)
    shares, seeds = (METHOD_SHARES, METHOD_SEEDS) if given.methods else (SHARES, SEEDS)
    names = (*BESIDE_METHODS, *METHODS) if given.methods else CONTENDERS
    scenes = METHOD_SCENES if given.methods else SCENES
    names = chosen(given.contenders, names) if given.contenders else list(names)
    scenes = chosen(given.scenes, scenes) if given.scenes else list(scenes)
    if given.again:
        forget(bench, (scenes, seeds, shares, names), given.results)
    for scene, seed in itertools.product(scenes, seeds):
        for share in shares:
            keep_scene(bench, scene, seed, share, names)
        measure_scene(bench, scene, seed, shares, names, given.results)


if __name__ == "__main__":
    main()
