"""XYZ: tree and normals; the query point counts as a neighbour, so 11."""

import sys

import numpy as np
import open3d
from timed import clock, tell

points = np.fromfile(sys.argv[1]).reshape(-1, 3)
start = clock()
cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(11))
tell(start)
