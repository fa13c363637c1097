"""What the study of thesis §4.1 came to: its three tables with ours beside them, and where the two grow apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from launcher.studies.complexity_figures import LARGE
from launcher.studies.complexity_runs import MU, NODES, TRIALS, MapRun, line_tree, modifications
from launcher.studies.scaling import Fit, describe_machine, fit_power
from launcher.studies.thesis_tables import COMPLEXITY

COUNTS = ("V", "r", "Lb", "Lr", "La", "I", "N")
TIMES = (("Td", "decomposition_s"), ("Tmv", "visibility_s"), ("Tpv", "all_pairs_s"), ("Tpp", "adjacency_paths_s"))
"""The thesis' name of a time, and ours."""

Slopes = Sequence[tuple[int, Fit]]
"""At each number of nodes, or on each map."""


def sum_up(
    runs: Sequence[MapRun],
    once: Mapping[str, tuple[Fit, Fit]],
    trees: Mapping[str, Slopes],
    searches: Mapping[str, Mapping[str, Slopes]],
    seconds: float,
) -> str:
    """The text of ``summary.md``.

    Args:
        runs: counts and times of the maps.
        once: fits of what is computed once, ours and of the thesis' own times.
        trees: fits of Steiner trees over ``cells`` and ``terminals``.
        searches: fits of each search over ``cells`` and ``nodes``.
        seconds: what the study took.
    """
    rebuilt = [
        run.name for run in runs if run.thesis and any(run.counts[name] != getattr(run.thesis, name) for name in COUNTS)
    ]
    parts = [
        "# Complexity study\n",
        f"Times are processor times of one thread, the shortest of a few runs each, on {describe_machine()}. The whole "
        f"study took {seconds:.0f} s. The thesis' times are those of a computer of 2009: compare how they grow.\n",
        "## Table 1: counts\n",
        "In brackets the thesis' number, where ours is another. The last maps have the bitangents that the thesis left "
        "out of them.\n",
        _table(("map", *COUNTS), [(run.name, *(_beside(run, name) for name in COUNTS)) for run in runs]),
    ]
    if rebuilt:
        parts.append(
            f"The maps are rebuilt to the counts of the table; {', '.join(rebuilt)} could not be brought to all of "
            "them.\n"
        )
    parts += [
        "## Table 2: what is computed once\n",
        "Milliseconds, and how many times as long the thesis took: decomposition, mutual visibility graph, all its "
        "shortest paths, all adjacency paths. The adjacency graph (Tad) comes with our decomposition.\n",
        _table(
            ("map", "N", "decomposition", "visibility", "all pairs", "adjacency paths"),
            [(run.name, f"{run.counts['N']}", *(_seconds_beside(run, *names) for names in TIMES)) for run in runs],
        ),
        "## Table 3: how times grow\n",
        _table(
            ("step", "thesis says", "its own times", f"ours, from {LARGE} cells on"), _growth(once, trees, searches)
        ),
        "Exponents, unless a base is named. What the thesis' own times say is fitted to its Tables 1 and 2. In "
        "brackets the standard error; for trees and searches, of which each number of nodes and each map has a fit of "
        "its own, the median, and in brackets the least and the greatest. All are in `fits.csv`.\n",
        "## Where they differ, and why\n",
        "".join(f"- {reason}\n" for reason in _reasons(runs)),
        f"Steiner trees: {TRIALS} sets of random terminals each. Redeployments: base, agent and robots at random "
        "places, in a line, which of all trees has the most modifications; lengths between centroids, μ = "
        f"{MU:g} m.\n",
    ]
    return "\n".join(parts)


def _growth(
    once: Mapping[str, tuple[Fit, Fit]], trees: Mapping[str, Slopes], searches: Mapping[str, Mapping[str, Slopes]]
) -> list[tuple[str, str, str, str]]:
    rows = []
    for name, over in (
        ("decomposition", "L"),
        ("mutual visibility", "N"),
        ("all pairs", "N"),
        ("all adjacency paths", "N"),
    ):
        ours, printed = once[name]
        claim = COMPLEXITY.get(name, COMPLEXITY["all pairs"])
        theirs_said, ours_said = (f"{fit.slope:.2f} ({fit.error:.2f})" for fit in (printed, ours))
        rows.append((f"{name}, over {over}", claim, theirs_said, ours_said))
    claim = COMPLEXITY["Steiner tree"]
    rows.append(("Steiner tree, over N", claim, "2 (fig. 44)", _middle(trees["cells"])))
    rows.append(("Steiner tree, base over terminals", claim, "3 (fig. 45)", _middle(trees["terminals"], LARGE)))
    one, all_of_them = COMPLEXITY["redeployment, one tree"], COMPLEXITY["redeployment, all modifications"]
    for name, title, claim, over_cells, over_nodes in (
        ("one tree", "one tree", one, "too noisy (fig. 46)", "too noisy (fig. 47)"),
        ("tree by tree", "all modifications, tree by tree", all_of_them, "2 (fig. 48)", "4 to 5 (fig. 50)"),
        ("by messages", "all modifications, by messages", all_of_them, "2 (fig. 48)", "4 to 5 (fig. 50)"),
        ("exact", "all trees", "left open", "–", "–"),
    ):
        base = "base over k" if name == "exact" else "over k"
        rows.append((f"{title}, over N", claim, over_cells, _middle(searches[name]["cells"])))
        rows.append((f"{title}, {base}", claim, over_nodes, _middle(searches[name]["nodes"], LARGE)))
    return rows


def _reasons(runs: Sequence[MapRun]) -> list[str]:
    """What is known of the algorithms; the slopes themselves are in the table."""
    searched = [run for run in runs if run.links and run.thesis]
    dense = [2 * run.links / run.counts["N"] ** 2 for run in searched]
    large = [run for run in searched if run.counts["N"] >= LARGE]
    large = large if len(large) > 2 else searched
    links = fit_power([run.counts["N"] for run in large], [run.links for run in large])
    trees = [len(modifications(line_tree(k))) for k in NODES]
    expected = fit_power(NODES, [k * number for k, number in zip(NODES, trees, strict=True)])
    return [
        "**Decomposition.** The thesis intersects all pairs of segments, L², and draws a line of slope 2; its table "
        "says less. Ours takes time by the cells that come of it. Their number differs most between maps with "
        "bitangents, and so do the times at equal L.",
        "**Mutual visibility.** Pairs of cells, as in the thesis. What a pair costs differs between maps: a hidden one "
        "is mostly decided by the wall that hid the neighbour, and aspect cells inherit from inflection cells.",
        "**All pairs.** The algorithm of Floyd and Warshall takes N³ steps, however many links there are, but those of "
        "few cells stay in the processor's cache. The thesis runs Dijkstra's from each cell.",
        "**Adjacency paths.** The graph is sparse; Dijkstra's algorithm with a heap takes N² log N there, and not N³.",
        "**Steiner trees.** Labels that cannot be part of an optimal tree are dropped, and one step leads on from all "
        "placements together: so the base stays below 3, and some terminals take several times as long as others.",
        "**Searches, over N.** Products run over the pairs that see each other. Their share of N² is "
        f"{min(dense):.0%} to {max(dense):.0%}, and on the maps that are fitted their number grows with slope "
        f"{links.slope:.2f} ({links.error:.2f}) over N. With so little work, calls count too, and their time does not "
        "grow.",
        f"**Tree by tree, over k.** A line of k nodes has (k³ − 7k)/6 + 1 modifications. With the line these are "
        f"{trees[0]} trees for k = {NODES[0]} and {trees[-1]} for k = {NODES[-1]}; times k for the nodes of each, that "
        f"grows with slope {expected.slope:.2f} in this range, and not with the 4 that is the limit for large k. So a "
        "slope above 4, which surprised the thesis, need not come from its implementation.",
        "**By messages, over k.** The same modifications and the same optimum with O(k²) products: parts of trees are "
        "solved once, and not again for each tree that they are part of.",
        "**All trees.** 2^(k−1) products over the links and 3^(k−1) sums of N terms. The number of trees, k^(k−2), "
        "does not matter.",
    ]


def _middle(slopes: Slopes, least: int = 0) -> str:
    """Median and range, of the maps that are large enough if there are any."""
    values = [fit.slope for at, fit in slopes if at >= least] or [fit.slope for _, fit in slopes]
    return f"{np.median(values):.2f} ({min(values):.2f} to {max(values):.2f})"


def _beside(run: MapRun, name: str) -> str:
    ours = run.counts[name]
    theirs = ours if run.thesis is None else getattr(run.thesis, name)
    return f"{ours}" if theirs == ours else f"{ours} ({theirs})"


def _seconds_beside(run: MapRun, theirs: str, ours: str) -> str:
    taken = getattr(run, ours)
    if not np.isfinite(taken):
        return "–"
    return f"{1e3 * taken:.3g}" + (f" (×{getattr(run.thesis, theirs) / taken:.0f})" if run.thesis else "")


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows)) + "\n"
