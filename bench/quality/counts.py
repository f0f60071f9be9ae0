"""Settings that keep a given number of points, and the voxel grid, which is the yardstick."""

from collections.abc import Callable

import numpy as np


def matched(keep: Callable, count: int, low: float, high: float, tries: int, within: float):
    """What `keep` gives nearest to `count`, and its setting.

    `keep` takes a setting between `low` and `high` and keeps the fewer the larger it is. It is
    asked at most `tries` times, by bisection of the logarithm, until the number is off by less
    than a share `within`.
    """
    best = None
    for _ in range(tries):
        setting = (low * high) ** 0.5
        kept = keep(setting)
        if best is None or abs(len(kept) - count) < abs(len(best[0]) - count):
            best = kept, setting
        if abs(len(kept) - count) <= within * count:
            break
        if len(kept) > count:
            low = setting
        else:
            high = setting
    return best


def cubes(points: np.ndarray, side: float) -> np.ndarray:
    """The cube of each point of a grid, as one number."""
    cube = np.floor(points / side).astype(np.int64)
    cube -= cube.min(0)
    return (cube[:, 0] << 42) | (cube[:, 1] << 21) | cube[:, 2]


def voxel_kept(points: np.ndarray, side: float) -> np.ndarray:
    """Of every cube the point nearest to its centre."""
    centre = (np.floor(points / side) + 0.5) * side
    cube = cubes(points, side)
    order = np.lexsort((((points - centre) ** 2).sum(1), cube))
    return order[np.r_[True, np.diff(cube[order]) > 0]]


def voxel_side(points: np.ndarray, count: int) -> float:
    """Side of the grid that has `count` cubes with points, to 0.2 %."""
    extent = np.ptp(points, axis=0).max()

    def occupied(side: float) -> np.ndarray:
        return np.unique(cubes(points, side))

    return matched(occupied, count, 1e-3 * extent, 0.5 * extent, 24, 0.002)[1]
