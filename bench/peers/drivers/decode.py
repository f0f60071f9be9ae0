"""IN.laz BACKEND: all records decoded, some at a time, and forgotten."""

import json
import sys
import time

import laspy

wall, cpu, kept = time.perf_counter(), time.process_time(), 0
with laspy.open(sys.argv[1], laz_backend=laspy.LazBackend[sys.argv[2]]) as scan:
    for points in scan.chunk_iterator(50_000):
        kept += len(points)
print(json.dumps({"cpu_seconds": time.process_time() - cpu, "wall_seconds": time.perf_counter() - wall, "kept": kept}))
