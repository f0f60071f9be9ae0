"""Who is compared in which job: one record each. Braces name files and figures of the run."""

from dataclasses import dataclass, field

PYTHON = "{cache}/venv/bin/python"
DRIVERS = "{here}/drivers"


@dataclass(frozen=True)
class Contender:
    name: str
    job: str
    command: list[str]
    peer: str = "pointmill"  # what must be installed: pointmill, bench, python, or a name of install.PACKAGES
    output: str | None = None  # a LAS, LAZ or PLY file whose header says how many points were kept
    smoke: bool = False  # takes part in the smoke test
    environment: dict[str, str] = field(default_factory=dict)


def python(name: str, job: str, script: str, *arguments: str) -> Contender:
    return Contender(name, job, [PYTHON, f"{DRIVERS}/{script}.py", *arguments], "python",
                     environment={"OMP_NUM_THREADS": "{threads}", "PYTHONDONTWRITEBYTECODE": "1"})


def pointmill(name: str, job: str, output: str, *arguments: str) -> Contender:
    return Contender(name, job, ["{pointmill}", *arguments, "--progress", "never", "--threads", "{threads}"],
                     output=output, smoke=True)


REDUCE, GRID, TO_LAZ, TO_LAS = "LAZ → reduced → LAZ", "LAZ → voxel grid → LAZ", "LAZ → LAZ", "LAZ → LAS"
NORMALS = "normals, in process"
DECODE = "LAZ decoded by one thread, in process"
TO_PLY, FROM_PLY = "LAS → PLY", "PLY → LAS"
OUT, OUT_LAS, OUT_PLY = "{work}/out.laz", "{work}/out.las", "{work}/out.ply"

CONTENDERS = [
    Contender("pointmill, pca", NORMALS, ["{cache}/search", "{laz}", "pca", "rounds=1"], "bench"),
    Contender("pointmill, varady", NORMALS, ["{cache}/search", "{laz}", "varady", "rounds=1"], "bench"),
    Contender("nanoflann", NORMALS, ["{cache}/nanoflann", "{xyz}", "{threads}"], "nanoflann"),
    Contender("PCL", NORMALS, ["{cache}/pcl", "{xyz}", "{threads}"], "pcl"),
    Contender("CGAL", NORMALS, ["{cache}/cgal", "{xyz}", "{threads}"], "cgal"),
    python("small_gicp", NORMALS, "small_gicp_normals", "{xyz}", "{threads}"),
    python("pgeof", NORMALS, "pgeof_normals", "{xyz}"),
    python("Open3D", NORMALS, "open3d_normals", "{xyz}"),
    Contender("CloudCompare, whole process", NORMALS, ["CloudCompare", "-SILENT", "-AUTO_SAVE", "OFF", "-O", "{bare}",
                                                       "-OCTREE_NORMALS", "{radius}"], "cloudcompare",
              environment={"QT_QPA_PLATFORM": "offscreen", "HOME": "{work}"}),
    pointmill("pointmill", REDUCE, OUT, "reduce", "{laz}", "--preset", "paper", "-o", OUT),
    pointmill("pointmill, 256 MiB", REDUCE, OUT, "reduce", "{laz}", "--preset", "paper", "-o", OUT, "--memory", "256MiB"),
    python("small_gicp + laspy", REDUCE, "whole_job", "small_gicp", "{laz}", OUT, "{side}", "{threads}", "normals"),
    python("Open3D + laspy", REDUCE, "whole_job", "open3d", "{laz}", OUT, "{side}", "{threads}", "normals"),
    pointmill("pointmill", GRID, OUT, "run", "{here}/../../pipelines/grid.toml", "--set", "read.path={laz}",
              "--set", "write.path=" + OUT, "--set", "grid.side={side}"),
    python("small_gicp + laspy", GRID, "whole_job", "small_gicp", "{laz}", OUT, "{side}", "{threads}", "grid"),
    python("Open3D + laspy", GRID, "whole_job", "open3d", "{laz}", OUT, "{side}", "{threads}", "grid"),
    Contender("pointmill", DECODE, ["{cache}/laz", "{laz}", "pointmill"], "bench"),
    Contender("laz crate", DECODE, ["{cache}/laz", "{laz}", "crate"], "bench"),
    python("laspy + lazrs", DECODE, "decode", "{laz}", "Lazrs"),
    python("laspy + LASzip", DECODE, "decode", "{laz}", "Laszip"),
    pointmill("pointmill", TO_LAZ, OUT, "convert", "{laz}", "-o", OUT),
    python("laspy + lazrs", TO_LAZ, "convert", "{laz}", OUT),
    pointmill("pointmill", TO_LAS, OUT_LAS, "convert", "{laz}", "-o", OUT_LAS),
    python("laspy + lazrs", TO_LAS, "convert", "{laz}", OUT_LAS),
    pointmill("pointmill", TO_PLY, OUT_PLY, "convert", "{las}", "-o", OUT_PLY),
    python("laspy + plyfile", TO_PLY, "to_ply", "{las}", OUT_PLY),
    pointmill("pointmill", FROM_PLY, OUT_LAS, "convert", "{ply}", "-o", OUT_LAS, "--scale={scale}",
              "--offset={offset}"),
    python("laspy + plyfile", FROM_PLY, "from_ply", "{ply}", OUT_LAS, "{scale}", "{offset}"),
]
