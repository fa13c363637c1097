"""How ``plan`` tells and draws the motion of robots to where they are sent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from launcher.console import tell
from launcher.move_order import Move
from launcher.plan_request import Request
from launcher.wording import counted

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from launcher.planned_motion import PlannedMotion
    from planning.environment import Environment
    from protocol.messages import Point

    Floats = NDArray[np.float64]

LISTED = 24
"""Lines of the order of moves; of more the rest is counted."""

WAYS = {
    "direct": "direct, all by shortest ways",
    "detour": "with detours",
    "stepwise": "step by step",
    "bridge": "over a deployment in between",
    "parted": "best effort",
}


def tell_motion(planned: PlannedMotion) -> None:
    """The way, what is certified, and the order of moves."""
    motion, schedule = planned.motion, planned.motion.schedule
    if not planned.moves:
        tell("Motion: nobody has to move")
        return
    tell(
        f"Motion: {WAYS[motion.way]}; {schedule.end_s - schedule.start_s:.1f} s at {planned.speed_m_s:g} m/s, "
        f"{motion.length_m:.1f} m driven, {motion.geodesic_m:.1f} m by shortest ways; "
        f"{counted(schedule.stage_count, 'stage')}"
    )
    if not planned.certificate.valid:
        tell(f"  broken    for {motion.break_s:.1f} s: {planned.certificate.violations[0].text}")
    elif len(planned.joined) > 1:
        kept = ", ".join(planned.joined)
        tell(f"  certified {kept} are one network throughout, and no discs overlap, whoever is late")
    else:
        tell("  certified no discs overlap, whoever is late; nothing of sight, as the base sees nobody before")
    for move in planned.moves[:LISTED]:
        tell(_tell_move(move, planned.team.names))
    if len(planned.moves) > LISTED:
        tell(f"  and {counted(len(planned.moves) - LISTED, 'move')} more; --json lists all")


def _tell_move(move: Move, names: Sequence[str]) -> str:
    first, last = move.stages
    stages = f"stage {first}" if first == last else f"stages {first} to {last}"
    text = f"  {names[move.member]:9} {move.begin_s:8.1f} to {move.end_s:8.1f} s  {move.length_m:8.2f} m  {stages}"
    if move.waits_for:
        text += (
            f", after {move.waits_s:.1f} s of waiting for {' and '.join(names[member] for member in move.waits_for)}"
        )
    return text


def draw_moves(
    request: Request, planned: PlannedMotion, environment: Environment, polygons: Sequence[Floats] | None, title: str
) -> None:
    """Write the picture and the diagram, those that are asked for."""
    team, schedule = planned.team, planned.motion.schedule
    where = environment.name or request.file.stem
    if request.picture is not None:
        from launcher.motion_picture import draw_motion

        agents = len(request.agents)
        signs = ["B", *(["A"] if agents == 1 else [f"A{number}" for number in range(1, agents + 1)])]
        signs += [str(number) for number in range(1, len(team.names) - agents)]
        ends = schedule.positions([schedule.end_s])[0]
        draw_motion(
            environment, polygons, schedule, dict(zip(team.names, signs, strict=True)), _places(ends, team.tree),
            request.picture, f"{where}: {title}", links_before=_places(team.starts, planned.links_before),
        )  # fmt: skip
    if request.diagram is not None:
        from launcher.coordination_picture import draw_coordination

        pair, file = request.diagram
        names = team.names[pair[0]], team.names[pair[1]]
        draw_coordination(environment, schedule, pair, names, file, f"{where}: {names[0]} and {names[1]}")


def _places(places: Floats, links: Sequence[tuple[int, int]]) -> list[tuple[Point, Point]]:
    """The two ends of each link."""
    points: list[Point] = [(float(x), float(y)) for x, y in places]
    return [(points[u], points[v]) for u, v in links]
