"""Runs one command and says what it took; knows no contender and no job."""

import json
import os
import subprocess
import time
from dataclasses import dataclass


@dataclass
class Figures:
    cpu_seconds: float
    wall_seconds: float
    peak_mib: float
    kept: int | None


class Failure(Exception):
    """A command that did not do its job, and why."""


def told(output: str) -> dict:
    """The line of JSON that a command ends with, if it does."""
    lines = output.strip().splitlines()
    if lines and lines[-1].startswith("{"):
        return json.loads(lines[-1])
    return {}


def run(command: list[str], environment: dict[str, str], log: str) -> Figures:
    """Figures of the whole process, or those that it tells of itself; raises Failure."""
    before = time.monotonic()
    with open(log, "wb") as sink:
        try:
            process = subprocess.Popen(command, stdout=sink, stderr=sink, env=os.environ | environment)
        except OSError as error:
            raise Failure(f"does not start: {error.strerror}") from error
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    wall = time.monotonic() - before
    with open(log, encoding="utf-8", errors="replace") as source:
        output = source.read()
    if process.returncode != 0:
        lines = output.strip().splitlines() or [""]
        last = next((line for line in lines if line.startswith("error")), lines[-1])[:120]
        raise Failure(f"failed ({process.returncode}): {last}")
    own = told(output)
    return Figures(
        cpu_seconds=own.get("cpu_seconds", usage.ru_utime + usage.ru_stime),
        wall_seconds=own.get("wall_seconds", wall),
        peak_mib=usage.ru_maxrss / 1024,
        kept=own.get("kept"),
    )
