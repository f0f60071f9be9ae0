"""Installs the peers; knows how, not what they are compared in."""

import os
import shutil
import subprocess
from pathlib import Path

HERE = Path(__file__).parent
PACKAGES = ["g++", "libpcl-dev", "libnanoflann-dev", "libeigen3-dev"]


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


def system_packages(cache: Path) -> str | None:
    """Why the C++ peers are not there, or None."""
    if shutil.which("apt-get") is None:
        return "not installed: no apt"
    if subprocess.run(["dpkg", "-s", *PACKAGES], capture_output=True).returncode == 0:
        return None
    if os.geteuid() != 0:
        return "not installed: apt needs root"
    with open(cache / "apt.log", "wb") as sink:
        command = ["apt-get", "install", "-y", "--no-install-recommends", *PACKAGES]
        environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
        code = subprocess.run(command, stdout=sink, stderr=sink, env=environment).returncode
    return None if code == 0 else "not installed: see apt.log"


def driver(cache: Path, name: str, flags: list[str]) -> str | None:
    """Builds a C++ driver; why it could not be built, or None."""
    command = ["g++", "-O3", "-march=native", "-fopenmp", "-std=c++17", str(HERE / f"{name}.cpp"), "-o", str(cache / name)]
    with open(cache / f"{name}.log", "wb") as sink:
        code = subprocess.run(command + flags, stdout=sink, stderr=sink).returncode
    return None if code == 0 else f"not built: see {name}.log"


def versions() -> str:
    """The system packages that are there, with their versions."""
    query = ["dpkg-query", "-W", "-f", "${db:Status-Abbrev} ${Package} ${Version}\n", *PACKAGES]
    try:
        lines = subprocess.run(query, capture_output=True, text=True).stdout.splitlines()
    except OSError:
        return "no system packages"
    found = [line.removeprefix("ii ").strip() for line in lines if line.startswith("ii ")]
    return ", ".join(found) or "no system packages"
