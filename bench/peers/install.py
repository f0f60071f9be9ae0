"""Installs the peers; knows how, not what they are compared in."""

import functools
import glob
import json
import os
import shutil
import subprocess
from pathlib import Path

HERE = Path(__file__).parent
PACKAGES = {
    "nanoflann": ["g++", "libnanoflann-dev", "libeigen3-dev"],
    "pcl": ["g++", "libpcl-dev", "libeigen3-dev"],
    "cgal": ["g++", "libcgal-dev", "libtbb-dev", "libeigen3-dev"],
    "cloudcompare": ["cloudcompare"],
}
# Of the C++ drivers; include paths may be patterns.
FLAGS = {
    "nanoflann": ["-I/usr/include/eigen3"],
    "pcl": ["-I/usr/include/pcl-*", "-I/usr/include/eigen3", "-lpcl_features", "-lpcl_search", "-lpcl_kdtree",
            "-lpcl_octree", "-lpcl_common"],
    "cgal": ["-I/usr/include/eigen3", "-DNDEBUG", "-DCGAL_EIGEN3_ENABLED", "-DCGAL_LINKED_WITH_TBB", "-ltbb", "-lgmp"],
}


def launcher(cache: Path) -> str:
    """Builds what starts the contenders; where Rust links, there is a C compiler."""
    subprocess.run(["cc", "-O2", str(HERE / "launch.c"), "-o", str(cache / "launch")], check=True)
    return str(cache / "launch")


def python_peers(cache: Path) -> str | None:
    """Why the Python peers are not there, or None."""
    venv = cache / "venv"
    log = cache / "pip.log"
    with open(log, "wb") as sink:
        for command in (
            ["python3", "-m", "venv", str(venv)],
            [str(venv / "bin/pip"), "install", "-q", "-r", str(HERE / "requirements.txt")],
        ):
            try:
                code = subprocess.run(command, stdout=sink, stderr=sink).returncode
            except OSError as error:
                return f"not installed: {error.strerror}"
            if code != 0:
                return f"not installed: see {log.name}"
    return None


def bench(cache: Path) -> str | None:
    """Builds pointmill's benches of search and of LAZ, unless they are fresh; why they could not be built, or None."""
    names = ("search", "laz")
    chosen = [word for name in names for word in ("--bench", name)]
    command = ["cargo", "bench", *chosen, "--no-run", "--message-format=json"]
    with open(cache / "benches.log", "wb") as sink:
        try:
            built = subprocess.run(command, cwd=HERE, stdout=subprocess.PIPE, stderr=sink)
        except OSError as error:
            return f"not built: {error.strerror}"
    if built.returncode != 0:
        return "not built: see benches.log"
    messages = [json.loads(line) for line in built.stdout.splitlines()]
    for name in names:
        path = next(m["executable"] for m in messages if m.get("executable") and m["target"]["name"] == name)
        (cache / name).unlink(missing_ok=True)
        (cache / name).symlink_to(path)
    return None


@functools.cache
def apt(log: Path, *arguments: str) -> bool:
    """Whether a command of apt went well; the same one is not run again."""
    with open(log, "ab") as sink:
        environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
        return subprocess.run(["apt-get", *arguments], stdout=sink, stderr=sink, env=environment).returncode == 0


def system_packages(cache: Path, name: str) -> str | None:
    """Why a peer's packages are not there, or None."""
    packages, log = PACKAGES[name], cache / "apt.log"
    if shutil.which("apt-get") is None:
        return "not installed: no apt"
    if subprocess.run(["dpkg", "-s", *packages], capture_output=True).returncode == 0:
        return None
    if os.geteuid() != 0:
        return "not installed: apt needs root"
    apt(log, "update")
    return None if apt(log, "install", "-y", "--no-install-recommends", *packages) else f"not installed: see {log.name}"


def driver(cache: Path, name: str) -> str | None:
    """Builds a C++ driver, where there is one; why it could not be built, or None."""
    if name not in FLAGS:
        return None
    flags = [flag for pattern in FLAGS[name] for flag in
             ([f"-I{path}" for path in glob.glob(pattern[2:])] if pattern.startswith("-I") else [pattern])]
    command = ["g++", "-O3", "-march=native", "-fopenmp", "-std=c++17", str(HERE / f"{name}.cpp"), "-o", str(cache / name)]
    with open(cache / f"{name}.log", "wb") as sink:
        code = subprocess.run(command + flags, stdout=sink, stderr=sink).returncode
    return None if code == 0 else f"not built: see {name}.log"


def versions() -> str:
    """The system packages that are there, with their versions."""
    packages = sorted({package for some in PACKAGES.values() for package in some})
    query = ["dpkg-query", "-W", "-f", "${db:Status-Abbrev} ${Package} ${Version}\n", *packages]
    try:
        lines = subprocess.run(query, capture_output=True, text=True).stdout.splitlines()
    except OSError:
        return "no system packages"
    found = [line.removeprefix("ii ").strip() for line in lines if line.startswith("ii ")]
    return ", ".join(found) or "no system packages"
