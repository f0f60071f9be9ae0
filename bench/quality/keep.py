"""Lets contenders reduce scenes; what they keep is stored, and only what is missing runs."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from contenders import ALL, MOST, Job
from scenes import Maker

SHARES = (0.01, 0.03, 0.1)
SEEDS = (0, 1)
# Of the methods of the paper and who is beside them.
METHOD_SHARES = (0.01, 0.02, 0.05, 0.1, 0.2)
METHOD_SEEDS = (0,)
METHOD_SCENES = ("part_clean", "part_noisy", "freeform", "roofs", "als", "village", "city")


@dataclass
class Bench:
    """Where the programs are, and the folder that scenes and what is kept of them go to."""

    pointmill: Path
    cgal: Path
    pcl: Path
    maker: Maker
    folder: Path

    def kept_file(self, scene: str, seed: int, share: float, contender: str) -> Path:
        name = contender.replace(" ", "-")
        return self.folder / "kept" / f"{scene}-{seed}-{share:g}-{name}.npz"

    def job(self, points: np.ndarray, share: float) -> Job:
        count = round(share * len(points))
        return Job(points, count, self.pointmill, self.cgal, self.pcl, self.folder)


def store(path: Path, kept: np.ndarray, seconds: float) -> None:
    part = path.with_suffix(f".{os.getpid()}.part.npz")
    np.savez(part, kept=kept, seconds=seconds)
    part.rename(path)


def keep_scene(bench: Bench, scene: str, seed: int, share: float, names: list[str]) -> None:
    """What is missing of one scene at one share; a contender that fails is said and left out."""
    missing = [n for n in names if not bench.kept_file(scene, seed, share, n).exists()]
    if not missing:
        return
    job = bench.job(bench.maker.scene(scene, seed).points, share)
    for name in missing:
        if job.count > MOST.get(name, job.count):
            continue
        start = time.monotonic()
        try:
            kept = ALL[name](job)
        except Exception as error:
            print(f"{scene} {seed} {share:.0%} {name}: failed: {error!r:.300}", flush=True)
            continue
        seconds = time.monotonic() - start
        store(bench.kept_file(scene, seed, share, name), kept, seconds)
        print(f"{scene} {seed} {share:.0%} {name}: {len(kept)} in {seconds:.1f} s", flush=True)
