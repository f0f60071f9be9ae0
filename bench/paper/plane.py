"""The least-squares plane of points, and what lies far from it; PLY texts of points.

The plane is the one that the report measures by: of total least squares, through the centre of
mass, normal to the direction in which points vary least.
"""

import math
from pathlib import Path


def read_points(path: Path) -> list[tuple[float, float, float]]:
    lines = path.read_text(encoding="utf-8").splitlines()
    body = lines.index("end_header") + 1
    names = [line.split()[2] for line in lines[:body] if line.startswith("property")]
    at = [names.index(name) for name in ("x", "y", "z")]
    rows = (line.split() for line in lines[body:])
    return [tuple(float(row[n]) for n in at) for row in rows]


def write_points(path: Path, points: list[tuple[float, float, float]]) -> None:
    head = (f"ply\nformat ascii 1.0\nelement vertex {len(points)}\nproperty double x\n"
            "property double y\nproperty double z\nend_header\n")
    path.write_text(head + "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in points), encoding="utf-8")


def least_direction(matrix: list[list[float]]) -> list[float]:
    """The eigenvector of the smallest eigenvalue of a symmetric 3 × 3 matrix, by Jacobi rotations."""
    a = [row[:] for row in matrix]
    v = [[float(i == j) for j in range(3)] for i in range(3)]
    for _ in range(60):
        p, q = max(((0, 1), (0, 2), (1, 2)), key=lambda pair: abs(a[pair[0]][pair[1]]))
        if abs(a[p][q]) < 1e-300:
            break
        angle = 0.5 * math.atan2(2 * a[p][q], a[q][q] - a[p][p])
        c, s = math.cos(angle), math.sin(angle)
        for k in range(3):
            a[k][p], a[k][q] = c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]
        for k in range(3):
            a[p][k], a[q][k] = c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]
        for k in range(3):
            v[k][p], v[k][q] = c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]
    least = min(range(3), key=lambda i: a[i][i])
    return [v[k][least] for k in range(3)]


def far_from_plane(points: list, multiplier: float) -> tuple[float, list[bool]]:
    """The RMS of the distances to the plane of all, and of each point whether it is farther from it
    than the mean of these distances and so many standard deviations."""
    n = len(points)
    center = [sum(p[k] for p in points) / n for k in range(3)]
    off = [[p[k] - center[k] for k in range(3)] for p in points]
    matrix = [[sum(o[i] * o[j] for o in off) for j in range(3)] for i in range(3)]
    normal = least_direction(matrix)
    far = [abs(sum(o[k] * normal[k] for k in range(3))) for o in off]
    mean = sum(far) / n
    sigma = math.sqrt(sum((d - mean) ** 2 for d in far) / n)
    rms = math.sqrt(sum(d * d for d in far) / n)
    return rms, [d > mean + multiplier * sigma for d in far]
