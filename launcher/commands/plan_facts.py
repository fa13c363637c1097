"""How ``plan`` comes by its answer, and as what it is given."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from launcher.commands.motion_answer import draw_moves, tell_motion
from launcher.commands.plan_answer import draw_tree, find_crowds, tell_end, tell_moves, tell_tree, title_moves
from launcher.commands.plan_options import sayer
from launcher.console import busy, print_json
from launcher.placements import place
from launcher.plan_request import Request, check_robots, move_team, present_tree, send_robots
from launcher.present_tree import name_links
from launcher.scenario import ScenarioFault

if TYPE_CHECKING:
    from launcher.offline_plan import Terminals
    from launcher.planned_motion import PlannedMotion
    from planning.decomposition import Cells
    from planning.placement_graph import PlacementGraph


def answer_plan(request: Request, as_json: bool) -> None:
    """Plan, draw what is to be drawn, and say it.

    Raises:
        ScenarioFault: one sentence, where there is no such plan; after the answer, where there is one, but no motion
            to it that keeps the network.
    """
    from launcher.ground import Ground
    from launcher.kernels import warm_up

    say = sayer(as_json)
    warm_up(say, ["planning"])
    file, options = request.file, request.placements
    ground = Ground.around(file, file, "--base", request.base, request.tolerance_m)
    for agent in request.agents:
        ground.check_inside("--agent", agent)
    walkers = [("--robot", robot) for robot in request.moves.robots]
    walkers += [("--agent-from", agent) for agent in request.moves.agents]
    for option, start in walkers:
        ground.check_walk("--radius", {option: start}, options.radius_m, request.base, "--base")
    ground.check_apart([(option, start, options.radius_m) for option, start in walkers])
    if request.moves.agents:
        for agent in request.agents:
            ground.check_walk("--radius", {"--agent": agent}, options.radius_m, request.base, "--base")
    ground.room("--radius", options.radius_m, request.base, "--base")
    with busy("Planning ..."):
        graph, cells = place(file, ground.environment, options, request.base, say)
        from launcher.offline_plan import NoPlan, Terminals

        terminals = Terminals(graph, [request.base, *request.agents])
        if lost := terminals.unreachable():
            x, y = request.agents[lost[0]]
            raise ScenarioFault(
                f"{file}: no chain of robots joins --agent {x:g},{y:g} to --base; move it, make --radius smaller, or "
                "choose other placements"
            )
        try:
            facts, planned = _find(request, terminals, graph, cells)
        except NoPlan as problem:
            raise ScenarioFault(f"{file}: {problem}") from problem
    polygons = None if cells is None else cells.polygons
    if planned is None:
        if request.picture is not None:
            draw_tree(request, facts, ground.environment, polygons, request.picture)
    else:
        draw_moves(request, planned, ground.environment, polygons, title_moves(facts))
    if as_json:
        print_json(facts)
    else:
        if planned is None:
            tell_tree(request, facts)
        else:
            tell_moves(request, facts)
            tell_motion(planned)
        tell_end(request, facts)
    if planned is not None and not planned.succeeds:
        raise ScenarioFault(f"{file}: {planned.fault}")


def _find(
    request: Request, terminals: Terminals, graph: PlacementGraph, cells: Cells | None
) -> tuple[dict[str, Any], PlannedMotion | None]:
    """The plan, as it is written for programs, and the motion to it if robots are somewhere already."""
    from launcher.offline_plan import NoPlan

    moves, options = request.moves, request.placements
    try:
        need = terminals.need(request.method)
    except NoPlan:
        # Where a tree is not made by this method, another refuses or does without: the count is no reason to.
        if request.vertices is None and (not moves.robots or moves.search == "tree"):
            raise
        need = terminals.need("takahashi-matsuyama")
    check_robots(request, need)
    facts: dict[str, Any] = {
        "map": str(request.file),
        "base": request.base,
        "agents": list(request.agents),
        "placements": options.kind,
        "decomposition": options.decomposition if options.kind == "cells" else None,
        "robot_radius_m": options.radius_m,
        "relays_needed": need.relays,
        "relays_needed_is_least": need.least,
        "most_relays_needed": max(0, int(graph.relays_from(request.base).max()) - 1),
    }
    planned = None
    if not moves.robots:
        tree = terminals.tree(request.method, request.vertices, request.robots)
        facts |= asdict(tree)
        facts["spares"] = None if request.robots is None else request.robots - len(tree.relays)
    else:
        plan, ways = send_robots(request, terminals, graph, cells)
        present = present_tree(request)
        facts |= {
            "robots": [
                {"from": start, "to": end, "way": way}
                for start, end, way in zip(moves.robots, plan.targets, ways, strict=True)
            ],
            "relays": [target for target in plan.targets if target is not None],
            "links": plan.links,
            "movement": plan.movement,
            "virtual": plan.virtual,
            "cost": plan.cost,
            "mu": moves.mu,
            "unit": "m" if moves.speed_m_s is None else "s",
            "lower_bound": plan.lower_bound,
            "search": moves.search,
            "present_tree": None if present is None else name_links(present, len(request.agents), len(moves.robots)),
        }
        planned = move_team(request, plan, graph)
        facts["motion"] = planned.facts()
    facts["crowds"] = find_crowds(request, facts)
    return facts, planned
