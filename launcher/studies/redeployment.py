"""The study of redeployment: how much the optimum over all trees saves beside searches near the present tree.

The thesis searches one edge away from the present tree (§3.6, algorithm 7) and leaves open what that costs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from launcher.studies import drawing
from launcher.studies.redeployment_figures import dearer, draw_costs, draw_example, draw_times
from launcher.studies.redeployment_runs import (
    GROUNDS,
    MU_M,
    RADIUS_M,
    SEARCHES,
    Answer,
    Question,
    answer_all,
    draw_tasks,
    load_ground,
)
from launcher.studies.scaling import describe_machine
from launcher.studies.subset_figure import draw_programme
from launcher.studies.thesis_tables import Kind

NODES = (4, 5, 6, 7, 8)
VARIED = 6
"""k of the variations."""

VARIATIONS = {
    "two agents": Question(VARIED, agents=2),
    "μ = 1 m": Question(VARIED, mu_m=1.0),
    "μ = 25 m": Question(VARIED, mu_m=25.0),
    "agent goes where it sees": Question(VARIED, near=True),
    "robots may idle": Question(VARIED, idle=True),
    "points instead of cells": Question(VARIED),
}
"""As the question at this k but for what the name says."""

SAME = 1e-9
"""Relative difference up to which two costs are the same."""

EXAMPLE = "room3"
"""Map of the case that is drawn."""


def study_redeployment(
    folder: Path,
    number: int = 200,
    seed: int = 0,
    grounds: Sequence[tuple[str, Kind]] = GROUNDS,
    tell: Callable[[str], None] = print,
) -> str:
    """Redeploy teams at random by every search, draw, and say what came out.

    Args:
        folder: is made; files in it of the same names are replaced.
        number: redeployments of each map and k.
        seed: of the random places.
        grounds: maps, each with its kind of cells.
        tell: is told what is being done.

    Returns:
        The text of ``summary.md``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    found: dict[str, dict[int, list[Answer]]] = {}
    varied: dict[str, dict[str, list[Answer]]] = {}
    sizes = {}
    for name, kind in grounds:
        ground = load_ground(name, kind)
        title = f"{name}, {len(ground)} {kind} cells"
        sizes[title] = len(ground)
        tell(f"{title}: {number} redeployments for each k")
        found[title] = {nodes: answer_all(ground, Question(nodes), number, seed) for nodes in NODES}
        points = load_ground(name, None)
        varied[title] = {
            variation: answer_all(points if "points" in variation else ground, question, number, seed)
            for variation, question in VARIATIONS.items()
        }
        if name == EXAMPLE:
            more = dearer(found[title][VARIED], "one-edge")
            worst = int(np.argmax(np.where(np.isfinite(more), more, -1.0)))
            task = next(islice(draw_tasks(ground, Question(VARIED), number, seed), worst, None))
            draw_example(ground, task, Question(VARIED), folder / "example.png")
    tell("figures")
    draw_costs(found, folder / "costs.png")
    draw_times(found, folder / "times.png")
    draw_programme(folder / "exact.png")
    drawing.write_table(
        folder / "redeployments.csv",
        (
            "map",
            "question",
            "nodes",
            "number",
            "drawn",
            *(f"{s} [m]" for s in SEARCHES),
            *(f"{s} [s]" for s in SEARCHES),
        ),
        _rows(found, varied),
    )
    drawing.write_table(
        folder / "statistics.csv",
        ("map", "question", "nodes", "search", "same", "median", "ninth_decile", "worst_found", "none", "time_ratio"),
        [
            (*names, search, *measure(answers, search))
            for *names, answers in _sets(found, varied)
            for search in SEARCHES
        ],
    )
    text = sum_up(found, varied, number)
    (folder / "summary.md").write_text(text, encoding="utf-8")
    return text


def measure(answers: Sequence[Answer], search: str) -> tuple[float, float, float, float, float, float]:
    """What a search came to beside the optimum.

    Returns:
        The share of redeployments at the same cost; by what share the cost is greater in the median, the ninth decile
        (both inf where none was found that often) and the worst case of those where one was found; the share where none
        was found; the median of the ratio of its time to that of the exact search.
    """
    more = dearer(answers, search)
    some = more[np.isfinite(more)]
    middle, high = (float(np.quantile(more, share, method="higher")) for share in (0.5, 0.9))
    ratios = [one.seconds[search] / one.seconds["exact"] for one in answers]
    return (
        float(np.mean(more <= SAME)), middle, high, float(some.max(initial=0.0)), float(np.mean(np.isinf(more))),
        float(np.median(ratios)),
    )  # fmt: skip


def sum_up(
    found: Mapping[str, Mapping[int, Sequence[Answer]]],
    varied: Mapping[str, Mapping[str, Sequence[Answer]]],
    number: int,
) -> str:
    """The text of ``summary.md``."""
    everything = [one for by_nodes in found.values() for answers in by_nodes.values() for one in answers]
    drawn = np.mean([one.drawn for one in everything])
    parts = [
        "# Redeployment study\n",
        f"{number} random redeployments for each map and k: a base, an agent and k − 2 robots of radius {RADIUS_M:g} m "
        "are deployed at the least cost from random places; then the agent is at another random place. Robots pay "
        f"their geodesic ways in metres, links μ = {MU_M:g} m times their virtual weight (1.01 to 2.01). *One-edge* "
        "starts from the tree before, as the thesis does; *repeated* goes on until no edge makes it cheaper; *fixed* "
        f"keeps the tree. Places that k nodes cannot join were drawn again ({drawn:.2f} draws each).\n",
    ]
    for search in SEARCHES[1:]:
        parts += [
            f"## {search.capitalize()}: dearer than the optimum\n",
            "Median · 90 % · worst, in % of the optimum; in brackets the share where it found no deployment, although "
            "there is one (∞ where these are so many).\n",
            _table(
                ("map", *(f"k = {nodes}" for nodes in NODES)),
                [(name, *(_told(by_nodes[nodes], search) for nodes in NODES)) for name, by_nodes in found.items()],
            ),
        ]
    parts += [
        "## All maps together\n",
        _table(
            ("search", "same cost", "median", "90 %", "worst found", "none found", "time, as a multiple of exact"),
            [_totalled(search, everything) for search in SEARCHES[1:]],
        ),
        "Times are of one thread of "
        + describe_machine()
        + ", the links made beforehand, median of the ratios; by map "
        "and k in `statistics.csv`.\n",
        f"## One-edge search, k = {VARIED}, otherwise\n",
        _table(
            ("map", "as above", *VARIATIONS),
            [
                (
                    name,
                    _told(found[name][VARIED], "one-edge"),
                    *(_told(by_name[variation], "one-edge") for variation in VARIATIONS),
                )
                for name, by_name in varied.items()
            ],
        ),
    ]
    return "\n".join(parts)


def _told(answers: Sequence[Answer], search: str) -> str:
    _, middle, high, worst, none, _ = measure(answers, search)
    text = " · ".join("∞" if np.isinf(more) else f"{100 * more:.0f}" for more in (middle, high, worst))
    return f"{text} ({none:.1%})" if none else text


def _totalled(search: str, answers: Sequence[Answer]) -> tuple[str, ...]:
    same, middle, high, worst, none, ratio = measure(answers, search)
    more = ("∞" if np.isinf(some) else f"+{some:.1%}" for some in (middle, high, worst))
    return (search, f"{same:.0%}", *more, f"{none:.1%}", f"{ratio:.2f}")


def _sets(
    found: Mapping[str, Mapping[int, Sequence[Answer]]], varied: Mapping[str, Mapping[str, Sequence[Answer]]]
) -> Iterator[tuple[str, str, int, Sequence[Answer]]]:
    for name, by_nodes in found.items():
        for nodes, answers in by_nodes.items():
            yield name, "one agent", nodes, answers
        for variation, answers in varied[name].items():
            yield name, variation, VARIED, answers


def _rows(
    found: Mapping[str, Mapping[int, Sequence[Answer]]], varied: Mapping[str, Mapping[str, Sequence[Answer]]]
) -> Iterator[tuple[object, ...]]:
    for name, question, nodes, answers in _sets(found, varied):
        for number, one in enumerate(answers):
            costs, seconds = ([by[search] for search in SEARCHES] for by in (one.costs, one.seconds))
            yield (name, question, nodes, number, one.drawn, *costs, *seconds)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows)) + "\n"
