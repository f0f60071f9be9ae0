"""IN.ply OUT.las SCALE OFFSET: all dimensions, as pointmill names them, in memory."""

import json
import sys

import laspy
import numpy as np
from plyfile import PlyData

vertices = PlyData.read(sys.argv[1])["vertex"].data
header = laspy.LasHeader(version="1.4", point_format=6)
header.scales, header.offsets = (np.array(words.split(","), float) for words in sys.argv[3:5])
scan = laspy.LasData(header, laspy.ScaleAwarePointRecord.zeros(len(vertices), header=header))
for name in vertices.dtype.names:
    scan[name] = np.round(vertices[name] / 0.006) if name == "scan_angle" else vertices[name]
scan.write(sys.argv[2])
print(json.dumps({"kept": len(vertices)}))
