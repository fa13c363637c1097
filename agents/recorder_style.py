"""Colours of a recording, and how its lines and curves are drawn."""

from __future__ import annotations

import numpy as np
import rerun as rr

from agents.mission import Mission
from agents.recorder_file import RecordingFile

BASE_STATION, ROBOT, AGENT, UNKNOWN = 0xF5B83DFF, 0x4DB8FFFF, 0xFF5D7EFF, 0xC0C4CCFF
ROLE_COLOURS = {"base_station": BASE_STATION, "robot": ROBOT, "tracked_agent": AGENT}
WALL, CELL, SIGHT = 0xB9C2D0FF, 0x8A94A638, 0xC8D2E070
IN_SIGHT, OUT_OF_SIGHT = 0x5BE08AFF, 0xFF4D4DFF
MODES = {
    "waiting": 0x7A8290FF,
    "moving": 0x4DB8FFFF,
    "yielding": 0xB48CFFFF,
    "arrived": 0x5BE08AFF,
    "holding": 0xF5B83DFF,
    "retreating": 0xFF8C42FF,
}
SERIES = {"connected": ["agent visible", "chain", "team"], "cost": ["cost", "lower bound"]}


def style(file: RecordingFile, mission: Mission) -> None:
    """Say once how all is drawn that has a look of its own."""
    series = {**SERIES, "in_hand": [entry.name for entry in mission.robots]}
    for entry in mission.roster:
        file.log(
            f"mode/{entry.name}",
            rr.StateConfiguration(values=list(MODES), colors=np.array(list(MODES.values()), dtype=np.uint32)),
            static=True,
        )
    for entity, colours, widths in (
        ("connected", [AGENT, IN_SIGHT, ROBOT], [6.0, 3.5, 1.5]),  # later ones are drawn over earlier ones
        ("lambda2", [ROBOT], [1.5]),
        ("planning_ms", [BASE_STATION], [1.5]),
        ("cost", [BASE_STATION, IN_SIGHT], [3.0, 1.5]),
        ("certified", [IN_SIGHT], [1.5]),
        ("in_hand", [ROBOT] * len(mission.robots), [1.0] * len(mission.robots)),
        ("in_sight_s", [AGENT], [1.5]),
    ):
        file.log(
            entity,
            rr.SeriesLines(
                colors=np.array(colours, dtype=np.uint32),
                widths=widths,
                names=series.get(entity, entity),
                interpolation_mode=rr.components.InterpolationMode.StepAfter,
            ),
            static=True,
        )
    for entity, colour, width, order in (
        ("world/sight", SIGHT, 0.5, 5.0),
        ("world/chain/in_sight", IN_SIGHT, 2.0, 10.0),
        ("world/chain/broken", OUT_OF_SIGHT, 2.0, 10.0),
        ("world/motion/ways", faded(ROBOT, 0x60), 1.0, 6.0),
        ("world/motion/released", ROBOT, 2.0, 7.0),
    ):
        file.log(entity, rr.LineStrips2D.from_fields(colors=colour, radii=-width, draw_order=order), static=True)
    file.log(
        "world/motion/stages",
        rr.Points2D.from_fields(colors=faded(ROBOT, 0x60), radii=-2.0, draw_order=6.0),
        static=True,
    )


def faded(colour: int, alpha: int) -> int:
    """The colour 0xRRGGBBAA with another alpha."""
    return (colour & ~0xFF) | alpha
