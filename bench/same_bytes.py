"""POINTMILL FOLDER [LIST]: what becomes of every scan below the folder, as hashes of outputs.

Without LIST the hashes are printed, a line each; with one that was printed before, lines that differ
are, and the exit code is 1 if there are any. For changes of structure, which must change no byte:

    python3 bench/same_bytes.py old/pointmill scans > bench/same_bytes.txt
    python3 bench/same_bytes.py new/pointmill scans bench/same_bytes.txt

The list that is kept is of 2026-11-28, before files and rooms were divided anew.
"""

import hashlib
import pathlib
import subprocess
import sys
import tempfile

SUFFIXES = {".las", ".laz", ".ply"}
# What is done to each scan; PLY and LAS have other remedies for what they cannot say.
COMMANDS = {
    "paper": ["reduce", "--preset", "paper", "--nonfinite", "drop"],
    "reduce": ["reduce", "--nonfinite", "drop"],
    "marked": ["reduce", "--mark", "withheld", "--order", "input", "--nonfinite", "drop"],
    "convert": ["convert"],
}


def outcome(pointmill, command, scan, at):
    """The hash of the output, or that it was refused."""
    suffix = scan.suffix.lower()
    out = pathlib.Path(at, "out" + suffix)
    out.unlink(missing_ok=True)
    # Outputs name the stages that made them: with a name that is the same in every run.
    arguments = [pointmill, *command, scan, "-o", out.name, "--headers", "warn", "--quiet", "--memory", "512MiB"]
    run = subprocess.run(arguments, capture_output=True, text=True, cwd=at)
    if run.returncode != 0:
        return f"exit {run.returncode}"
    return hashlib.sha256(out.read_bytes()).hexdigest()[:32]


def lines(pointmill, folder):
    pointmill, folder = pathlib.Path(pointmill).resolve(), pathlib.Path(folder).resolve()
    scans = sorted(p for p in folder.rglob("*") if p.suffix.lower() in SUFFIXES and p.is_file())
    with tempfile.TemporaryDirectory() as at:
        for scan in scans:
            for name, command in COMMANDS.items():
                yield f"{outcome(pointmill, command, scan, at)} {name} {scan.relative_to(folder)}"


def main(pointmill, folder, before=None):
    if before is None:
        for line in lines(pointmill, folder):
            print(line, flush=True)
        return 0
    expected = set(pathlib.Path(before).read_text().splitlines())
    found = set(lines(pointmill, folder))
    for line in sorted(expected ^ found, key=lambda line: line.split(" ", 1)[1]):
        print("-" if line in expected else "+", line)
    print(f"{len(expected & found)} of {len(expected)} are the same", file=sys.stderr)
    return int(expected != found)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
