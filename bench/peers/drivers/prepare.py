"""SCAN.laz OUT.xyz COUNT: positions as float64 from their minimum, and the voxel side that keeps COUNT."""

import json
import sys

import laspy
import numpy as np

points = laspy.read(sys.argv[1]).xyz
points -= points.min(axis=0)
points.astype("<f8").tofile(sys.argv[2])
low, high = 0.01, 100.0
for _ in range(12):
    side = (low * high) ** 0.5
    cells = np.floor(points / side).astype(np.int64)
    count = len(np.unique((cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2]))
    low, high = (side, high) if count > int(sys.argv[3]) else (low, side)
print(json.dumps({"side": round((low * high) ** 0.5, 3)}))
