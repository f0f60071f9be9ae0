"""PEER IN.laz OUT.laz SIDE THREADS normals|grid: read, normals if asked, voxel grid, write positions."""

import json
import sys

import laspy
import numpy as np


def small_gicp_kept(points: np.ndarray, side: float, threads: int, normals: bool) -> np.ndarray:
    import small_gicp
    cloud = small_gicp.PointCloud(points)
    if normals:
        tree = small_gicp.KdTree(cloud, num_threads=threads)
        small_gicp.estimate_normals(cloud, tree, num_neighbors=11, num_threads=threads)
    return small_gicp.voxelgrid_sampling(cloud, side, num_threads=threads).points()[:, :3]


def open3d_kept(points: np.ndarray, side: float, threads: int, normals: bool) -> np.ndarray:
    import open3d
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    if normals:
        cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(11))
    return np.asarray(cloud.voxel_down_sample(side).points)


peer, source, target, side, threads, what = sys.argv[1:]
scan = laspy.read(source, laz_backend=laspy.LazBackend.LazrsParallel)
points = scan.xyz
origin = points.min(axis=0)
keep = {"small_gicp": small_gicp_kept, "open3d": open3d_kept}[peer]
kept = keep(points - origin, float(side), int(threads), what == "normals")
result = laspy.LasData(laspy.LasHeader(version="1.4", point_format=6))
result.header.scales, result.header.offsets = scan.header.scales, scan.header.offsets
result.xyz = kept + origin
result.write(target, laz_backend=laspy.LazBackend.LazrsParallel)
print(json.dumps({"kept": len(kept)}))
