"""IN.las OUT.ply: all dimensions, in memory."""

import json
import sys

import laspy
import numpy as np
from plyfile import PlyData, PlyElement

scan = laspy.read(sys.argv[1])
columns = {axis: np.asarray(scan[axis]) for axis in "xyz"}
columns |= {name: np.asarray(scan[name]) for name in scan.point_format.dimension_names if name not in "XYZ"}
columns["scan_angle"] = columns["scan_angle"] * 0.006
vertices = np.empty(len(scan.points), [(name, column.dtype) for name, column in columns.items()])
for name, column in columns.items():
    vertices[name] = column
PlyData([PlyElement.describe(vertices, "vertex")]).write(sys.argv[2])
print(json.dumps({"kept": len(vertices)}))
