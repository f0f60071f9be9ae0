"""Surfaces by formula: n random points on each (n × 3, in metres). Knows no noise and no files."""

import numpy as np


def torus(count: int, random: np.random.Generator) -> np.ndarray:
    """Radii 30 and 10, uniform over the surface."""
    angles = np.empty((0, 2))
    while len(angles) < count:
        a = random.random((2 * count, 3))
        taken = a[:, 2] * 40 < 30 + 10 * np.cos(2 * np.pi * a[:, 1])
        angles = np.concatenate([angles, a[taken, :2] * 2 * np.pi])
    u, v = angles[:count].T
    ring = 30 + 10 * np.cos(v)
    return np.stack([ring * np.cos(u), ring * np.sin(u), 10 * np.sin(v)], 1)


def freeform(count: int, random: np.random.Generator) -> np.ndarray:
    """A height field of 100 × 100: swells, ripples in one part, a crease and a bump."""
    xy = random.random((count, 2)) * 100
    x, y = xy.T
    crease = x - 50 - 12 * np.sin(y / 18)
    ripples = 0.6 * np.sin(x / 4) * np.sin(y / 4) * (y > 60) * np.clip((y - 60) / 10, 0, 1)
    bump = 5 * np.exp(-((x - 20) ** 2 + (y - 25) ** 2) / 30)
    z = 4 * np.sin(x / 25) * np.cos(y / 30) + ripples + 0.35 * np.abs(crease) + bump
    return np.c_[xy, z]


def hills(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Height of the ground of `roofs`, with an embankment."""
    embankment = np.clip((x - 95 + 8 * np.sin(y / 20)) / 3, 0, 1)
    return 3 * np.sin(x / 17) * np.cos(y / 13) + 2.5 * embankment


def houses() -> list[tuple[float, float, float, float, bool]]:
    """Middle, half width across the ridge, half length along it, whether the ridge lies along x."""
    return [
        (15 + 28 * i + 4 * ((i * 7 + j * 3) % 3), 14 + 27 * j + 3 * ((i + j) % 2),
         4 + (i * 5 + j) % 3, 6 + (i + 2 * j) % 3, (i + j) % 2 == 1)
        for i in range(4) for j in range(4) if (i, j) not in ((1, 2), (3, 0))
    ]


def roofs(count: int, random: np.random.Generator) -> np.ndarray:
    """Hills of 140 × 140 with 14 houses: gable roofs on walls of 4."""
    wall_area = sum(16.0 * (half + length) for _, _, half, length, _ in houses())
    on_walls = int(count * wall_area / (wall_area + 140 * 140))
    xy = random.random((count - on_walls, 2)) * 140
    z = hills(*xy.T)
    walls = []
    for house in houses():
        x, y, half, length, turned = house
        u, v = xy[:, 0] - x, xy[:, 1] - y
        if turned:
            u, v = v, u
        inside = (np.abs(u) < half) & (np.abs(v) < length)
        z[inside] = hills(x, y) + 4.0 + (half - np.abs(u[inside])) * 0.7
        walls += [wall(house, side, on_walls / wall_area, random) for side in range(4)]
    return np.concatenate([np.c_[xy, z], *walls])


def wall(house: tuple, side: int, density: float, random: np.random.Generator) -> np.ndarray:
    """One wall of a house: sides 0 and 1 below the eaves, 2 and 3 with a gable."""
    x, y, half, length, turned = house
    below_eaves = side < 2
    width, away = (length, half) if below_eaves else (half, length)
    count = int(density * 2 * width * 4.0)
    along = (2 * random.random(count) - 1) * width
    across = np.full(count, (1, -1)[side & 1] * away)
    u, v = (across, along) if below_eaves else (along, across)
    gable = 0 if below_eaves else (half - np.abs(u)) * 0.7
    eaves = hills(x, y) + 4.0
    z = eaves - 4 + random.random(count) * (4 + gable)
    return np.c_[np.stack([v, u] if turned else [u, v], 1) + [x, y], z]
