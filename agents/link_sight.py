"""From which stage of a motion on two members see each other, wherever they may be in its stages.

A link of the team's tree is to hold from a stage on. Whether it does is judged by the certificate of motions
(:mod:`planning.certificate`), by the peers at both of its ends as by the leader: for all places where the two may be
while nobody begins a stage before the others have finished the last but one.

Of the agent no motion is certified. It is linked with a relay if that sees some place where the agent may be, from
wherever a stage of the relay's way begins or ends. While it may be anywhere that holds of every relay: of no place
is it known that it is not there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from msgspec import structs

from agents.motion_message import InvalidMotion, end_stage, to_schedule
from planning.certificate import certify
from planning.environment import Environment
from planning.foresight import length, walk
from planning.motion_plan import InvalidSchedule
from protocol.messages import Edge, LinkView, MemberWay, Motion, NewLink, Point

AHEAD_M: Final = 16.0
"""So much of an agent's announced way counts as where it may be."""

PIECE_M: Final = 0.5
"""It is looked at so often."""


@dataclass(frozen=True, eq=False)
class Scene:
    """What is known when links are judged."""

    environment: Environment
    motion: Motion | None
    """That is accepted, or to be; none: all stand."""
    places: Mapping[str, Point]
    """Where everybody is that is not in the motion."""
    agent: str
    may_be: Sequence[Point] | None = field(default=())
    """Where the agent may be, now or on its way; None: anywhere. Empty: it has yet to say so."""


def places_on(way: Sequence[Point]) -> tuple[Point, ...]:
    """Places on an agent's announced way, from where it is."""
    pieces = walk(way, np.arange(0.0, min(AHEAD_M, length(way)) + PIECE_M, PIECE_M))
    return tuple((float(x), float(y)) for x, y in pieces)


def stages_in_sight(scene: Scene, links: Sequence[Edge]) -> list[int | None]:
    """From which stage of the motion on each link holds; None: not even when all have come to the end.

    The stage after the last one: when all have come to the end. Where all stand: 0, or None.

    Complexity: O(log n) certificates of two members a link for n stages.
    """
    return [_first_stage(scene, link) for link in links]


def judge_links(scene: Scene, name: str, links: Sequence[NewLink]) -> tuple[LinkView, ...]:
    """What a peer says of links of its own."""
    return tuple(_judge(scene, name, link) for link in links)


def _judge(scene: Scene, name: str, link: NewLink) -> LinkView:
    other = next((end for end in link.ends if end != name), name)
    if other == name:
        return LinkView(peer=name, verdict="refuses", reason=f"{name} cannot be linked to itself")
    stage = _first_stage(scene, link.ends)
    if stage is None:
        what = "where they stand" if scene.motion is None else "where they come to a stop"
        return LinkView(peer=other, verdict="refuses", reason=f"{name} and {other} do not see each other {what}")
    if link.since is None or scene.motion is None:
        return LinkView(peer=other, verdict="sees")
    begins = max(link.since.stage, scene.motion.first_stage)  # what all have finished is not contained any more
    if stage > begins:
        reason = f"{name} and {other} see each other from stage {stage} on, not from stage {link.since.stage}"
        return LinkView(peer=other, verdict="refuses", reason=reason)
    return LinkView(peer=other, verdict="will" if begins > scene.motion.first_stage else "sees")


def _first_stage(scene: Scene, link: Edge) -> int | None:
    motion, environment = scene.motion, scene.environment
    moving = {} if motion is None else {way.member: way for way in motion.ways if way.scheduled}
    if scene.agent in link:
        (relay,) = (end for end in link if end != scene.agent)
        if motion is not None and relay in moving:
            return _first_stage_with_agent(scene, motion, moving[relay])
        return 0 if relay in scene.places and _sees_some(scene, scene.places[relay]) else None
    if motion is None or any(end not in moving for end in link):
        known = {**scene.places, **{name: way.waypoints[-1] for name, way in moving.items()}}
        if any(end not in known for end in link):
            return None
        sees = bool(environment.line_of_sight(np.array(known[link[0]]), np.array(known[link[1]])))
        return (0 if motion is None else end_stage(motion)) if sees else None
    ways = [moving[end] for end in link]
    if not environment.is_convex and not bool(
        environment.line_of_sight(*(np.array(way.waypoints[-1]) for way in ways))
    ):
        return None
    # Who sees the other from a stage on sees it from any later one on.
    low, high = 0, len(ways[0].stages) - 1
    while low < high:
        middle = (low + high) // 2
        if _see_each_other(environment, motion, ways, middle):
            high = middle
        else:
            low = middle + 1
    return motion.first_stage + low


def _see_each_other(environment: Environment, motion: Motion, ways: Sequence[MemberWay], first: int) -> bool:
    """Whether two members do throughout the stages from one on, counted from the first one contained."""
    if environment.is_convex:
        return True
    rest = tuple(
        # Who is in the way of whom is not asked here.
        structs.replace(
            way,
            radius_m=0.0,
            waypoints=way.waypoints[way.stages[first] :],
            stages=tuple(mark - way.stages[first] for mark in way.stages[first:]),
        )
        for way in ways
    )
    try:
        schedule = to_schedule(structs.replace(motion, ways=rest))
        return certify(schedule, environment, links=[(rest[0].member, rest[1].member)]).valid
    except (InvalidMotion, InvalidSchedule):
        return False


def _first_stage_with_agent(scene: Scene, motion: Motion, relay: MemberWay) -> int | None:
    sees = [_sees_some(scene, relay.waypoints[mark]) for mark in relay.stages]
    if not sees[-1]:
        return None
    blind = [stage for stage, seen in enumerate(sees) if not seen]
    return motion.first_stage + (blind[-1] + 1 if blind else 0)


def _sees_some(scene: Scene, place: Point) -> bool:
    if scene.may_be is None or (scene.may_be and scene.environment.is_convex):
        return True
    return bool(scene.may_be) and bool(np.any(scene.environment.line_of_sight(np.array(place), np.array(scene.may_be))))
