"""POINTMILL FOLDER: does LASzip decode every LAZ file below the folder to the records that pointmill does?

A file that one of them refuses is told with both answers. The exit code is 1 if records differ.
"""

import pathlib
import subprocess
import sys
import tempfile

import laspy
import numpy

AT_A_TIME = 100_000


def refusal(error):
    return " ".join(str(error).split())[:120]


def records(path, backend=None):
    """Stretches of records, as bytes."""
    with laspy.open(path, laz_backend=backend) as scan:
        for points in scan.chunk_iterator(AT_A_TIME):
            yield points.array.view(numpy.uint8).reshape(len(points), -1)


def first_difference(ours, theirs):
    """The number of the first record that differs, or None; and how many were compared."""
    at = 0
    for mine, other in zip(ours, theirs, strict=True):
        if mine.shape != other.shape:
            return at, at
        differs = (mine != other).any(axis=1)
        if differs.any():
            return at + int(differs.argmax()), at
        at += len(mine)
    return None, at


def judge(pointmill, path, las):
    convert = [pointmill, "convert", path, "-o", las, "--headers", "warn", "--quiet"]
    run = subprocess.run(convert, capture_output=True, text=True)
    try:
        if run.returncode != 0:
            count = sum(len(stretch) for stretch in records(path, laspy.LazBackend.Laszip))
            return "refused", f"by pointmill alone, LASzip reads {count}: {refusal(run.stderr)}"
        difference, count = first_difference(records(las), records(path, laspy.LazBackend.Laszip))
    except Exception as error:
        if run.returncode != 0:
            return "refused", f"by both: {refusal(run.stderr)}"
        return "refused", f"by LASzip alone: {refusal(error)}"
    if difference is not None:
        return "differs", f"from record {difference}"
    return "same", f"{count} records"


def main(pointmill, folder):
    files = sorted(p for p in pathlib.Path(folder).rglob("*") if p.suffix.lower() == ".laz")
    counts = {"same": 0, "differs": 0, "refused": 0}
    with tempfile.TemporaryDirectory() as at:
        las = pathlib.Path(at, "decoded.las")
        for path in files:
            las.unlink(missing_ok=True)
            verdict, told = judge(pointmill, path, las)
            counts[verdict] += 1
            print(f"{verdict:8} {path.relative_to(folder)}: {told}", flush=True)
    print(", ".join(f"{count} {verdict}" for verdict, count in counts.items()))
    return counts["differs"] > 0 or counts["same"] == 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
