"""Who is compared in which job: one record each. Braces name files and figures of the run."""

from dataclasses import dataclass, field

PYTHON = "{cache}/venv/bin/python"
DRIVERS = "{here}/drivers"


@dataclass(frozen=True)
class Contender:
    name: str
    job: str
    command: list[str]
    peer: str = "pointmill"  # what must be installed: pointmill, python, or a C++ driver's name
    output: str | None = None  # a LAS or LAZ file whose header says how many points were kept
    smoke: bool = False  # takes part in the smoke test
    environment: dict[str, str] = field(default_factory=dict)


def python(name: str, job: str, script: str, *arguments: str) -> Contender:
    return Contender(name, job, [PYTHON, f"{DRIVERS}/{script}.py", *arguments], "python",
                     environment={"OMP_NUM_THREADS": "{threads}"})


def pointmill(name: str, job: str, output: str, *arguments: str) -> Contender:
    return Contender(name, job, ["{pointmill}", *arguments, "--progress", "never", "--threads", "{threads}"],
                     output=output, smoke=True)


REDUCE, GRID, TO_LAZ, TO_LAS = "LAZ → reduced → LAZ", "LAZ → voxel grid → LAZ", "LAZ → LAZ", "LAZ → LAS"
NORMALS = "normals, in process"
OUT, OUT_LAS = "{work}/out.laz", "{work}/out.las"

CONTENDERS = [
    Contender("pointmill", NORMALS, ["cargo", "bench", "--bench", "search", "--", "{xyz}"]),
    Contender("nanoflann", NORMALS, ["{cache}/nanoflann", "{xyz}", "{threads}"], "nanoflann"),
    Contender("PCL", NORMALS, ["{cache}/pcl", "{xyz}", "{threads}"], "pcl"),
    python("small_gicp", NORMALS, "small_gicp_normals", "{xyz}", "{threads}"),
    python("pgeof", NORMALS, "pgeof_normals", "{xyz}"),
    python("Open3D", NORMALS, "open3d_normals", "{xyz}"),
    pointmill("pointmill", REDUCE, OUT, "reduce", "{laz}", "-o", OUT),
    pointmill("pointmill, 256 MiB", REDUCE, OUT, "reduce", "{laz}", "-o", OUT, "--memory", "256MiB"),
    python("small_gicp + laspy", REDUCE, "whole_job", "small_gicp", "{laz}", OUT, "{side}", "{threads}", "normals"),
    python("Open3D + laspy", REDUCE, "whole_job", "open3d", "{laz}", OUT, "{side}", "{threads}", "normals"),
    pointmill("pointmill", GRID, OUT, "run", "{here}/../../pipelines/grid.toml", "--set", "read.path={laz}",
              "--set", "write.path=" + OUT, "--set", "grid.side={side}"),
    python("small_gicp + laspy", GRID, "whole_job", "small_gicp", "{laz}", OUT, "{side}", "{threads}", "grid"),
    python("Open3D + laspy", GRID, "whole_job", "open3d", "{laz}", OUT, "{side}", "{threads}", "grid"),
    pointmill("pointmill", TO_LAZ, OUT, "convert", "{laz}", "-o", OUT),
    python("laspy + lazrs", TO_LAZ, "convert", "{laz}", OUT),
    pointmill("pointmill", TO_LAS, OUT_LAS, "convert", "{laz}", "-o", OUT_LAS),
    python("laspy + lazrs", TO_LAS, "convert", "{laz}", OUT_LAS),
]
