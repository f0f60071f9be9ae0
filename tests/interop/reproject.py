#!/usr/bin/env python3
"""Points that pointmill reprojects, beside those that PROJ does.

usage: reproject.py POINTMILL

Needs the packages of requirements.txt beside this file. For each pair of systems, points around a
place where both are used are reprojected by both programs, without any grid. Where pointmill takes
an operation between two datums, PROJ is asked to take the same one, by its EPSG code: the two
agree within two thousandths of a millimetre. Exits with 1 if a pair differs, or is refused by one alone.
"""

import json
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np
import pyproj
from pyproj.aoi import AreaOfInterest
from pyproj.transformer import TransformerGroup

# From, to, and longitude and latitude of a place.
PAIRS = [
    ("EPSG:4326", "EPSG:3857", 9, 50),
    ("EPSG:4326", "EPSG:32632", 9, 50),
    ("EPSG:32632", "EPSG:32633", 11.5, 50),
    ("EPSG:25832", "EPSG:25833", 12, 52),
    ("EPSG:25832", "EPSG:4258", 9, 50),
    ("EPSG:25832", "EPSG:3035", 9, 50),
    ("EPSG:25832", "EPSG:32632", 9, 50),
    ("EPSG:25832", "EPSG:4326", 9, 50),
    ("EPSG:31467", "EPSG:25832", 9, 49),
    ("EPSG:31468", "EPSG:25832", 11.5, 48.1),
    ("EPSG:31287", "EPSG:25833", 14.3, 47.5),
    ("EPSG:31256", "EPSG:25833", 16.4, 48.2),
    ("EPSG:2154", "EPSG:4326", 2.5, 47),
    ("EPSG:2154", "EPSG:32631", 3, 45),
    ("EPSG:2056", "EPSG:4326", 8.5, 47.3),
    ("EPSG:21781", "EPSG:25832", 8.5, 47.3),
    ("EPSG:28992", "EPSG:25831", 5.4, 52.1),
    ("EPSG:31370", "EPSG:25831", 4.5, 50.8),
    ("EPSG:27700", "EPSG:4326", -1.5, 52.5),
    ("EPSG:5514", "EPSG:4326", 15.5, 49.8),
    ("EPSG:2180", "EPSG:25834", 20, 52),
    ("EPSG:3067", "EPSG:4326", 25, 62),
    ("EPSG:3006", "EPSG:3857", 16, 60),
    ("EPSG:25829", "EPSG:3763", -8.2, 40),
    ("EPSG:3003", "EPSG:25832", 10.5, 43.5),
    ("EPSG:26910", "EPSG:4269", -122.5, 45.5),
    ("EPSG:2277+6360", "EPSG:26914+5703", -98, 30.5),
    ("EPSG:6339", "EPSG:6318", -122.5, 45.5),
    ("EPSG:26917", "EPSG:4326", -80, 36),
    ("EPSG:28355", "EPSG:7855", 146, -36),
    ("EPSG:2193", "EPSG:4326", 175, -40),
    ("EPSG:31983", "EPSG:4674", -44, -20),
    ("EPSG:6668", "EPSG:6677", 139.7, 35.7),
    ("EPSG:4979", "EPSG:4978", 9, 50),
    ("EPSG:4978", "EPSG:4979", 9, 50),
]
# Pairs that take a grid, which both programs are without, or heights of another datum.
REFUSED = [
    ("EPSG:4267", "EPSG:4269", -100, 40),
    ("EPSG:4269", "EPSG:6318", -100, 40),
    ("EPSG:26910", "EPSG:2993", -122.5, 44),
    ("EPSG:26717", "EPSG:26917", -79.5, 44),
    ("EPSG:25832+7837", "EPSG:25832+5783", 9, 50),
    ("EPSG:6318+5703", "EPSG:4979", -100, 40),
]
SIDE = 6
NEAR = 2e-6
METRES_IN_A_DEGREE = 111_320.0


def points(system: str, longitude: float, latitude: float) -> np.ndarray:
    """Points in `system` around a place, some kilometres apart."""
    across = system.split("+")[0]
    degrees = np.linspace(-0.03, 0.03, SIDE)
    x, y = np.meshgrid(longitude + degrees, latitude + degrees)
    heights = np.linspace(-20, 900, SIDE * SIDE)
    geographic = "EPSG:4979" if across == "EPSG:4978" else pyproj.CRS(across).geodetic_crs
    if pyproj.CRS(across).is_geographic:
        return np.column_stack([x.ravel(), y.ravel(), heights])
    there = pyproj.Transformer.from_crs(geographic, across, always_xy=True)
    return np.column_stack(there.transform(x.ravel(), y.ravel(), heights))


def by_proj(found: dict, wanted: np.ndarray, place: tuple[float, float]) -> np.ndarray:
    """The points by PROJ, by the operation that pointmill took where there is one."""
    longitude, latitude = place
    area = AreaOfInterest(longitude - 0.03, latitude - 0.03, longitude + 0.03, latitude + 0.03)
    # A system of one country is often the same as that of the world but for a null operation.
    group = TransformerGroup(found["from"], found["to"], always_xy=True, allow_ballpark=False,
                             area_of_interest=area)
    code = found["code"]
    for transformer in group.transformers:
        operations = transformer.operations or ()
        names = [operation.name for operation in operations]
        if code is None or any(found["operation"] in name for name in names):
            return np.column_stack(transformer.transform(*wanted.T))
    # Versions of EPSG call some operations otherwise.
    if len(group.transformers) == 1:
        return np.column_stack(group.transformers[0].transform(*wanted.T))
    known = [transformer.description for transformer in group.transformers]
    sys.exit(f"{found}: PROJ has no such operation, but {known}")


def reprojected(pointmill: str, at: Path, pair: tuple) -> tuple[np.ndarray, np.ndarray, dict] | str:
    """Points, what becomes of them, and by what operation; or why nothing does."""
    source, target, longitude, latitude = pair
    wanted = points(source, longitude, latitude)
    np.savetxt(at / "in.xyz", wanted, fmt="%.12f")
    done = subprocess.run(
        [pointmill, "convert", at / "in.xyz", "-o", at / "out.xyz", "--crs", source,
         "--reproject", target, "--report", at / "report.json", "--quiet"],
        capture_output=True, text=True)
    if done.returncode != 0:
        return done.stderr
    report = json.loads((at / "report.json").read_text())["run"]["reprojection"]
    return wanted, np.loadtxt(at / "out.xyz"), report


def check(pointmill: str, at: Path, pair: tuple) -> None:
    found = reprojected(pointmill, at, pair)
    if isinstance(found, str):
        sys.exit(f"{pair}: {found}")
    wanted, made, report = found
    proj = by_proj(report, wanted, pair[2:])
    unit = METRES_IN_A_DEGREE if pyproj.CRS(pair[1]).is_geographic else 1.0
    far = np.abs(made - proj)
    far[:, :2] *= unit
    print(f"{pair[0]:>10} -> {pair[1]:<10} {far.max():.1e} m  {report['operation'] or ''}"
          f" {report['accuracy']} m")
    if not far.max() <= NEAR:
        sys.exit(f"{pair}: off by {far.max()} m")


def main() -> None:
    pointmill = sys.argv[1]
    # That better operations would take grids, which is as it should be.
    warnings.filterwarnings("ignore", message="Best transformation is not available")
    with tempfile.TemporaryDirectory() as folder:
        for pair in PAIRS:
            check(pointmill, Path(folder), pair)
        for pair in REFUSED:
            found = reprojected(pointmill, Path(folder), pair)
            if not isinstance(found, str):
                sys.exit(f"{pair}: not refused, but {found[2]}")
            if "grid" not in found and "no operation" not in found:
                sys.exit(f"{pair}: {found}")
    print(f"{len(PAIRS)} pairs agree with PROJ {pyproj.proj_version_str}, {len(REFUSED)} are refused")


if __name__ == "__main__":
    main()
