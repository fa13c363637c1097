"""Whether a robot can rely on a motion that it is sent: what it says is checked, and then certified.

A robot relies on nothing in the message that it can know better: how large and how fast its likes are, who is in the
team, where the base station stands. That others are where the message has them only they can tell, and each of them
does before it moves.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TypeAlias

from agents.mission import Mission
from agents.motion_message import InvalidMotion, to_schedule
from planning.certificate import certify
from planning.environment import Environment
from planning.motion_plan import InvalidSchedule
from protocol.messages import MemberWay, Motion

Judge: TypeAlias = Callable[[Motion], str]
"""Says what is wrong with a motion; nothing if it is certified."""

REMEMBERED = 64
"""Verdicts: all robots of a simulation ask about the same motions."""


def certificate_judge(mission: Mission, environment: Environment) -> Judge:
    """The judge of a team's motions.

    Args:
        mission: roster, radius and speed of the robots.
        environment: the map as drawn.
    """

    @lru_cache(REMEMBERED)
    def judge(motion: Motion) -> str:
        for way in motion.ways:
            if fault := _find_fault(mission, way):
                return fault
        if mission.base_station.name not in {way.member for way in motion.ways}:
            return f"{mission.base_station.name} is not in the motion"
        asks_nothing = motion.connection == "none" or (motion.connection == "joined" and len(motion.joined) < 2)
        try:
            certificate = certify(
                to_schedule(motion),
                environment,
                links=[] if asks_nothing else None,
                ends=motion.joined if motion.connection == "joined" and not asks_nothing else None,
            )
        except (InvalidMotion, InvalidSchedule) as problem:
            return str(problem)
        return "" if certificate.valid else certificate.violations[0].text

    return judge


def _find_fault(mission: Mission, way: MemberWay) -> str:
    """What contradicts the mission in the way of one member; empty if nothing does."""
    entry = next((entry for entry in mission.roster if entry.name == way.member), None)
    if entry is None:
        return f"{way.member} is not on the roster"
    if entry.role == "tracked_agent":
        return f"{way.member} waits for nobody, and is scheduled" if way.scheduled else ""
    if entry.role == "base_station":  # a post that takes no room, whatever it looks like
        if any(place != entry.start for place in way.waypoints):
            return f"{way.member} is not where it stands, at ({entry.start[0]:g}, {entry.start[1]:g})"
        return ""
    if way.radius_m < mission.robot_radius_m:
        return (
            f"{way.member} has a radius of {way.radius_m:g} m, and not {mission.robot_radius_m:g} m as in the mission"
        )
    if way.speed_m_s > mission.robot_speed_m_s:
        return f"{way.member} is to go {way.speed_m_s:g} m/s, and can go {mission.robot_speed_m_s:g} m/s"
    return ""
