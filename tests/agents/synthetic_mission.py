"""A mission that nobody planned: base station, two robots and an agent that walks on a circle round a pillar.

Everything about it is a formula, so that tests know what a recording of it must contain.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from agents.mission import Mission, OnDemand, RosterEntry
from agents.records import AnyRecord, Connectivity, Decision, LogLine, Planned, Track
from planning.environment import Environment
from protocol.messages import Authority, Deployment, Placement, Point, RoleName, Warrant

PERIOD_S = 0.1
DURATION_S = 12.0
ROOM_M = 20.0
SPEED_RAD_S = math.tau / 10.0
RADIUS_M = 6.0
ROSTER: tuple[tuple[str, RoleName, Point], ...] = (
    ("base", "base_station", (1.0, 1.0)),
    ("robot_1", "robot", (10.0, 2.0)),
    ("robot_2", "robot", (2.0, 10.0)),
    ("agent", "tracked_agent", (16.0, 10.0)),
)
PILLAR = np.array([[6.0, 6.0], [14.0, 6.0], [14.0, 14.0], [6.0, 14.0]])


def environment() -> Environment:
    """A square room with a square pillar in its middle."""
    outer = np.array([[0.0, 0.0], [ROOM_M, 0.0], [ROOM_M, ROOM_M], [0.0, ROOM_M]])
    return Environment(outer, (PILLAR,), name="room with a pillar")


def mission() -> Mission:
    """What the launcher would have written."""
    return Mission(
        team="demo",
        map_path="map.json",
        roster=tuple(RosterEntry(name=name, role=role, start=start) for name, role, start in ROSTER),
        behaviour=OnDemand(),
        robot_radius_m=0.3,
        agent_radius_m=0.25,
        robot_speed_m_s=1.0,
        agent_speed_m_s=4.0,
        control_hz=1.0 / PERIOD_S,
        heartbeat_hz=2.0,
        planning_period_s=1.0,
        decomposition="inflection",
        duration_s=DURATION_S,
        seed=1,
        epoch_unix_s=0.0,
    )


def position(name: str, time_s: float) -> Point:
    """Where a peer is: the agent walks on a circle, robot_1 drives along the wall and back, the others stand."""
    if name == "agent":
        angle = SPEED_RAD_S * time_s
        return ROOM_M / 2 + RADIUS_M * math.cos(angle), ROOM_M / 2 + RADIUS_M * math.sin(angle)
    x, y = next(start for peer, _, start in ROSTER if peer == name)
    return (x + math.sin(time_s), y) if name == "robot_1" else (x, y)


def velocity(name: str, time_s: float) -> Point:
    """Derivative of the position."""
    if name == "agent":
        angle, speed = SPEED_RAD_S * time_s, SPEED_RAD_S * RADIUS_M
        return -speed * math.sin(angle), speed * math.cos(angle)
    return (math.cos(time_s), 0.0) if name == "robot_1" else (0.0, 0.0)


def tracks(name: str, begin_s: float = 0.0, end_s: float = DURATION_S) -> Iterator[tuple[float, AnyRecord]]:
    """What a peer records of itself; the agent also says where it goes, once per second."""
    role: RoleName = next(role for peer, role, _ in ROSTER if peer == name)
    for step in range(round(begin_s / PERIOD_S), round(end_s / PERIOD_S)):
        time_s = step * PERIOD_S
        here, ahead = position(name, time_s), position(name, time_s + 1.0)
        moving = role != "base_station" and time_s >= 1.0
        yield (
            time_s,
            Track(
                role=role,
                position=here,
                velocity=velocity(name, time_s),
                radius_m=0.25 if role == "tracked_agent" else 0.3,
                mode="moving" if moving else "waiting",
                target=ahead if moving else None,
                path=(here, ahead) if moving else (),
            ),
        )
        if role == "tracked_agent" and step % 10 == 0:
            yield time_s, LogLine(level="info", text=f"goal ({ahead[0]:.2f}, {ahead[1]:.2f})")


def decisions() -> Iterator[tuple[float, AnyRecord]]:
    """What the base station records as the leader: links every period, a new tree every four seconds."""
    room = environment()
    for step in range(round(DURATION_S / PERIOD_S)):
        time_s = step * PERIOD_S
        relay = "robot_1" if int(time_s / 4.0) % 2 == 0 else "robot_2"
        edges = (("base", relay), (relay, "agent"))
        places = {name: position(name, time_s) for name, _, _ in ROSTER}
        names = list(places)
        seen = room.visibility_matrix(np.array(list(places.values())))
        links = tuple(
            (places[a], places[b]) for i, a in enumerate(names) for j, b in enumerate(names[:i]) if seen[i, j]
        )
        yield (
            time_s,
            Connectivity(
                links=links,
                agent_visible=bool(seen[3, :3].any()),
                chain_connected=step % 7 != 0,
                team_connected=False,
                lambda2=0.25 * (step % 5),
                tree_links=tuple((places[a], places[b]) for a, b in edges),
            ),
        )
        if step % 40 == 10:
            yield time_s, Planned(planning_s=0.001 * step)
            yield (
                time_s,
                Decision(
                    deployment=Deployment(
                        authority=Authority(epoch=0, leader="base", sequence=step),
                        warrant=Warrant(lease_s=0.8, marks=()),
                        decision=step // 40 + 1,
                        placements=(
                            Placement(robot="robot_1", position=places["robot_1"], cell=1, spare=relay != "robot_1"),
                            Placement(robot="robot_2", position=places["robot_2"], cell=2, spare=relay != "robot_2"),
                        ),
                        edges=edges,
                        cost=1.5,
                        total_cost_m=None if step < 40 else 11.0 + step // 40,
                        lower_bound_m=None if step < 40 else 12.0,
                        relays_needed=1,
                        reason=f"{relay} sees the agent for longer; \N{GREEK SMALL LETTER LAMDA}2 “quoted”",
                    ),
                    planning_s=0.001 * step,
                    topology_changed=step > 10,
                ),
            )
