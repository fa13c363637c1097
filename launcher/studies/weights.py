"""The study of thesis §3.3.1: histograms of virtual edge weights, figures 25 to 30.

exp(−area) has a unit of length in it, and the thesis does not name the one of its maps. So each map is measured twice:
in metres as packaged, and at the scale at which the mean of exp(−area) + exp(−area) over its pairs is what fig. 26
says. What else figures 25 and 26 say can then be compared.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from launcher.studies import drawing
from launcher.studies.thesis_tables import AREA_WEIGHTS, EXPONENTIAL_AREA, INVERSE_AREA, ROWS
from launcher.studies.weighed_edges import MEASURES, Weighed, describe, weigh
from launcher.studies.weights_figures import Bars, draw_areas, draw_hops, draw_maps, draw_mixtures


def study_weights(folder: Path, shown: str = "room3", tell: Callable[[str], None] = print) -> str:
    """Weigh all edges of the thesis' maps, draw the histograms, and say what came out.

    Args:
        folder: is made; files in it of the same names are replaced.
        shown: the map whose aspect cells figures 25 to 30 are drawn of; figure ``maps`` shows all.
        tell: is told what is being done.

    Returns:
        The text of ``summary.md``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    weighed: list[Weighed] = []
    for row in ROWS:
        tell(f"{row.map}, {row.kind}")
        weighed += weigh(row.map, row.kind)
    example = next((one for one in weighed if (one.map, one.kind, one.unit) == (shown, "aspect", "thesis")), None)
    if example is None:
        example = weigh(shown, "aspect")[1]
    tell("figures")
    bars: Bars = []
    draw_areas(example, folder, bars)
    draw_hops(example, folder)
    draw_mixtures(example, folder, bars)
    draw_maps([one for one in weighed if one.unit == "metres"], folder, bars)
    drawing.write_table(folder / "histograms.csv", ("figure", "panel", "from", "to", "pairs"), bars)
    statistics = [
        (one.map, one.kind, one.unit, one.scale, len(one.pairs[0]), measure, *describe(one.costs[measure]))
        for one in weighed
        for measure in MEASURES
    ]
    drawing.write_table(
        folder / "statistics.csv",
        ("map", "kind", "unit", "scale", "pairs", "measure", "mean", "deviation", "skewness", "kurtosis", "greatest"),
        statistics,
    )
    text = _sum_up(weighed, example)
    (folder / "summary.md").write_text(text, encoding="utf-8")
    return text


def _sum_up(weighed: Sequence[Weighed], example: Weighed) -> str:
    """The text of ``summary.md``."""
    scaled = [one for one in weighed if one.unit == "thesis"]
    metres = [one for one in weighed if one.unit == "metres"]
    rows = []
    for one, real in zip(scaled, metres, strict=True):
        inverse, exponential = one.costs["inverse area"], one.costs["exponential area"]
        lopsided, in_metres = (describe(some.costs["normalised"])[2] for some in (one, real))
        rows.append(
            f"| {one.name} | {len(one.pairs[0])} | {1 / one.scale:.2f} m | {exponential.std():.2f} | "
            f"{inverse.mean():.4g} | {inverse.std():.4g} | {lopsided:+.2f} | "
            f"{real.costs['exponential area'].mean():.3g} | {in_metres:+.2f} |"
        )
    aspect = [one for one in scaled if one.kind == "aspect"]
    nearest = min(aspect, key=lambda one: abs(one.costs["exponential area"].std() - EXPONENTIAL_AREA[1]))
    mixed = {
        weight: [
            float(np.corrcoef(example.costs["distance"] + weight * example.costs["exponential area"], cost)[0, 1])
            for cost in (example.costs["distance"], example.costs["exponential area"])
        ]
        for weight in AREA_WEIGHTS
    }
    balanced = min(AREA_WEIGHTS, key=lambda weight: abs(mixed[weight][0] - mixed[weight][1]))
    balance = describe(example.costs["normalised"])
    both = [
        float(np.corrcoef(example.costs["normalised"], example.costs[measure])[0, 1])
        for measure in ("distance", "exponential area")
    ]
    return "\n".join(
        [
            "# Study of virtual edge weights\n",
            "All pairs of different cells that see each other, on the thesis' maps. exp(−area) depends on the unit of "
            "length, and the thesis does not say its own; at the *unit* below, exp(−area) + exp(−area) has the mean of "
            f"fig. 26, {EXPONENTIAL_AREA[0]:g}. The other columns up to the first skewness are at that unit, the last "
            "two in metres as packaged.\n",
            "| map | pairs | unit | exp: deviation | inverse: mean | inverse: deviation | normalised: skewness | exp "
            "in metres: mean | normalised in metres: skewness |",
            "|---|---|---|---|---|---|---|---|---|",
            f"| **thesis, Fig. 21** | ? | ? | {EXPONENTIAL_AREA[1]:g} | {INVERSE_AREA[0]:g} | {INVERSE_AREA[1]:g} | "
            '"almost Gaussian" | – | – |',
            *rows,
            "",
            "Which aspect decomposition Fig. 21 shows is not known, as the figure is lost in the text we have. By the "
            f"deviation of exp the nearest is {nearest.name}; the inverse is decided by the smallest slivers, which "
            "rebuilt maps do not share.\n",
            f"Figures 25 to 30 are drawn of {example.name}, at that unit; `maps.png` of all maps, in metres.\n",
            "- **Fig. 25: the inverse area has a heavy tail.** It has: with aspect cells the deviation is "
            f"{min(_tail(one) for one in aspect):.1f} to {max(_tail(one) for one in aspect):.1f} times the mean "
            f"(thesis {INVERSE_AREA[1] / INVERSE_AREA[0]:.1f}).",
            "- **Fig. 26: the exponential is smooth and at most 2.** It is at most 2, and smooth at the right "
            "unit. It says little where all areas are far above 1, or far below: see its mean in metres.",
            "- **Fig. 27: distance alone takes many small hops.** So it does; the figure counts them.",
            "- **Fig. 29: as k_b grows, the mixture goes over from distance to area.** Correlations with both: "
            + ", ".join(f"k_b = {weight:g} {a:.2f} and {b:.2f}" for weight, (a, b) in mixed.items())
            + f". They are nearest at k_b = {balanced:g}; that number depends on the map and its unit.",
            f"- **Fig. 30: normalised, the result is almost Gaussian.** Skewness {balance[2]:.2f}, excess "
            f"kurtosis {balance[3]:.2f} (both 0 for a Gaussian), correlation with distance {both[0]:.2f} and with area "
            f"{both[1]:.2f}. On other maps it has another shape: see `maps.png`.",
            "",
        ]
    )


def _tail(one: Weighed) -> float:
    """Deviation over mean of the inverse area."""
    inverse = one.costs["inverse area"]
    return float(inverse.std() / inverse.mean())
