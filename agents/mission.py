"""A mission as every peer knows it: the checked, complete form of a scenario.

The launcher writes it to ``runs/<name>/mission.json`` before it starts anything; each process reads it and finds
itself in the roster. Simulation builds the same roles from the same struct.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

import msgspec

from protocol.messages import Method, Name, Point, RoleName
from protocol.roster import Roster


class RosterEntry(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One peer of the team."""

    name: Name
    role: RoleName
    start: Point
    endpoint: str = ""
    """zenoh endpoint that the peer listens on, e.g. ``tcp/127.0.0.1:17447``; empty in simulation."""


class Scripted(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="kind", tag="script"):
    """The agent visits these goals in order, then stays."""

    goals: tuple[Point, ...]
    pause_s: float = 2.0
    """Rest at each goal before the next."""
    start_after_s: float = 3.0
    """Mission time at which the first goal is taken."""


class Wandering(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="kind", tag="wander"):
    """The agent explores: goals within its line of sight or just around a visible corner (thesis §4.4.2)."""

    around_corner_share: float = 0.5
    """Share of goals that lie just around a visible corner; the others are in line of sight."""
    pause_s: float = 1.0
    start_after_s: float = 3.0


class OnDemand(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="kind", tag="goals"):
    """The agent waits for goals from operators; the other behaviours obey those too, and then go on."""


Behaviour: TypeAlias = Scripted | Wandering | OnDemand


class Ranging(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the distance to the agent is measured, and how far clocks can be apart."""

    rate_hz: float = 4.0
    """Every robot and the base station asks so often."""
    bound_m: float = 0.2
    """No range is wrong by more."""
    noise_m: float = 0.1
    """What the built-in radio is really wrong by, at most: evenly spread up to this, and no more than ``bound_m``."""
    clock_bound_s: float = 0.05
    """The most by which the clocks of any two peers differ."""


class Mission(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Everything that the peers of a team must agree on."""

    team: Name
    map_path: str
    """The polygon file that all peers load; absolute, or relative to the folder of the mission file."""
    roster: tuple[RosterEntry, ...]
    """One base station, one tracked agent, robots; the order is the same for everybody."""
    behaviour: Behaviour
    robot_radius_m: float
    agent_radius_m: float
    robot_speed_m_s: float
    agent_speed_m_s: float
    control_hz: float
    """Rate of the control loops, of the recording's tracks and of ``state`` and ``intent``."""
    heartbeat_hz: float
    planning_period_s: float
    """The leader looks at least this often whether the deployment still serves."""
    decomposition: Literal["inflection", "aspect"]
    duration_s: float | None
    """Mission time at which the launcher ends the run; None: until it is told."""
    seed: int
    epoch_unix_s: float
    """Wall clock at mission time zero."""
    placements: Literal["cells", "points"] = "points"
    """What relays stand at (:mod:`planning.placement_graph`)."""
    spacing_m: float | None = None
    """Of the grid of points; None: one that suits the map."""
    search: Literal["chain", "exact", "one-edge", "fixed"] = "chain"
    """How the leader finds chains (:mod:`agents.proposals`)."""
    retreat_after_s: float = 10.0
    """When robots that nobody has led for so long go back the way that they have come (:mod:`agents.retreat`)."""
    topology: Method = "optimum"
    """Where the trees come from that the leader proposes (:mod:`agents.topology`)."""
    announces: bool = True
    """Whether the agent says where it is and where it goes; else it answers ranging, and nothing more."""
    ranging: Ranging = Ranging()
    planning_delay_s: float = 0.02
    """In simulation: modelled duration of a planning job."""

    def entry(self, name: str) -> RosterEntry:
        """Roster entry of a peer. Raises KeyError if there is none."""
        for entry in self.roster:
            if entry.name == name:
                return entry
        raise KeyError(name)

    @property
    def voters(self) -> Roster:
        """The team as the election sees it: base station and robots vote, in this order.

        Raises:
            RosterFault: the roster is none that a team can have.
        """
        voters = (self.base_station.name, *(robot.name for robot in self.robots))
        return Roster(voters, (self.tracked_agent.name,))

    @property
    def base_station(self) -> RosterEntry:
        """The one base station."""
        return next(entry for entry in self.roster if entry.role == "base_station")

    @property
    def tracked_agent(self) -> RosterEntry:
        """The one tracked agent."""
        return next(entry for entry in self.roster if entry.role == "tracked_agent")

    @property
    def robots(self) -> tuple[RosterEntry, ...]:
        """The robots, in roster order."""
        return tuple(entry for entry in self.roster if entry.role == "robot")
