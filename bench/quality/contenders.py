"""Who reduces a scene to a number of points, by name. Knows no figure.

A contender takes a `Job` and gives indices of the points it keeps; WLOP, which makes new points,
gives their positions. Whoever has a length to set instead of a number is asked again until the
number is right; every contender is tuned as far as that goes.
"""

import os
import subprocess
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from counts import matched, voxel_kept, voxel_side


@dataclass
class Job:
    """A scene's points (n × 3), how many to keep, and the programs and the folder to do it with."""

    points: np.ndarray
    count: int
    pointmill: Path
    cgal: Path
    pcl: Path
    folder: Path

    @cached_property
    def side(self) -> float:
        """Side of the voxel grid that keeps as many: the yardstick of lengths."""
        return voxel_side(self.points, self.count)

    @cached_property
    def tree(self) -> cKDTree:
        return cKDTree(self.points)

    def file(self, name: str) -> Path:
        return self.folder / f"{os.getpid()}-{name}"


# ---- pointmill


def write_ply(path: Path, points: np.ndarray) -> None:
    """Positions and, as `id`, their places in the scene."""
    rows = np.empty(len(points), [("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("id", "<u4")])
    rows["x"], rows["y"], rows["z"] = points.T
    rows["id"] = np.arange(len(points))
    kinds = {"x": "double", "y": "double", "z": "double", "id": "uint"}
    properties = "".join(f"property {kinds[name]} {name}\n" for name in rows.dtype.names)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{properties}"
    path.write_bytes((head + "end_header\n").encode() + rows.tobytes())


def read_ids(path: Path) -> np.ndarray:
    import plyfile

    return np.asarray(plyfile.PlyData.read(path)["vertex"]["id"], np.int64)


def reduce(*options: str):
    """`pointmill reduce IN.ply -o OUT.ply --keep N`, as a user calls it."""

    def keep(job: Job) -> np.ndarray:
        scan, kept = job.file("in.ply"), job.file("out.ply")
        write_ply(scan, job.points)
        command = [job.pointmill, "reduce", scan, "-o", kept, "--keep", job.count, "--quiet"]
        subprocess.run([*map(str, command), *options], check=True)
        ids = read_ids(kept)
        scan.unlink()
        kept.unlink()
        return ids

    return keep


def read_positions(path: Path) -> np.ndarray:
    import plyfile

    vertex = plyfile.PlyData.read(path)["vertex"]
    return np.stack([np.asarray(vertex[axis], np.float64) for axis in "xyz"], 1)


def stages(job: Job, line: str, moved: bool = True) -> np.ndarray:
    """What stages in one line leave: positions where points are moved, else places in the scene."""
    scan, kept = job.file("in.ply"), job.file("out.ply")
    write_ply(scan, job.points)
    pipeline = f"read {scan} ! {line} ! write {kept}"
    subprocess.run([str(job.pointmill), "run", pipeline, "--quiet"], check=True)
    found = read_positions(kept) if moved else read_ids(kept)
    scan.unlink()
    kept.unlink()
    return found


# ---- what takes a few lines


def voxel(job: Job) -> np.ndarray:
    """Of every cube of a grid the point nearest to its centre."""
    return voxel_kept(job.points, job.side)


def random(job: Job) -> np.ndarray:
    return np.random.default_rng(7).choice(len(job.points), job.count, False)


def poisson(job: Job) -> np.ndarray:
    """Dart throwing: no two kept points are nearer than a radius, and no more fit."""
    order = np.random.default_rng(5).permutation(len(job.points))

    def thrown(radius: float) -> np.ndarray:
        taken, kept = np.zeros(len(job.points), bool), []
        for i in order:
            if not taken[i]:
                kept.append(i)
                taken[job.tree.query_ball_point(job.points[i], radius)] = True
        return np.array(kept)

    return matched(thrown, job.count, 0.3 * job.side, 1.6 * job.side, 10, 0.005)[0]


# ---- CGAL and PCL, by cgal.cpp and pcl.cpp


def driven(job: Job, program: Path, kind: type, *arguments: str | float) -> np.ndarray:
    """What a driver writes of the points."""
    scan, kept = job.file("in.bin"), job.file("out.bin")
    job.points.astype("<f8").tofile(scan)
    command = [program, scan, kept, *arguments]
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
    values = np.fromfile(kept, kind)
    scan.unlink()
    kept.unlink()
    return values


def hierarchy(variation: float):
    """Clusters split until their variation is below a bound; their size gives the number."""
    return lambda job: driven(
        job, job.cgal, np.int32, "hierarchy", job.count, variation).astype(np.int64)


def wlop(job: Job) -> np.ndarray:
    """Weighted locally optimal projection: new positions, 20 iterations."""
    return driven(job, job.cgal, np.float64, "wlop", job.count, 20).reshape(-1, 3)


def pcl(kind: str):
    """PCL's sampling in the space of normals, or by the covariance of what it constrains."""
    return lambda job: driven(job, job.pcl, np.int32, kind, job.count).astype(np.int64)


# ---- MeshLab and Open3D


def meshlab_simplify(job: Job) -> np.ndarray:
    """Poisson disks by "simplified point cloud" with the best sample of each."""
    import pymeshlab

    def simplified(radius: float) -> np.ndarray:
        meshes = pymeshlab.MeshSet(verbose=False)
        meshes.add_mesh(pymeshlab.Mesh(job.points))
        length = pymeshlab.PureValue(radius)
        meshes.generate_simplified_point_cloud(radius=length, bestsampleflag=True)
        return meshes.current_mesh().vertex_matrix()

    low, high = 0.3 * job.side, 1.6 * job.side
    return job.tree.query(matched(simplified, job.count, low, high, 12, 0.005)[0])[1]


def variation(job: Job, count: int = 30) -> np.ndarray:
    """Surface variation of each point and its 30 neighbours: smallest eigenvalue by their sum."""
    _, near = job.tree.query(job.points, k=count + 1)
    found = np.empty(len(job.points))
    for start in range(0, len(job.points), 50_000):
        offsets = job.points[near[start : start + 50_000]]
        offsets = offsets - offsets.mean(1, keepdims=True)
        values = np.linalg.eigvalsh(np.einsum("nki,nkj->nij", offsets, offsets))
        found[start : start + 50_000] = values[:, 0] / values.sum(1)
    return found


def meshlab_curvature(job: Job) -> np.ndarray:
    """Poisson disks of a radius that falls to a quarter where the surface bends most."""
    import pymeshlab

    # Ranks, as MeshLab scales the radius between the extremes of the quality that it is given.
    rank = np.argsort(np.argsort(variation(job))) / len(job.points)

    def sampled(factor: float) -> np.ndarray:
        meshes = pymeshlab.MeshSet(verbose=False)
        meshes.add_mesh(pymeshlab.Mesh(job.points, v_scalar_array=1 - rank))
        count = int(job.count * 3 / factor)
        meshes.generate_sampling_poisson_disk(samplenum=count, subsample=True, radiusvariance=4.0)
        return meshes.current_mesh().vertex_matrix()

    return job.tree.query(matched(sampled, job.count, 0.2, 12, 12, 0.01)[0])[1]


def farthest(job: Job) -> np.ndarray:
    """Farthest point sampling of Open3D."""
    import open3d

    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(job.points))
    return job.tree.query(np.asarray(cloud.farthest_point_down_sample(job.count).points))[1]


# ---- the methods that the paper is beside, and its own, as pointmill has them


def by_side(line: str, moved: bool):
    """Stages that keep the fewer the larger a side is."""

    def keep(job: Job) -> np.ndarray:
        def kept(side: float) -> np.ndarray:
            return stages(job, line.format(side=side), moved=moved)

        return matched(kept, job.count, 0.2 * job.side, 8 * job.side, 14, 0.005)[0]

    return keep


def averaged(job: Job) -> np.ndarray:
    """Neighbourhood averaging, then a uniform grid."""
    smooth = stages(job, "smooth neighbors=20")
    return smooth[voxel_kept(smooth, voxel_side(smooth, job.count))]


def by_count(line: str, moved: bool):
    """Stages that take a number of points."""
    return lambda job: stages(job, line.format(count=job.count), moved=moved)


def every(job: Job) -> np.ndarray:
    number = round(len(job.points) / job.count)
    return stages(job, f"sample every={number}", moved=False)


OURS = "graded"
METHODS = {
    "every nth": every,
    "grid and median": by_side("grid side={side} pick=median", False),
    "averaging, then grid": averaged,
    "Gaussian image": by_side("normals ! gaussian-image side={side} ! median pick=centroid", True),
    "paper, centre of mass": by_count(
        "normals ! cells keep={count} ! median pick=centroid", True),
    "paper, Dirichlet": by_count(
        "normals ! cells keep={count} split=dirichlet ! median", False),
    "triangle removal": by_count("triangles keep={count}", False),
    "wavelet": by_count("wavelet keep={count}", True),
    "fourier": by_count("fourier keep={count}", True),
    "PCL normal space": pcl("normal-space"),
    "PCL covariance": pcl("covariance"),
}
CONTENDERS = {
    OURS: reduce(),
    "pointmill paper": reduce("--preset", "paper"),
    "voxel": voxel,
    "random": random,
    "Poisson disk": poisson,
    "CGAL hierarchy 0.33": hierarchy(0.3333),
    "CGAL hierarchy 0.03": hierarchy(0.03),
    "CGAL hierarchy 0.01": hierarchy(0.01),
    "CGAL hierarchy 0.003": hierarchy(0.003),
    "MeshLab simplify": meshlab_simplify,
    "MeshLab curvature": meshlab_curvature,
    "Open3D farthest": farthest,
    "CGAL WLOP": wlop,
}
# Measured at five shares, in results of their own: methods.jsonl.
BESIDE_METHODS = (OURS, "pointmill paper", "voxel", "random", "Poisson disk",
                  "CGAL hierarchy 0.03", "MeshLab simplify", "Open3D farthest", "CGAL WLOP")
ALL = CONTENDERS | METHODS
# Time grows with the square of what is kept, or the point: not run above so many points.
MOST = {"Open3D farthest": 3_000, "CGAL WLOP": 8_000}
