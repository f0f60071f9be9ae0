"""Who estimates normals from the k nearest other points, by name. Knows no surface.

Peers whose k counts the point itself are given one more.
"""

import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass
class Tools:
    """Programs, and the folder for files between them."""

    pointmill: Path
    cgal: Path
    pcl: Path
    folder: Path


def pointmill(method: str):
    def estimate(tools: Tools, points: np.ndarray, k: int) -> np.ndarray:
        scan, out = tools.folder / "in.ply", tools.folder / "out.ply"
        rows = np.empty(len(points), [("at", "<f8", 3), ("id", "<u4")])
        rows["at"], rows["id"] = points, np.arange(len(points))
        properties = "".join(f"property double {axis}\n" for axis in "xyz") + "property uint id\n"
        head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{properties}"
        scan.write_bytes((head + "end_header\n").encode() + rows.tobytes())
        line = (f"read path={scan} ! normals neighbors={k} method={method} "
                f"! write path={out} dimensions=[NormalX,NormalY,NormalZ]")
        subprocess.run([tools.pointmill, "run", line, "--quiet"], check=True)
        import plyfile

        vertex = plyfile.PlyData.read(out)["vertex"]
        names = ("nx", "ny", "nz") if "nx" in vertex else ("NormalX", "NormalY", "NormalZ")
        normals = np.empty((len(points), 3))
        normals[vertex["id"]] = np.stack([vertex[name] for name in names], 1)
        return normals

    return estimate


def driven(program: Path, folder: Path, points: np.ndarray, *arguments: str) -> np.ndarray:
    """What a driver of a C++ library writes."""
    scan, out = folder / "in.bin", folder / "out.bin"
    np.ascontiguousarray(points, np.float64).tofile(scan)
    subprocess.run([program, scan, out, *arguments], check=True)
    return np.fromfile(out, np.float64).reshape(-1, 3)


def cgal(kind: str, *more: str):
    def estimate(tools: Tools, points: np.ndarray, k: int) -> np.ndarray:
        return driven(tools.cgal, tools.folder, points, kind, str(k), *more)

    return estimate


def pcl(tools: Tools, points: np.ndarray, k: int) -> np.ndarray:
    return driven(tools.pcl, tools.folder, points, "normals", str(k))


def open3d(tools: Tools, points: np.ndarray, k: int) -> np.ndarray:
    import open3d

    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(k + 1))
    return np.asarray(cloud.normals)


# A name, how it estimates, and how many neighbours it needs.
ESTIMATORS = {
    "varady": (pointmill("varady"), 3),
    "delaunay": (pointmill("delaunay"), 3),
    "pca": (pointmill("pca"), 3),
    "quadric": (pointmill("quadric"), 5),
    "cubic": (pointmill("cubic"), 9),
    "CGAL pca": (cgal("pca"), 3),
    "CGAL jet 2": (cgal("jet", "2"), 6),
    "CGAL jet 3": (cgal("jet", "3"), 10),
    "PCL": (pcl, 3),
    "Open3D": (open3d, 3),
}
