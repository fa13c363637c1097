"""How the team gets from where it is to where it is to stand: the leader's second job, after who stands where.

The agent waits for nobody. If it announces its way, only where it will be in the next moments (:data:`FORESIGHT_S`) is
planned for: anywhere on that way, at any time. If it does not, no sight of it is promised. And it has no body here, for
nobody can promise to keep out of the way of somebody who goes where he likes. Robots that are not heard any more stand
somewhere on the way that they were last allowed, and are in the way of all others.

What is asked of lines of sight, from strict to lax:

1. the whole team and the agent's next moments are one network, if it announces them,
2. base station and robots are,
3. base station and the last relays, of this deployment and of the one before, are, over any others,
4. nothing: the discs only keep apart.

A stricter demand may take longer, and the agent does not wait. So every motion is followed in thought, like the
proposals of :mod:`agents.leader`: the first is taken on which the chain to the agent holds about as long as if all
could go at once, else that on which it holds longest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from agents.mission import Mission
from agents.motion_level import joined_members
from agents.motion_message import to_motion
from agents.movement_authority import Onset
from agents.outlook import Prospect
from agents.whereabouts import Whereabouts
from planning.foresight import distance, head, walk
from planning.motion import Motion as TeamMotion
from planning.motion import plan_motion
from planning.short_stages import shorten
from protocol.messages import MemberWay, Motion, Point

if TYPE_CHECKING:
    from agents.certificate_judge import Judge
    from planning.environment import Environment
    from planning.placement_graph import PlacementGraph

Floats = NDArray[np.float64]

FORESIGHT_S: Final = 1.0
"""So much of the agent's way is to stay in sight throughout."""

STAGE_S: Final = 0.4
"""Stages are cut to this duration, so that those released reach no farther than they must."""

GROWTH: Final = 0.2
"""So much longer may stages be for each second that they are ahead."""

SLOWER_S: Final = 0.3
"""A motion is good enough if the chain holds that much shorter on it than if all could go at once."""

ARRIVED_M: Final = 1e-6
"""Who is so near to its goal stands there: where it stopped differs by the rounding of its steps."""

LAXITY_S: Final = 0.3
"""A less strict demand must be worth so many seconds more of a chain that holds."""

STRANDED_S: Final = 2.0
"""Likewise a motion that does not arrive."""

CLEARANCE_M: Final = 0.02
"""From where a lost robot may be: ways around it are not quite round."""

EFFORT: Final = 300
LAST_EFFORT: Final = 2000
"""Of searches for a motion that keeps sight, and for one that need not."""


@dataclass(frozen=True, eq=False)
class Option:
    """Where the robots may go."""

    goals: Mapping[str, Point]
    """Of each robot of the onset."""
    ends: Sequence[str]
    """The last relays of the deployments before and after, as far as there are any."""


@dataclass(frozen=True, eq=False)
class Course:
    """A motion from its onset on."""

    motion: Motion
    """With what goes on from before."""
    option: Option
    """Where it leads."""
    arrives: bool
    """Whether everybody gets there."""
    reason: str = ""
    """Why not everybody arrives, or stays in sight of all others; a sentence."""


class Candidate(NamedTuple):
    """A motion that could be ordered."""

    worth_s: float
    """Seconds of a chain that holds, less what is missing."""
    laxity: int
    """How many stricter demands there are."""
    option: Option
    found: TeamMotion


class MotionPlanner:
    """Plans motions. Every answer is a function of its arguments alone.

    Args:
        mission: roster, radius and speeds.
        environment: the map as drawn.
        placements: where robots can stop to let others pass, and their shortest paths.
        judge: certifies as the robots will.
    """

    def __init__(self, mission: Mission, environment: Environment, placements: PlacementGraph, judge: Judge) -> None:
        self._mission, self._environment = mission, environment
        self._placements, self._judge = placements, judge
        self.geodesics = placements.geodesics
        self.base, self._agent = mission.base_station.name, mission.tracked_agent.name

    def plan(self, onset: Onset, options: Sequence[Option], agent: Whereabouts, lost: Mapping[str, Floats]) -> Course:
        """A motion to the goals of one of the options.

        Args:
            onset: where it begins.
            options: the first is preferred.
            agent: where the agent may be at the onset, and go.
            lost: (m, 2) each: where robots may be that are not heard any more.

        Returns:
            The best that is possible; at worst everybody stays where the onset is.

        Raises:
            ValueError: not even that is certified: somebody is where it cannot be.

        Complexity: that of a schedule, for each demand that cannot be met and the first that can.
        """
        prospect = Prospect(self._environment, agent, self._mission.agent_speed_m_s)
        ways = [self._geodesics_of(onset, option) for option in options]
        driven_m = prospect.times_s * self._mission.robot_speed_m_s
        hoped_s = max(
            prospect.worth(np.stack([walk(own, driven_m) for own in among.values()], axis=1)) for among in ways
        )
        # Ways around those that are in the way take long to find, and to drive.
        conflicts = [self._count_conflicts(among) for among in ways]
        options = [options[index] for index in sorted(range(len(options)), key=lambda index: conflicts[index])]
        members = len(onset.places)  # those that go as they please come last
        candidates: list[Candidate] = []
        strictest = 0 if agent.announced else 1
        for laxity in dict.fromkeys((strictest, 3, 1, 2)):  # what asks for nothing says what asking for less can win
            for option in options:
                joined = self._demand(onset, option, laxity)
                found = self._find(onset, option, joined, agent, lost)
                holds_s = prospect.worth(found.schedule.positions(prospect.times_s)[:, :members])
                worth_s = holds_s - LAXITY_S * (laxity - strictest) - STRANDED_S * (not found.arrives)
                candidates.append(Candidate(worth_s, laxity, option, found))
                if laxity == strictest and found.way == "direct" and holds_s >= hoped_s - SLOWER_S:
                    break
            best = max(candidates, key=lambda candidate: candidate.worth_s)
            if best.found.arrives and (best.laxity < laxity or best.worth_s >= hoped_s - SLOWER_S):
                break
        less = best.laxity > 1 or not best.found.arrives
        return self._certify(onset, best.option, best.found, lost, candidates[0].found.reason if less else "")

    def _find(
        self, onset: Onset, option: Option, joined: frozenset[str], agent: Whereabouts, lost: Mapping[str, Floats]
    ) -> TeamMotion:
        """The motion to an option's goals in which these members stay in one network."""
        mission = self._mission
        # Of a lost robot that has one place it is known exactly how near others may come.
        standing = {name: _point(where[0]) for name, where in lost.items() if len(where) == 1}
        starts = {self.base: onset.places[self.base], **{name: onset.places[name] for name in option.goals}, **standing}
        goals = {name: _goal(option, name, place) for name, place in starts.items()}
        ahead = head(agent.ways[0], FORESIGHT_S * mission.agent_speed_m_s)
        return plan_motion(
            self._environment,
            list(starts.values()),
            list(goals.values()),
            [0.0 if name == self.base else mission.robot_radius_m for name in starts],
            members=list(starts),
            speed_m_s=mission.robot_speed_m_s,
            joined=joined,
            unscheduled={self._agent: ahead} if self._agent in joined else None,
            obstacles=[
                (where, mission.robot_radius_m + CLEARANCE_M) for name, where in lost.items() if name not in standing
            ],
            geodesics=self.geodesics,
            placements=self._placements,
            may_part=False,
            effort=EFFORT if joined else LAST_EFFORT,
        )

    def _demand(self, onset: Onset, option: Option, laxity: int) -> frozenset[str]:
        """Who is to be one network, from strict to lax (see the module)."""
        team = frozenset(onset.places)
        return (team | {self._agent}, team, frozenset((self.base, *option.ends)), frozenset[str]())[laxity]

    def _geodesics_of(self, onset: Onset, option: Option) -> dict[str, Floats]:
        """Everybody's shortest way (m, 2), metres; of one point for those that stand."""
        return {
            name: np.array([place])
            if (goal := _goal(option, name, place)) == place
            else self.geodesics.path(place, goal)
            for name, place in onset.places.items()
        }

    def _count_conflicts(self, ways: Mapping[str, Floats]) -> int:
        """How many would have to pass one that stands, overtake one that moves, or pass one that comes towards them."""
        own = [way for name, way in ways.items() if name != self.base]
        touching_m = 2 * self._mission.robot_radius_m
        starts, goals = (
            np.array([[distance(way, other[end]) < touching_m for other in own] for way in own]) for end in (0, -1)
        )
        conflicts = (starts & goals) | (starts & starts.T) | (goals & goals.T)
        return int(np.count_nonzero(conflicts)) - len(own)

    def _certify(
        self, onset: Onset, option: Option, found: TeamMotion, lost: Mapping[str, Floats], reason: str
    ) -> Course:
        """The course, with the strictest of its demands that what is kept of the last motion meets too."""
        new = to_motion(
            shorten(found.schedule, STAGE_S, GROWTH), plan=0, revision=0, first_stage=0, released=-1, connection="none"
        )
        stages = len(new.ways[0].stages)
        standing = (_standing_somewhere(name, way, self._mission.robot_radius_m, stages) for name, way in lost.items())
        planned = (way for way in new.ways if way.member not in lost)
        motion = onset.continued(structs.replace(new, ways=(*planned, *standing)))
        joined = frozenset(found.connection)
        kept = frozenset[str]() if onset.kept is None else joined_members(onset.kept)
        for demand in dict.fromkeys((joined, joined - {self._agent}, joined & kept, frozenset[str]())):
            motion = _ask(motion, demand)
            fault = self._judge(motion)
            if not fault:
                return Course(motion, option, found.arrives, reason)
        raise ValueError(f"the motion planned is not certified: {fault}")


def _standing_somewhere(name: str, way: Floats, radius_m: float, stages: int) -> MemberWay:
    """A robot that stands anywhere on a way, in a motion of so many stages and one."""
    waypoints = tuple((float(x), float(y)) for x, y in way)
    return MemberWay(
        member=name, radius_m=radius_m, speed_m_s=1.0, waypoints=waypoints,
        stages=(0, *[len(waypoints) - 1] * (stages - 1)), scheduled=False,
    )  # fmt: skip


def _ask(motion: Motion, joined: frozenset[str]) -> Motion:
    """A motion in which these members are to stay in one network."""
    if joined.issuperset(way.member for way in motion.ways):
        return structs.replace(motion, connection="team", joined=())
    if len(joined) > 1:
        return structs.replace(motion, connection="joined", joined=tuple(sorted(joined)))
    return structs.replace(motion, connection="none", joined=())


def _goal(option: Option, name: str, place: Point) -> Point:
    """Where a member goes that is at a place."""
    x, y = option.goals.get(name, place)
    return place if math.hypot(x - place[0], y - place[1]) < ARRIVED_M else (x, y)


def _point(place: Floats) -> Point:
    return float(place[0]), float(place[1])
