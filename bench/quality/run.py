#!/usr/bin/env python3
"""How true `graded` is beside other tools at equal numbers of points; README.md says more.

Installs what it needs into a folder of its own, builds pointmill, runs and measures what
results.jsonl does not have yet, and draws docs/quality.md.
"""

import argparse
import glob
import os
import shutil
import subprocess
import sys
from pathlib import Path

sys.dont_write_bytecode = True
import draw

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
SYSTEM = ["g++", "libcgal-dev", "libeigen3-dev", "libtbb-dev"]
PCL = ["g++", "libpcl-dev", "libeigen3-dev"]


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", help="only these, as a,b")
    parser.add_argument("--contenders", help="only these, as a,b")
    parser.add_argument("--again", action="store_true",
                        help="run and measure what is chosen again, as after a change of graded")
    parser.add_argument("--methods", action="store_true",
                        help="the paper's method and those that it is beside, at five shares")
    parser.add_argument("--pointmill", type=Path, help="this program instead of one that is built")
    parser.add_argument("--cache", type=Path, default=ROOT / "target/quality",
                        help="where packages, scenes and what is kept of them go")
    return parser.parse_args()


def called(*command: str | Path, **more) -> None:
    """Runs a command, and ends with its error where it fails."""
    words = [str(word) for word in command]
    if subprocess.run(words, **more).returncode != 0:
        sys.exit(f"failed: {' '.join(words)}")


def python(cache: Path) -> Path:
    """A Python that has the packages, installed by pip where they are not there yet."""
    folder = cache / "venv"
    wanted = (HERE / "requirements.txt").read_text(encoding="utf-8")
    stamp = folder / "installed.txt"
    if not stamp.exists() or stamp.read_text(encoding="utf-8") != wanted:
        called(sys.executable, "-m", "venv", folder)
        called(folder / "bin/python", "-m", "pip", "install", "-q", "-r", HERE / "requirements.txt")
        stamp.write_text(wanted, encoding="utf-8")
    return folder / "bin/python"


def installed(packages: list[str]) -> bool:
    """Whether system packages are there, after installing them where apt and the rights are."""
    def there() -> bool:
        return subprocess.run(["dpkg", "-s", *packages], capture_output=True).returncode == 0

    if not there() and shutil.which("apt-get") and os.geteuid() == 0:
        called("apt-get", "update", "-q")
        called("apt-get", "install", "-y", "-q", "--no-install-recommends", *packages)
    return there()


def driver(cache: Path, source: Path, packages: list[str], flags: list[str]) -> Path:
    """A driver of a C++ library, built unless it is fresh."""
    program = cache / source.stem
    if not (program.exists() and program.stat().st_mtime > source.stat().st_mtime):
        installed(packages)
        called("g++", "-O3", "-DNDEBUG", "-I/usr/include/eigen3", "-std=c++17",
               "-w", source, "-o", program, *flags)
    return program


def cgal(cache: Path, source: Path = HERE / "cgal.cpp") -> Path:
    return driver(cache, source, SYSTEM, ["-march=native", "-DCGAL_LINKED_WITH_TBB", "-DCGAL_EIGEN3_ENABLED",
                                          "-ltbb", "-lgmp"])


def pcl(cache: Path) -> Path:
    """PCL's driver; where its packages cannot be had there is none, and its contenders fail.

    Not for this very processor: Eigen would align its vectors otherwise than in PCL's libraries.
    """
    if not installed(PCL):
        print("PCL is not there: libpcl-dev is not installed")
        return cache / "pcl"
    paths = [f"-I{path}" for path in glob.glob("/usr/include/pcl-*")]
    parts = ("filters", "features", "search", "kdtree", "octree", "common")
    return driver(cache, HERE / "pcl.cpp", PCL, [*paths, *(f"-lpcl_{part}" for part in parts)])


def built() -> Path:
    called("cargo", "build", "--release", "--quiet", cwd=ROOT)
    return Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release/pointmill"


def main() -> None:
    given = options()
    cache = given.cache.resolve()
    cache.mkdir(parents=True, exist_ok=True)
    interpreter = python(cache)
    # One thread a library: figures do not depend on it, and times are those of one core.
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
                                "PYTHONDONTWRITEBYTECODE": "1"}
    called(interpreter, "-m", "unittest", "-q", "test_counts", "test_figures",
           cwd=HERE, env=environment)
    command = [interpreter, HERE / "measure.py", "--folder", cache, "--cgal", cgal(cache), "--pcl", pcl(cache),
               "--pointmill", (given.pointmill or built()).resolve(),
               "--results", HERE / ("methods.jsonl" if given.methods else "results.jsonl")]
    command += ["--again"] if given.again else []
    command += ["--methods"] if given.methods else []
    for option, value in (("--scenes", given.scenes), ("--contenders", given.contenders),
                          ("--scans", os.environ.get("POINTMILL_SCANS"))):
        command += [option, value] if value else []
    called(*command, env=environment)
    draw.write()


if __name__ == "__main__":
    main()
