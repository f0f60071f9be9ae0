"""Estimates normals of all shapes by all, and writes how far they are off; run.py calls it."""

import argparse
import json
from pathlib import Path

import numpy as np

from estimators import ESTIMATORS, Tools
from shapes import SHAPES, shape

COUNT = 20_000
SEED = 1
NOISES = (0, 0.1, 0.3)
NEIGHBORS = (6, 8, 10, 14, 20)


def angles(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Between lines: signs mean nothing. Degrees; a right one where there is no normal."""
    sine = np.linalg.norm(np.cross(found, true), axis=1)
    cosine = np.abs((found * true).sum(1))
    return np.where(np.isnan(sine), 90, np.degrees(np.arctan2(sine, cosine)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("pointmill", "cgal", "pcl", "folder", "results"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    given = parser.parse_args()
    tools = Tools(given.pointmill, given.cgal, given.pcl, given.folder)
    rows = []
    for surface in SHAPES:
        for noise in NOISES:
            points, normals = shape(surface, COUNT, noise, SEED)
            for name, (estimate, fewest) in ESTIMATORS.items():
                if name == "PCL" and not tools.pcl.exists():
                    continue
                for k in (k for k in NEIGHBORS if k >= fewest):
                    off = angles(estimate(tools, points, k), normals)
                    rows.append({"surface": surface, "noise": noise, "by": name, "k": k,
                                 "rms": float(f"{np.sqrt((off**2).mean()):.4g}"),
                                 "p95": float(f"{np.quantile(off, 0.95):.4g}")})
            print(f"{surface}, noise {noise}", flush=True)
    given.results.write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")


if __name__ == "__main__":
    main()
