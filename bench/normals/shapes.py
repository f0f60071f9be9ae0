"""Analytic surfaces: random points, even by area, and their true normals. Knows no estimator.

Each is about one unit wide. `noise` moves points along their true normals by normal errors, in
multiples of the mean spacing √(area / number of points).
"""

import numpy as np


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def _plane(count: int, random: np.random.Generator):
    """Tilted, so that no axis is special."""
    u = np.array([0.8, 0.0, 0.6])
    v = np.cross([-0.6, 0.36, 0.8], u)
    v /= np.linalg.norm(v)
    at = random.uniform(-0.5, 0.5, (count, 2))
    normal = np.cross(u, v)
    return at[:, :1] * u + at[:, 1:] * v, np.tile(normal / np.linalg.norm(normal), (count, 1)), 1.0


def _sphere(count: int, random: np.random.Generator):
    normals = _unit(random.normal(size=(count, 3)))
    return 0.5 * normals, normals, np.pi


def _cylinder(count: int, random: np.random.Generator):
    turn = random.uniform(0, 2 * np.pi, count)
    normals = np.stack([np.cos(turn), np.sin(turn), np.zeros(count)], 1)
    points = 0.5 * normals
    points[:, 2] = random.uniform(-0.5, 0.5, count)
    return points, normals, np.pi


def _torus(count: int, random: np.random.Generator):
    """Radii 0.5 and 0.2; as many points on a ring as it is long."""
    large, small = 0.5, 0.2
    around = np.empty(0)
    while len(around) < count:
        turn = random.uniform(0, 2 * np.pi, count)
        share = (large + small * np.cos(turn)) / (large + small)
        around = np.concatenate([around, turn[random.uniform(size=count) < share]])
    around, along = around[:count], random.uniform(0, 2 * np.pi, count)
    normals = np.stack([np.cos(around) * np.cos(along), np.cos(around) * np.sin(along),
                        np.sin(around)], 1)
    ring = large * np.stack([np.cos(along), np.sin(along), np.zeros(count)], 1)
    return ring + small * normals, normals, 4 * np.pi**2 * large * small


def _saddle(count: int, random: np.random.Generator):
    """z = x² − y² over a square of side 1; even by area to the per cent that slopes leave."""
    at = np.empty((0, 2))
    steepest = np.sqrt(3.0)
    while len(at) < count:
        tried = random.uniform(-0.5, 0.5, (2 * count, 2))
        area = np.sqrt(1 + 4 * (tried**2).sum(1))
        at = np.concatenate([at, tried[random.uniform(size=2 * count) < area / steepest]])
    x, y = at[:count].T
    normals = _unit(np.stack([-2 * x, 2 * y, np.ones(count)], 1))
    return np.stack([x, y, x * x - y * y], 1), normals, 1.28


def _dihedral(count: int, random: np.random.Generator):
    """Two squares that meet in an edge at a right angle, tilted by an eighth of a turn."""
    along, across = random.uniform(-0.5, 0.5, count), random.uniform(0, 1, count)
    left = random.uniform(size=count) < 0.5
    slope = np.sqrt(0.5)
    points = np.stack([np.where(left, -slope, slope) * across, along, -slope * across], 1)
    normals = np.stack([np.where(left, -slope, slope), np.zeros(count), np.full(count, slope)], 1)
    return points, normals, 2.0


SHAPES = {"plane": _plane, "sphere": _sphere, "cylinder": _cylinder, "torus": _torus,
          "saddle": _saddle, "dihedral": _dihedral}


def shape(name: str, count: int, noise: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and true normals, both `count` × 3."""
    random = np.random.default_rng([seed, *name.encode()])
    points, normals, area = SHAPES[name](count, random)
    moved = random.normal(size=(count, 1)) * noise * np.sqrt(area / count)
    return points + moved * normals, normals
