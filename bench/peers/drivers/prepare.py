"""SCAN.laz OUT.xyz OUT.ply COUNT: positions as float64 from their minimum, without and with a header; tells the voxel
side that keeps COUNT, and the radius that holds 11 points (the median of a sample)."""

import json
import sys

import laspy
import numpy as np
from scipy.spatial import cKDTree

points = laspy.read(sys.argv[1]).xyz
points -= points.min(axis=0)
points.astype("<f8").tofile(sys.argv[2])
with open(sys.argv[3], "wb") as file:
    properties = "".join(f"property double {axis}\n" for axis in "xyz")
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{properties}end_header\n"
    file.write(head.encode())
    points.astype("<f8").tofile(file)
low, high = 0.01, 100.0
for _ in range(12):
    side = (low * high) ** 0.5
    cells = np.floor(points / side).astype(np.int64)
    count = len(np.unique((cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2]))
    low, high = (side, high) if count > int(sys.argv[4]) else (low, side)
sample = points[np.random.default_rng(1).integers(0, len(points), 10_000)]
radius = np.median(cKDTree(points).query(sample, 11)[0][:, 10])
print(json.dumps({"side": round((low * high) ** 0.5, 3), "radius": round(float(radius), 3)}))
