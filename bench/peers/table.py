"""The table of figures, in Markdown; runs nothing."""

from pathlib import Path
from statistics import median

from measure import Figures

BEGIN, END = "<!-- figures: begin -->", "<!-- figures: end -->"
HEAD = "| contender | CPU s | wall s | peak MiB | points per CPU s | CPU, times the first row's | kept |\n|---|---|---|---|---|---|---|"


def row(name: str, runs: list[Figures], points: int, reference: float | None) -> str:
    cpu = median(run.cpu_seconds for run in runs)
    rate = f"{points / cpu:,.0f}" if cpu else "–"  # a clock may be too coarse for a small scan
    ratio = f"{cpu / reference:.2f}" if reference else "–"
    kept = next((f"{run.kept:,}" for run in runs if run.kept is not None), "–")
    return (f"| {name} | {cpu:.2f} | {median(r.wall_seconds for r in runs):.2f} | "
            f"{max(r.peak_mib for r in runs):.0f} | {rate} | {ratio} | {kept} |")


def section(job: str, results: dict[str, list[Figures] | str], points: int) -> str:
    """A job's rows; a contender without figures says why."""
    first = next(iter(results.values()))
    reference = median(r.cpu_seconds for r in first) if isinstance(first, list) else None
    rows = [f"| {name} | {runs} | | | | | |" if isinstance(runs, str) else row(name, runs, points, reference)
            for name, runs in results.items()]
    return "\n".join([f"### {job}", "", HEAD, *rows])


def write(page: Path, text: str) -> None:
    """Puts the text between the markers of the page, which keeps what is around them."""
    old = page.read_text(encoding="utf-8") if page.exists() else f"{BEGIN}\n{END}\n"
    before, rest = old.split(BEGIN, 1)
    page.write_text(f"{before}{BEGIN}\n{text}\n{END}{rest.split(END, 1)[1]}", encoding="utf-8")
