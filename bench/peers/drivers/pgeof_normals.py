"""XYZ: neighbours (with the point itself, so 11) and features, of which the normal is one."""

import sys

import numpy as np
import pgeof
from timed import clock, tell

points = np.fromfile(sys.argv[1]).reshape(-1, 3).astype(np.float32)
start = clock()
neighbors, _ = pgeof.knn_search(points, points, 11)
ends = np.arange(len(points) + 1, dtype=np.uint32) * 11
pgeof.compute_features(points, neighbors.reshape(-1), ends)
tell(start)
