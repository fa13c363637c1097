"""How the peers' estimates of an independent agent are drawn: the base station's as an area, the others' as outlines.

Where all peers know the same, the thin outlines lie on the border of the area; where one knows less, they are seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import rerun as rr

from agents.mission import Mission
from agents.recorder_columns import links_columns, places_columns, scalar_columns
from agents.recorder_file import RecordingFile
from agents.recorder_layout import AGE, AREA
from agents.recorder_style import AGENT, BASE_STATION, ROBOT, faded
from agents.records import Estimate
from protocol.messages import Point

HOME: Final = "world/estimate"
HATCHES: Final = 40
"""Lines across the higher side of the set; there are no filled polygons."""

LEAST_PITCH_M: Final = 0.05


def style_estimates(file: RecordingFile, mission: Mission) -> None:
    """Say once how the estimates are drawn."""
    base = mission.base_station.name
    for name in (entry.name for entry in mission.roster if entry.role != "tracked_agent"):
        first = name == base
        file.log(
            f"{HOME}/{name}/outline",
            rr.LineStrips2D.from_fields(
                colors=AGENT if first else faded(AGENT, 0x90), radii=-1.25 if first else -0.5, draw_order=4.0
            ),
            static=True,
        )
        for entity in (AREA, AGE):
            file.log(
                f"{entity}/{name}",
                rr.SeriesLines(
                    colors=BASE_STATION if first else ROBOT,
                    widths=2.0 if first else 1.0,
                    names=name,
                    interpolation_mode=rr.components.InterpolationMode.StepAfter,
                ),
                static=True,
            )
    file.log(
        f"{HOME}/{base}/area",
        rr.LineStrips2D.from_fields(colors=faded(AGENT, 0x50), radii=-0.75, draw_order=3.0),
        static=True,
    )
    file.log(
        f"{HOME}/{base}/center",
        rr.Points2D.from_fields(colors=faded(AGENT, 0xC0), radii=-3.0, draw_order=4.5),
        static=True,
    )


def draw_estimate(file: RecordingFile, now_ns: int, peer: str, estimate: Estimate, *, base_station: bool) -> None:
    """Draw what a peer takes to be the place of the agent, in place of what it took before."""
    rings = [(*ring, ring[0]) for ring in estimate.rings]
    file.gather(now_ns, f"{HOME}/{peer}/outline", links_columns, rings)
    file.gather(now_ns, f"{AREA}/{peer}", scalar_columns, [estimate.area_m2])
    file.gather(now_ns, f"{AGE}/{peer}", scalar_columns, [estimate.age_s])
    if base_station:
        file.gather(now_ns, f"{HOME}/{peer}/area", links_columns, hatch(estimate.rings))
        file.gather(now_ns, f"{HOME}/{peer}/center", places_columns, [estimate.center])


def hatch(rings: Sequence[Sequence[Point]]) -> list[tuple[Point, Point]]:
    """Level lines across the inside of rings that do not cross each other; a ring within another is a hole."""
    if not rings:
        return []
    begins = np.concatenate([np.asarray(ring, dtype=np.float64) for ring in rings])
    ends = np.concatenate([np.roll(np.asarray(ring, dtype=np.float64), -1, axis=0) for ring in rings])
    low, high = float(begins[:, 1].min()), float(begins[:, 1].max())
    pitch = max((high - low) / HATCHES, LEAST_PITCH_M)
    lines: list[tuple[Point, Point]] = []
    for y in np.arange(math.ceil(low / pitch) * pitch, high, pitch).tolist():
        crossing = (begins[:, 1] <= y) != (ends[:, 1] <= y)
        (x0, y0), (x1, y1) = begins[crossing].T, ends[crossing].T
        across = np.sort(x0 + (x1 - x0) * (y - y0) / (y1 - y0)).tolist()
        lines += [((left, y), (right, y)) for left, right in zip(across[::2], across[1::2], strict=True)]
    return lines
