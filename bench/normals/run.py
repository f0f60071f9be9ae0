#!/usr/bin/env python3
"""How true normals are, by every method and beside other libraries: README.md says more."""

import argparse
import os
import sys
from pathlib import Path

sys.dont_write_bytecode = True
HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "quality"))
from run import ROOT, built, called, cgal, pcl, python

sys.path.insert(0, str(HERE))
import draw_normals


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pointmill", type=Path, help="this program instead of one that is built")
    parser.add_argument("--cache", type=Path, default=ROOT / "target/quality",
                        help="where packages and files between programs go")
    given = parser.parse_args()
    cache = given.cache.resolve()
    cache.mkdir(parents=True, exist_ok=True)
    command = [python(cache), HERE / "measure.py", "--folder", cache,
               "--cgal", cgal(cache, HERE / "normals.cpp"), "--pcl", pcl(cache),
               "--pointmill", (given.pointmill or built()).resolve(),
               "--results", HERE / "results.jsonl"]
    called(*command, env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"})
    draw_normals.write()


if __name__ == "__main__":
    main()
