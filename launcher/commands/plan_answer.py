"""What ``plan`` answers, in words and as a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from launcher.console import tell
from launcher.plan_request import Request
from launcher.wording import counted

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from planning.environment import Environment
    from protocol.messages import Point

LISTED = 6
"""Names in a sentence; of more the rest is counted."""


def find_crowds(request: Request, facts: dict[str, Any]) -> list[list[str]]:
    """Who would stand nearer to each other than two robots fit: groups of names with a robot in each.

    Placements may be shared, and may lie where somebody stands already: a plan counts robots and says what they see,
    and leaves it to them to keep apart. The base station has no body, and is in nobody's way.
    """
    agents = _named_agents(request)
    standing = [*agents, *_named_relays(request, facts)]
    apart_m = max(2 * request.placements.radius_m, 1e-6)
    group = list(range(len(standing)))
    for one, (_, place) in enumerate(standing):
        for other in range(max(one + 1, len(agents)), len(standing)):
            if math.dist(place, standing[other][1]) < apart_m and group[one] != group[other]:
                joined, gone = sorted((group[one], group[other]))
                group = [joined if number == gone else number for number in group]
    crowds = ([name for name, of in zip(standing, group, strict=True) if of == number] for number in sorted({*group}))
    return [[name for name, _ in crowd] for crowd in crowds if len(crowd) > 1]


def tell_tree(request: Request, facts: dict[str, Any]) -> None:
    """Where relays stand."""
    spare = "" if facts["spares"] is None else f", {facts['spares']} to spare"
    tell(f"{_count(facts)}{spare}; virtual cost {facts['cost']:.3f}")
    _tell_places([("base", request.base)])
    relays = enumerate(facts["relays"], 1)
    for (x, y), shared in groupby(relays, key=lambda relay: relay[1]):
        numbers = [number for number, _ in shared]
        several = "" if len(numbers) == 1 else f"  and the next {len(numbers) - 1} there, too"
        tell(f"  relay {numbers[0]:<3} {x:8.3f}, {y:8.3f}{several}")
    _tell_places(_named_agents(request))


def tell_moves(request: Request, facts: dict[str, Any]) -> None:
    """Who goes where, and what that costs."""
    cost, bound = facts["cost"], facts["lower_bound"]
    idle = sum(robot["to"] is None for robot in facts["robots"])
    spare = len(facts["relays"]) > facts["relays_needed"] and not request.moves.idle
    hint = "; --idle leaves robots out" if spare and facts["search"] not in ("tree", "chain") else ""
    tell(
        f"{_count(facts)}, {idle} idle{hint}; cost {cost:.3f} = movement {facts['movement']:.3f} {facts['unit']} + "
        f"{facts['mu']:g} × virtual cost {facts['virtual']:.3f}"
    )
    if bound is not None:
        among = "" if request.moves.idle or facts["search"] == "chain" else " that leaves no robot out"
        reached = "reached: this is the least" if cost - bound <= 1e-9 * cost else "not reached"
        tell(f"  bound     {bound:.3f} for any plan{among}; {reached}")
    if facts["present_tree"] is not None:
        assumed = "" if request.moves.links else ", taken for the present tree; give --link for another"
        tell(f"  from      {' '.join(facts['present_tree'])}{assumed}")
    _tell_places([("base", request.base), *_named_agents(request)])
    for number, robot in enumerate(facts["robots"], 1):
        (x, y), end = robot["from"], robot["to"]
        where = "idles" if end is None else f"to {end[0]:8.3f}, {end[1]:8.3f}"
        tell(f"  robot {number:<3} {x:8.3f}, {y:8.3f}  {where}")


def draw_tree(
    request: Request,
    facts: dict[str, Any],
    environment: Environment,
    polygons: Sequence[NDArray[np.float64]] | None,
    picture: Path,
) -> None:
    """Write the picture of where relays stand."""
    from launcher.picture import draw_plan

    draw_plan(
        environment, polygons, request.base, request.agents, facts["relays"], facts["links"], picture,
        f"{environment.name or request.file.stem}: {counted(len(facts['relays']), 'relay')}",
    )  # fmt: skip


def title_moves(facts: dict[str, Any]) -> str:
    """Of a picture of who goes where."""
    relays = len(facts["relays"])
    idle = len(facts["robots"]) - relays
    return f"{facts['search']}: {counted(relays, 'relay')}, {idle} idle, cost {facts['cost']:.2f}"


def _count(facts: dict[str, Any]) -> str:
    """How many relays, and how many would do."""
    relays, needed = len(facts["relays"]), facts["relays_needed"]
    if not facts["relays_needed_is_least"]:
        return f"{counted(relays, 'relay')} (at most {min(relays, needed)} would do; the least is not known)"
    return counted(relays, "relay") + ("" if relays == needed else f" ({needed} would do)")


def _named_agents(request: Request) -> list[tuple[str, Point]]:
    if len(request.agents) == 1:
        return [("agent", request.agents[0])]
    return [(f"agent {number}", place) for number, place in enumerate(request.agents, 1)]


def _named_relays(request: Request, facts: dict[str, Any]) -> list[tuple[str, Point]]:
    if not request.moves.robots:
        return [(f"relay {number}", place) for number, place in enumerate(facts["relays"], 1)]
    ends = [(f"robot {number}", robot["to"]) for number, robot in enumerate(facts["robots"], 1)]
    return [(name, end) for name, end in ends if end is not None]


def _tell_places(places: Sequence[tuple[str, Point]]) -> None:
    for title, (x, y) in places:
        tell(f"  {title:9} {x:8.3f}, {y:8.3f}")


def tell_end(request: Request, facts: dict[str, Any]) -> None:
    """What is to be known about the answer, and where pictures are."""
    for crowd in facts["crowds"]:
        advice = (
            "the motion lets them stand beside each other"
            if request.moves.robots
            else "let them stand beside each other"
        )
        more = f" and {len(crowd) - LISTED} more" if len(crowd) > LISTED else ""
        tell(
            f"Too near: {', '.join(crowd[:LISTED])}{more} share a place, or stand less than "
            f"{2 * request.placements.radius_m:g} m apart; {advice}."
        )
    most = counted(facts["most_relays_needed"], "relay")
    elsewhere = "" if facts["placements"] == "cells" else ", elsewhere in their sight at most one more"
    tell(f"An agent at any of the {facts['placements']} needs at most {most} from this base station{elsewhere}.")
    for title, file in (("Picture", request.picture), ("Diagram", request.diagram and request.diagram[1])):
        if file is not None:
            tell(f"{title}: {file}")
