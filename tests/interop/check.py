#!/usr/bin/env python3
"""Files that pointmill writes, read by others, and files of others, read by pointmill.

usage: check.py POINTMILL

Needs the packages of requirements.txt beside this file. Every value is compared with what was to be
written; exits with 1 at the first that differs.
"""

import csv
import subprocess
import sys
import tempfile
from pathlib import Path

import laspy
import numpy as np
import plyfile
import pye57
import trimesh
from laspy.copc import Bounds, CopcReader
from pypcd4 import Encoding, PointCloud

POINTS = 5000
checked = 0


def pointmill(*arguments: object) -> None:
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{arguments}: {done.stderr}")


def same(what: str, found: object, wanted: np.ndarray, off: float = 0.0) -> None:
    """Fails unless the numbers are those that are wanted, but for so much."""
    global checked
    found = np.asarray(found, dtype=float)
    if found.shape != wanted.shape:
        sys.exit(f"{what}: {found.shape} numbers, not {wanted.shape}")
    far = np.abs(found - wanted).max(initial=0.0)
    if not far <= off:
        sys.exit(f"{what}: off by {far}")
    checked += 1


def made() -> dict[str, np.ndarray]:
    """Points with all that the formats have in common."""
    random = np.random.default_rng(7)
    normal = random.normal(size=(POINTS, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    points = {
        "X": np.round(random.uniform(500_000, 500_100, POINTS), 3),
        "Y": np.round(random.uniform(5_600_000, 5_600_100, POINTS), 3),
        "Z": np.round(random.uniform(-5, 90, POINTS), 3),
        "Intensity": random.integers(0, 65_536, POINTS),
        "Classification": random.integers(0, 32, POINTS),
    }
    points |= {name: random.integers(0, 256, POINTS) for name in ("Red", "Green", "Blue")}
    points |= {f"Normal{axis}": normal[:, i] for i, axis in enumerate("XYZ")}
    return points


def write_csv(path: Path, points: dict[str, np.ndarray]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(points)
        writer.writerows(zip(*(values.tolist() for values in points.values())))


def read_csv(path: Path) -> dict[str, np.ndarray]:
    with path.open() as file:
        names, *rows = list(csv.reader(file))
    return dict(zip(names, np.array(rows, dtype=float).reshape(-1, len(names)).T))


def check_las(at: Path, points: dict[str, np.ndarray]) -> None:
    for name in ("a.las", "a.laz"):
        pointmill("convert", at / "in.csv", "-o", at / name, "--scale", 0.001,
                  "--offset", "500000,5600000,0")
        las = laspy.read(at / name)
        for axis in "xyz":
            same(f"laspy {name} {axis}", las[axis], points[axis.upper()], 1e-9)
        same(f"laspy {name} intensity", las.intensity, points["Intensity"])
        same(f"laspy {name} class", las.classification, points["Classification"])
        same(f"laspy {name} red", las.red, points["Red"] * 257)
        same(f"laspy {name} normal", las["NormalZ"], points["NormalZ"])


def check_copc(at: Path) -> None:
    """Every point is in the node that holds it, and each level is read by itself."""
    pointmill("synth", "als", "-n", 200_000, "-o", at / "a.laz")
    pointmill("convert", at / "a.laz", "-o", at / "a.copc.laz")
    plain = laspy.read(at / "a.laz")
    with CopcReader.open(at / "a.copc.laz") as reader:
        info, levels = reader.copc_info, []
        side = 2 * info.halfsize
        lowest = np.asarray(info.center) - info.halfsize
        while len(part := reader.query(level=len(levels))) > 0:
            levels.append(part)
        for key, entry in reader.root_page.entries.items():
            node = side / 2**key.level
            corner = lowest + node * np.asarray([key.x, key.y, key.z])
            inside = reader.query(Bounds(corner + node / 4, corner + 3 * node / 4), level=key.level)
            same(f"node {key.level}", len(inside) <= entry.point_count, np.asarray(1.0))
        half = Bounds(lowest, lowest + np.asarray([info.halfsize, side, side]))
        west = len(reader.query(half))
    if len(levels) < 2:
        sys.exit(f"COPC has {len(levels)} levels")
    same("COPC box", west, np.asarray(np.sum(plain.x <= lowest[0] + info.halfsize)))
    order = np.lexsort((plain.Z, plain.Y, plain.X, plain.gps_time))
    for name in ("X", "Y", "Z", "gps_time", "return_number", "classification"):
        found = np.concatenate([np.asarray(level[name]) for level in levels])
        axes = [np.concatenate([np.asarray(level[axis]) for level in levels]) for axis in "ZYX"]
        times = np.concatenate([np.asarray(level["gps_time"]) for level in levels])
        same(f"COPC {name}", found[np.lexsort((*axes, times))], np.asarray(plain[name])[order])


def check_ply(at: Path, points: dict[str, np.ndarray]) -> None:
    for encoding in ("ascii", "binary"):
        pointmill("convert", at / "in.csv", "-o", at / "a.ply", "--encoding", encoding)
        vertex = plyfile.PlyData.read(at / "a.ply")["vertex"]
        wanted = {"x": "X", "y": "Y", "z": "Z", "intensity": "Intensity", "red": "Red", "nz": "NormalZ"}
        for name, dimension in wanted.items():
            same(f"plyfile {encoding} {name}", vertex[name], points[dimension])


def check_pcd(at: Path, points: dict[str, np.ndarray]) -> None:
    for encoding in ("ascii", "binary"):
        pointmill("convert", at / "in.csv", "-o", at / "a.pcd", "--encoding", encoding)
        cloud = PointCloud.from_path(at / "a.pcd")
        wanted = {"x": "X", "y": "Y", "z": "Z", "intensity": "Intensity", "normal_z": "NormalZ"}
        for name, dimension in wanted.items():
            same(f"pypcd4 {encoding} {name}", cloud.pc_data[name], points[dimension])
        rgb = np.ascontiguousarray(cloud.pc_data["rgb"]).view(np.uint32)
        same(f"pypcd4 {encoding} red", rgb >> 16 & 255, points["Red"])
        same(f"pypcd4 {encoding} blue", rgb & 255, points["Blue"])
    few = np.stack([points["X"] - 500_000, points["Y"] - 5_600_000, points["Z"], points["Intensity"]])
    few = few.T.astype(np.float32)
    for encoding in Encoding:
        PointCloud.from_xyzi_points(few).save(at / "other.pcd", encoding=encoding)
        pointmill("convert", at / "other.pcd", "-o", at / "other.csv")
        back = read_csv(at / "other.csv")
        same(f"{encoding} by pypcd4, x", back["X"].astype(np.float32), few[:, 0])
        same(f"{encoding} by pypcd4, intensity", back["Intensity"], few[:, 3])


def check_e57(at: Path, points: dict[str, np.ndarray]) -> None:
    pointmill("convert", at / "in.csv", "-o", at / "a.e57")
    cloud = pye57.E57(str(at / "a.e57"))
    raw = cloud.read_scan_raw(0, ignore_unsupported_fields=True)
    wanted = {"cartesianX": "X", "cartesianY": "Y", "cartesianZ": "Z", "intensity": "Intensity",
              "colorRed": "Red"}
    for name, dimension in wanted.items():
        same(f"pye57 {name}", raw[name], points[dimension])
    cloud.close()
    half = np.sqrt(0.5)
    # It writes coordinates in single precision.
    local = {"X": points["X"] - 500_000, "Y": points["Y"] - 5_600_000, "Z": points["Z"]}
    with pye57.E57(str(at / "other.e57"), mode="w") as other:
        for shift in (0.0, 1000.0):
            own = {f"cartesian{axis}": local[axis] for axis in "XYZ"}
            own |= {"intensity": points["Intensity"].astype(float)}
            other.write_scan_raw(own, rotation=np.array([half, 0, 0, half]),
                                 translation=np.array([shift, 0, 0]))
    pointmill("convert", at / "other.e57", "-o", at / "other.csv", "--quiet")
    back = read_csv(at / "other.csv")
    same("E57 by pye57, x", back["X"][POINTS:], 1000 - local["Y"], 1e-5)
    same("E57 by pye57, y", back["Y"][:POINTS], local["X"], 1e-5)
    same("E57 by pye57, scan", back["PointSourceId"], np.repeat([1, 2], POINTS))


def check_others(at: Path, points: dict[str, np.ndarray]) -> None:
    box = trimesh.creation.icosphere(subdivisions=3, radius=2.0)
    for name in ("m.obj", "m.off", "m.stl", "m.ply"):
        box.export(at / name)
        pointmill("convert", at / name, "-o", at / "m.csv", "--quiet")
        back = read_csv(at / "m.csv")
        corners = box.triangles.reshape(-1, 3) if name == "m.stl" else box.vertices
        found = np.stack([back[axis] for axis in "XYZ"]).T
        same(f"{name} by trimesh", found, np.asarray(corners), 1e-6)
    pointmill("convert", at / "in.csv", "-o", at / "a.xyz", "--drop",
              ",".join(name for name in points if name not in "XYZ"))
    xyz = trimesh.load(at / "a.xyz")
    same("xyz by trimesh", xyz.vertices[:, 1], points["Y"])
    same("xyz by numpy", np.loadtxt(at / "a.xyz")[:, 2], points["Z"])


def main() -> None:
    points = made()
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        write_csv(at / "in.csv", points)
        check_copc(at)
        for check in (check_las, check_ply, check_pcd, check_e57, check_others):
            check(at, points)
    print(f"interop: {checked} comparisons with other programs agree")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    PROGRAM = str(Path(sys.argv[1]).resolve())
    main()
