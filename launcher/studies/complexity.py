"""The study of thesis §4.1: Tables 1 to 3 and figures 41 to 50, the thesis' numbers beside ours."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import astuple
from pathlib import Path

from launcher.studies import drawing
from launcher.studies.complexity_figures import draw_once, draw_redeployment, draw_steiner
from launcher.studies.complexity_runs import MapRun, Timing, run_maps, time_redeployment, time_steiner
from launcher.studies.complexity_summary import COUNTS, TIMES, sum_up


def study_complexity(folder: Path, quick: bool = False, tell: Callable[[str], None] = print) -> str:
    """Count, time, draw, and say what came out.

    Args:
        folder: is made; files in it of the same names are replaced.
        quick: only maps of at most 200 cells.
        tell: is told what is being done.

    Returns:
        The text of ``summary.md``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    begin = time.perf_counter()
    runs = list(run_maps(quick, tell))
    steiner: list[Timing] = []
    redeployment: list[Timing] = []
    for run in runs:
        if run.thesis is not None:
            tell(f"{run.name}: Steiner trees, redeployments")
            steiner += time_steiner(run)
            redeployment += time_redeployment(run)
    tell("figures")
    once = draw_once(runs, folder)
    trees = draw_steiner(steiner, folder)
    searches = draw_redeployment(redeployment, folder)

    _write_maps(folder / "tables.csv", runs)
    columns = ("map", "cells", "links", "size", "algorithm", "mean_s", "least_s", "most_s")
    drawing.write_table(folder / "steiner.csv", columns, map(astuple, steiner))
    drawing.write_table(folder / "redeployment.csv", columns, map(astuple, redeployment))
    fits: list[tuple[object, ...]] = [
        (name, "segments" if name == "decomposition" else "cells", "", whose, *astuple(fit))
        for name, both in once.items()
        for whose, fit in zip(("ours", "thesis"), both, strict=True)
    ]
    for name, by in (("Steiner tree", trees), *searches.items()):
        fits += [(name, over, at, "ours", *astuple(fit)) for over, some in by.items() for at, fit in some]
    fitted = ("slope_or_base", "standard_error", "factor", "R2", "points")
    drawing.write_table(folder / "fits.csv", ("algorithm", "over", "at", "whose", *fitted), fits)
    text = sum_up(runs, once, trees, searches, time.perf_counter() - begin)
    (folder / "summary.md").write_text(text, encoding="utf-8")
    return text


def _write_maps(file: Path, runs: Sequence[MapRun]) -> None:
    """Tables 1 and 2, ours and the thesis'."""
    theirs = (*COUNTS, "Td", "Tmv", "Tad", "Tpv", "Tpp")
    rows = [
        (
            *(run.map, run.kind, run.holes, run.links, *(run.counts[name] for name in COUNTS)),
            *(getattr(run, ours) for _, ours in TIMES),
            *(getattr(run.thesis, name, "") for name in theirs),
        )
        for run in runs
    ]
    columns = ("map", "kind", "holes", "links", *COUNTS, *(ours for _, ours in TIMES))
    drawing.write_table(file, (*columns, *(f"{name}_thesis" for name in theirs)), rows)
