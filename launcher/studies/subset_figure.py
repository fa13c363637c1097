"""The picture of why the exact search is exact: how a tree is taken apart, and how much work that leaves.

The letters are those of `planning.subset_programme`, F(B, v) for F[B](v).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from launcher.studies import drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HELD, BRANCH, REST = drawing.INK, "#d1261f", "#2f4bd6"

TREE = {4: (0.0, 0.0), 1: (-1.35, -1.1), 3: (-2.1, -2.2), 5: (-0.75, -2.2), 2: (1.3, -1.1), 6: (1.3, -2.2)}
"""Where nodes are drawn."""
EDGES = ((4, 1), (1, 3), (1, 5), (4, 2), (2, 6))

CELLS = 700
"""N of the third panel, and that a fifth of all pairs see each other, as in room3 with bitangents."""
LINKS = CELLS**2 // 5


def draw_programme(file: Path) -> Path:
    """Three panels: a tree falls into branches, a branch hangs by an edge, and how the work grows."""
    figure = drawing.new_figure(14.0, 5.2)
    whole, branch, work = (figure.add_subplot(1, 3, number) for number in (1, 2, 3))
    _draw_branches(whole)
    _draw_hanging(branch)
    _draw_work(work)
    return drawing.write_figure(figure, file)


def count_work(nodes: int) -> dict[str, float]:
    """How many sums several ways to the optimum take, for k nodes on :data:`CELLS` placements."""
    trees = float(nodes) ** (nodes - 2)
    return {
        "every tree, every placement: k^(k−2) · N^k": trees * float(CELLS) ** nodes,
        "every tree, algorithms 4 to 6: k^(k−2) · k m": trees * nodes * LINKS,
        "subset programme: 3^(k−1) N + 2^(k−1) (m + k N)": 3.0 ** (nodes - 1) * CELLS
        + 2.0 ** (nodes - 1) * (LINKS + nodes * CELLS),
        "one edge away, by messages (not the optimum): 5/4 k² m": 1.25 * nodes**2 * LINKS,
    }


def _draw_branches(axes: Axes) -> None:
    axes.set_title("1. What hangs below a node in v falls into branches", fontsize=10, loc="left")
    axes.plot([0, 0.9], [0, 1.0], "--", color="#7b8794", linewidth=1.2)
    axes.annotate("the rest of the tree,\nwhich knows of v only", (1.0, 0.95), fontsize=8, color="#59636d", va="center")
    _enclose(axes, (1, 3, 5), BRANCH, "A: holds the lowest label", (-2.45, -2.95))
    _enclose(axes, (2, 6), REST, "B∖A", (1.08, -2.95))
    _draw_nodes(axes, {4: HELD, 1: BRANCH, 3: BRANCH, 5: BRANCH, 2: REST, 6: REST})
    axes.annotate("in v", (-0.3, 0.12), fontsize=10, ha="right", style="italic")
    _say(axes, "F(B, v) = min over A of  h(A, v) + F(B∖A, v)")


def _draw_hanging(axes: Axes) -> None:
    axes.set_title("2. A branch is a tree with a root, hung by one edge", fontsize=10, loc="left")
    _enclose(axes, (3, 5), BRANCH, "hangs below i in u:  F(A∖i, u)", (-2.45, -2.95))
    _draw_nodes(axes, {4: HELD, 1: BRANCH, 3: BRANCH, 5: BRANCH})
    axes.annotate("in v", (-0.3, 0.12), fontsize=10, ha="right", style="italic")
    axes.annotate("i, in u:  it pays C_i(u)", (-1.0, -1.15), fontsize=9, va="center", color=BRANCH)
    axes.annotate("μ W[u, v]", (-0.5, -0.75), fontsize=9, color=BRANCH)
    _say(axes, "h(A, v) = min over u of  μ W[u, v] + min over i in A of  C_i(u) + F(A∖i, u)")


def _draw_work(axes: Axes) -> None:
    nodes = range(3, 13)
    colours = ("#7b8794", "#f0a11c", BRANCH, "#0b6b74")
    series = [count_work(k) for k in nodes]
    for (name, colour), style in zip(zip(series[0], colours, strict=True), ("-", "-", "-", "--"), strict=True):
        axes.semilogy(nodes, [work[name] for work in series], style, color=colour, linewidth=1.8, label=name)
    axes.set_ylim(1e5, 1e26)
    axes.set_xticks(list(nodes))
    drawing.dress_series(axes, "3. Additions, for N = 700 cells and m = N²/5 links", "nodes k", "additions")
    axes.title.set_fontsize(10)
    axes.legend(fontsize=8, frameon=False, loc="upper center", bbox_to_anchor=(0.45, -0.13))


def _draw_nodes(axes: Axes, colours: dict[int, str]) -> None:
    for i, j in EDGES:
        if i in colours and j in colours:
            axes.plot(*zip(TREE[i], TREE[j], strict=True), color=colours[j], linewidth=1.8, zorder=2)
    for node, colour in colours.items():
        axes.plot(*TREE[node], "o", color=colour, markersize=19, zorder=3)
        axes.annotate(f"{node}", TREE[node], color="white", ha="center", va="center", fontweight="bold", zorder=4)


def _enclose(axes: Axes, nodes: Sequence[int], colour: str, label: str, place: tuple[float, float]) -> None:
    from matplotlib.patches import FancyBboxPatch

    low, high = np.min([TREE[n] for n in nodes], axis=0), np.max([TREE[n] for n in nodes], axis=0)
    width, height = high - low + 0.5
    round_box = "round,pad=0.12"
    axes.add_patch(
        FancyBboxPatch(low - 0.25, width, height, round_box, facecolor=colour, alpha=0.12, linewidth=0, zorder=1)
    )
    axes.annotate(label, place, fontsize=9, color=colour)


def _say(axes: Axes, formula: str) -> None:
    axes.annotate(formula, (-2.85, -3.75), fontsize=9.5)
    axes.set(xlim=(-3.0, 3.2), ylim=(-3.95, 1.4), aspect="equal")
    axes.axis("off")
