"""The scenes: points to reduce and samples that judge the reduction. Knows no contender.

Made scenes have samples of the true surface, without noise. Of a real scan, and of the made
airborne one, samples are points held out of the input, so that keeping an outlier improves nothing.
Random numbers are drawn in the order of the prototype, whose figures `bars.json` has: the same seed
gives the same points.
"""

import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np
import plyfile

import surfaces

SAMPLES = 40_000
POINTS = 200_000
REAL_POINTS = 240_000


@dataclass
class Scene:
    """Positions to reduce (n × 3, float64) and samples (m × 3), in the same unit."""

    points: np.ndarray
    samples: np.ndarray


class Maker:
    """Makes scenes by a pointmill program and from a folder of scans; keeps them in a folder."""

    def __init__(self, pointmill: Path, scans: Path | None, folder: Path):
        self.pointmill, self.scans, self.folder = pointmill, scans, folder
        folder.mkdir(parents=True, exist_ok=True)

    def scene(self, name: str, seed: int) -> Scene:
        path = self.folder / f"{name}-{seed}.npz"
        if not path.exists():
            made = SCENES[name](self, seed)
            part = path.with_suffix(f".{os.getpid()}.npz")
            np.savez(part, points=made.points, samples=made.samples)
            part.rename(path)
        with np.load(path) as stored:
            return Scene(stored["points"], stored["samples"])

    def synth(self, kind: str, count: int, noise: float | None, seed: int) -> np.ndarray:
        """Positions of a scan of `pointmill synth`."""
        path = self.folder / f"synth-{os.getpid()}.las"
        command = [self.pointmill, "synth", kind, "-n", count, "--seed", seed, "-o", path]
        command += ["--quiet"] + ([] if noise is None else ["--noise", noise])
        subprocess.run([str(word) for word in command], check=True)
        positions = las(path)
        path.unlink()
        return positions

    def scan(self, path: str) -> Path:
        if self.scans is None:
            raise FileNotFoundError(f"POINTMILL_SCANS names no folder of scans, which has {path}")
        return self.scans / path


def las(path: Path) -> np.ndarray:
    """Positions of a LAS or LAZ file, n × 3."""
    file = laspy.read(path)
    return np.stack([file.x, file.y, file.z], 1).astype(np.float64)


def ply(path: Path) -> np.ndarray:
    """Vertices of a PLY file, n × 3."""
    vertex = plyfile.PlyData.read(path)["vertex"]
    return np.stack([np.asarray(vertex[axis], np.float64) for axis in "xyz"], 1)


def synthetic(kind: str, noise: float, samples: int):
    """A made scan and samples of the same surface without noise."""

    def make(maker: Maker, seed: int) -> Scene:
        truth = maker.synth(kind, samples, 0, seed + 1000)
        return Scene(maker.synth(kind, POINTS, noise, seed), truth[:SAMPLES])

    return make


def analytic(surface, noise: float, samples: int, mixed: bool = False):
    """A surface of `surfaces`, with normal noise; `mixed`: samples come sorted."""

    def make(maker: Maker, seed: int) -> Scene:
        random = np.random.default_rng(seed)
        points = surface(POINTS, random)
        if noise > 0:
            points = points + noise * random.normal(size=points.shape)
        random = np.random.default_rng(seed + 1000)
        truth = surface(samples, random)
        return Scene(points, (truth[random.permutation(len(truth))] if mixed else truth)[:SAMPLES])

    return make


def held_out(points: np.ndarray, seed: int) -> Scene:
    """Distinct positions near the origin, 40,000 (or a fifth) of them held out as samples."""
    _, first = np.unique(points, axis=0, return_index=True)
    points = points[np.sort(first)]
    points = points - np.floor(points.min(0))
    order = np.random.default_rng(seed + 77).permutation(len(points))
    count = min(SAMPLES, len(points) // 5)
    return Scene(points[np.sort(order[count:])], points[np.sort(order[:count])])


def airborne(maker: Maker, seed: int) -> Scene:
    return held_out(maker.synth("als", REAL_POINTS, None, seed), seed)


def crop(path: str, across: tuple[float, float], along: tuple[float, float]):
    """The square of 240,000 points around quantiles of x and y: one of even, one of odd seeds."""

    def make(maker: Maker, seed: int) -> Scene:
        points = las(maker.scan(path))
        which = seed % 2
        middle = [np.quantile(points[:, 0], across[which]), np.quantile(points[:, 1], along[which])]
        distance = np.abs(points[:, :2] - middle).max(1)
        return held_out(points[np.sort(np.argpartition(distance, REAL_POINTS)[:REAL_POINTS])], seed)

    return make


def model(path: str):
    """Vertices of a model, 100 units long."""

    def make(maker: Maker, seed: int) -> Scene:
        points = ply(maker.scan(path))
        return held_out(points * (100 / np.ptp(points, axis=0).max()), seed)

    return make


SCENES = {
    "part_clean": synthetic("part", 0, 1_000_000),
    "part_noisy": synthetic("part", 0.1, 1_000_000),
    "roofs": analytic(surfaces.roofs, 0.03, 800_000, mixed=True),
    "sphere": synthetic("sphere", 0.05, SAMPLES),
    "torus": analytic(surfaces.torus, 0.02, SAMPLES),
    "freeform": analytic(surfaces.freeform, 0, 800_000),
    "als": airborne,
    "village": crop("big/huayllapata_1.06M.laz", (0.5, 0.3), (0.5, 0.6)),
    "city": crop("big/marblemm_city_10M.laz", (0.5, 0.3), (0.5, 0.4)),
    "horse": model("vtk-data/horse.ply"),
}
