"""Runs one command and says what it took; knows no contender and no job."""

import json
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path


@dataclass
class Figures:
    cpu_seconds: float
    wall_seconds: float
    peak_mib: float
    kept: int | None


class Failure(Exception):
    """A command that did not do its job, and why."""


def told(text: str) -> dict:
    """The line of JSON that a text ends with, if it does."""
    lines = text.strip().splitlines()
    if lines and lines[-1].startswith("{"):
        return json.loads(lines[-1])
    return {}


def tail(log: Path) -> str:
    """The end of a log, however long it is: this process stays small."""
    with open(log, "rb") as source:
        source.seek(max(0, log.stat().st_size - 16384))
        return source.read().decode("utf-8", "replace")


def run(launch: str, command: list[str], environment: dict[str, str], work: Path) -> Figures:
    """Figures of the whole process, or those that it tells of itself; raises Failure."""
    log, figures = work / "log", work / "figures"
    figures.unlink(missing_ok=True)
    with open(log, "wb") as sink:
        code = subprocess.run([launch, figures, *command], stdin=subprocess.DEVNULL, stdout=sink, stderr=sink,
                              env=os.environ | environment).returncode
    output = tail(log)
    if code != 0:
        lines = output.strip().splitlines() or [""]
        last = next((line for line in lines if line.startswith("error")), lines[-1])
        raise Failure(f"failed ({code}): {last}")
    whole = told(figures.read_text(encoding="utf-8"))
    own = told(output)
    return Figures(
        cpu_seconds=own.get("cpu_seconds", whole["cpu_seconds"]),
        wall_seconds=own.get("wall_seconds", whole["wall_seconds"]),
        peak_mib=whole["peak_kib"] / 1024,
        kept=own.get("kept"),
    )
