"""XYZ THREADS: tree and normals; the query point counts as a neighbour, so 11."""

import sys

import numpy as np
import small_gicp
from timed import clock, tell

points = np.fromfile(sys.argv[1]).reshape(-1, 3)
threads = int(sys.argv[2])
start = clock()
cloud = small_gicp.PointCloud(points)
tree = small_gicp.KdTree(cloud, num_threads=threads)
small_gicp.estimate_normals(cloud, tree, num_neighbors=11, num_threads=threads)
tell(start)
