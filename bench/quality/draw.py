#!/usr/bin/env python3
"""Writes docs/quality.md and its plots from results.jsonl; `--check` compares instead.

Standard library only: the page can be drawn again where nothing is installed.
"""

import sys
from pathlib import Path

sys.dont_write_bytecode = True
import methods
from page import page
from plot import plot
from results import cells, lines

HERE = Path(__file__).resolve().parent
DOCS = HERE.parent.parent / "docs"
SAID = HERE / "results.jsonl", HERE / "bars.json", HERE / "methods.jsonl"


def drawn(results: Path, bars: Path, beside: Path | None = None) -> dict[str, str]:
    """The text of each file, by its path within `docs`; with the methods of the paper, if given."""
    found = cells(results, bars)
    compared = lines([cell for cell in found if cell.compared])
    if not compared:
        sys.exit(f"{results}: no scene has figures of graded and of the voxel grid")
    surface = "Surface error of the others as a multiple of that of graded, by scene and share"
    mesh = "Mesh error of the others as a multiple of that of graded, by scene and share"
    texts = {
        "quality.md": page(found),
        "images/quality/surface.svg": plot(compared, "p99", surface),
        "images/quality/mesh.svg": plot(compared, "mesh_p99", mesh),
    }
    if beside:
        of_methods = methods.rows(beside)
        texts["quality.md"] += "\n" + methods.section(of_methods)
        texts["images/quality/methods.svg"] = methods.plot(of_methods)
    return texts


def differing(docs: Path, texts: dict[str, str]) -> list[str]:
    def same(name: str, text: str) -> bool:
        path = docs / name
        return path.exists() and path.read_text(encoding="utf-8") == text

    return [name for name, text in texts.items() if not same(name, text)]


def write() -> None:
    for name, text in drawn(*SAID).items():
        (DOCS / name).parent.mkdir(parents=True, exist_ok=True)
        (DOCS / name).write_text(text, encoding="utf-8")


def main() -> None:
    if unknown := [word for word in sys.argv[1:] if word != "--check"]:
        sys.exit(f"{unknown[0]}: the only option is --check")
    if "--check" not in sys.argv:
        write()
    elif wrong := differing(DOCS, drawn(*SAID)):
        sys.exit(f"docs/{wrong[0]} is not what the results say: python3 bench/quality/draw.py")


if __name__ == "__main__":
    main()
