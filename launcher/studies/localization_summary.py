"""What the study of thesis §2.5 came to, in words and numbers: also where the thesis says otherwise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from launcher.studies.localization_figures import is_like_the_thesis, split_steps
from launcher.studies.ranging_run import (
    BOUND_M,
    CORRUPT_STEP,
    EXPERIMENTS,
    FLAW_M,
    RESOLVED_M2,
    STEP_M,
    STEPS,
    STRAIGHT,
    THROUGH,
    Run,
)

THESIS = "thesis' gradient"

Runs = Mapping[str, Mapping[str, Sequence[Run]]]
"""By experiment and law."""

KEEPERS = (
    ("inside", "our ellipsoid"),
    ("tight_inside", "tight set, rejecting"),
    ("relaxed_inside", "tight set, q-relaxed"),
    ("thesis_inside", "thesis' filter"),
    ("gaussian_inside", "Gaussian, 3σ"),
)
"""Whether each estimate holds the target: a series of a run, and what to call it."""

ORDERS_OF_MAGNITUDE = 100
"""From what ratio on one speaks of them: two at least."""
NEAR_M = 0.5
"""A robot this near to the target stands on it, but for one step."""


def sum_up(runs: Runs, through: Sequence[Run], corrupt: Sequence[Run]) -> str:
    """The text of ``summary.md``.

    Args:
        runs: by experiment and law.
        through: one robot on a line through the target.
        corrupt: one robot, the thesis' law, a corrupt measurement; with scenes.
    """
    claims = (
        _kinds_of_set(corrupt),
        _recovery(corrupt),
        _closed_loop(runs, through),
        _right_angles(runs),
        _more_robots(runs),
    )
    parts = [
        "# Localisation study\n",
        f"{len(corrupt)} runs each, {STEPS} steps of {STEP_M} m, ranges off by up to ±{BOUND_M} m, target at rest. "
        "Thesis' law: eq. 17 with the corrected weight and predicted range, circling where nothing pulls aside.\n",
        f"## Steps until the tight set is below {RESOLVED_M2} m² and in one place\n",
        "Median (middle half).\n",
        _table(
            ("law", *(experiment.title for experiment in EXPERIMENTS)),
            [
                (law, *(_quartiles([run.resolved_at for run in runs[e.name][law]]) for e in EXPERIMENTS))
                for law in runs[EXPERIMENTS[0].name]
            ],
        ),
        "## Holding the target\n",
        "Share of runs whose estimate held it at every step, all laws and experiments; and at the end after a corrupt "
        f"measurement in step {CORRUPT_STEP + 1} (a position {FLAW_M:g} m off along the line of sight; one robot, "
        "thesis' law).\n",
        _table(
            ("estimate", "every step, no corrupt measurement", "at the end, after a corrupt one"),
            [
                (
                    title,
                    f"{np.mean([run[name].min() for by in runs.values() for some in by.values() for run in some]):.1%}",
                    f"{np.mean([run[name][-1] for run in corrupt]):.1%}",
                )
                for name, title in KEEPERS
            ],
        ),
        "## The thesis' claims\n",
        "".join(f"- {claim}\n" for claim in claims),
    ]
    return "\n".join(parts)


def _kinds_of_set(corrupt: Sequence[Run]) -> str:
    two = [bool(split_steps(run)) for run in corrupt]
    one = [len(run.scenes[-1].feasible.regions) == 1 for run in corrupt]
    shown = "The figures show a typical run of those with two in which the thesis' filter held a set again at the end."
    if not any(is_like_the_thesis(run) for run in corrupt):
        shown = "None of the runs is like the thesis': the figures show any."
    return (
        "**One range leaves an annulus, more leave two regions, then one (fig. 12).** Two regions on the way came in "
        f"{_share(two)} of runs; in the others the annulus opened to one region at once. One region at the last step "
        f"in {_share(one)}. {shown}"
    )


def _recovery(corrupt: Sequence[Run]) -> str:
    definite = np.array([run["thesis_definite"] for run in corrupt])
    broken = definite[:, CORRUPT_STEP] < 0.5
    back = broken & (definite[:, -1] > 0.5)
    wrong = back & np.array([run["thesis_inside"][-1] < 0.5 for run in corrupt])
    negative = np.array([(run["thesis_det"][CORRUPT_STEP:] < 0).any() for run in corrupt])
    return (
        "**The filter recovers by itself (fig. 13).** The corrupt measurement left the thesis' E without a set in "
        f"{_share(broken)} of runs, and its determinant was negative at that step or later in {_share(negative)}. By "
        f"the last step E bounded a set again in {_share(back)} of all runs; in {_share(wrong)} a set without the "
        "target. k < 0 proves that nothing is left; ours rejects the measurement and goes on."
    )


def _closed_loop(runs: Runs, through: Sequence[Run]) -> str:
    closed, past = runs["one"][THESIS], runs["one"][STRAIGHT]
    told, higher = [], []
    for line, title in ((past, "the line past it"), (through, f"the {THROUGH}")):
        pairs = list(zip(closed, line, strict=True))
        dets = [10 ** (a["log10_det"][-1] - b["log10_det"][-1]) for a, b in pairs]
        areas = [b["area_m2"][-1] / a["area_m2"][-1] for a, b in pairs]
        told.append(f"against {title} det E {_ratio(dets)} times and the feasible set {_ratio(areas)} times smaller")
        higher.append(np.median(dets) > ORDERS_OF_MAGNITUDE)
    verdict = ("does not come out", "comes out against one of two lines", "comes out")[sum(higher)]
    near = np.array([run["distance_m"].min() < NEAR_M for run in closed])
    ends = np.array([run["log10_det"][-1] for run in closed])
    groups = [
        f"{word} ({_share(some)} of runs) median det E {10 ** np.median(ends[some]):.1g}"
        for some, word in ((near, f"where the robot came within {NEAR_M:g} m of the target"), (~near, "elsewhere"))
        if some.any()
    ]
    found = [_share(np.isfinite([run.resolved_at for run in some])) for some in (closed, past, through)]
    return (
        f"**Closed loop has det E orders of magnitude above the straight line (fig. 14)**: {verdict}. At the end, "
        f"{'; '.join(told)}. The determinant is the square of an inverse volume in three dimensions and rewards being "
        f"near: {', '.join(groups)}. (In the thesis' own filter a line never gives three independent strips, and det E "
        f"stays 0.) What counts is that the mirror image goes: the target was found in {found[0]} of runs, on the line "
        f"past it in {found[1]}, on the line through it in {found[2]}."
    )


def _right_angles(runs: Runs) -> str:
    told, seen = [], []
    for name, title in (("one-and-standing", "one standing"), ("two", "two moving")):
        for law in (THESIS, "covariance", "5 steps ahead"):
            angles = [float(np.median(run["angle_deg"][STEPS // 2 :])) for run in runs[name][law]]
            told.append(f"{title}, {law} {_quartiles(angles)}°")
            if np.median(angles) >= 75:
                seen.append(f"{title}, {law}")
    return (
        "**About 90° between the robots emerges (figs. 15, 17)**: above 75° in the median with "
        f"{'; '.join(seen) or 'none'}. Over the second half of the runs, opposite counted as 0°: {'; '.join(told)}. It "
        "is no measure of quality: compare the steps above."
    )


def _more_robots(runs: Runs) -> str:
    by_time, by_range = [], []
    for experiment in EXPERIMENTS:
        areas = np.median([run["tight_m2"] for run in runs[experiment.name][THESIS]], axis=0)
        robots = experiment.moving + experiment.standing
        by_time.append(f"{experiment.title} {areas[19]:.2g}")
        by_range.append(f"{experiment.title} {areas[40 // robots - 1]:.2g}")
    return (
        "**Other robots' ranges make the set smaller (figs. 15–18).** Tight set after 20 steps, median in m²: "
        f"{', '.join(by_time)}. More ranges do that, wherever they come from: after 40 ranges in all, "
        f"{', '.join(by_range)}."
    )


def _ratio(values: Sequence[float]) -> str:
    """Median and middle half."""
    low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
    return f"{middle:.2g} ({low:.2g}–{high:.2g})"


def _quartiles(values: Sequence[float]) -> str:
    low, middle, high = (_number(float(np.quantile(values, q, method="higher"))) for q in (0.25, 0.5, 0.75))
    return middle if low == middle == high else f"{middle} ({low}–{high})"


def _number(value: float) -> str:
    return f"{value:.0f}" if math.isfinite(value) else "never"


def _share(flags: Sequence[bool] | np.ndarray) -> str:
    return f"{np.mean(flags):.0%}"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows)]
    return "\n".join(lines) + "\n"
