"""What the leader's planning job is asked, and what it answers: all that the leader needs to know of planning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agents.lot import Bids
from agents.movement_authority import Onset
from agents.target_set import TargetSet
from protocol.messages import Point

if TYPE_CHECKING:
    from agents.leader import Plan
    from agents.motion_planner import Course

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Question:
    """What is known when a plan is asked for."""

    way: tuple[Point, ...]
    """The agent's, from where it is; empty if it does not announce it."""
    onset: Onset
    """Where the robots will be when a new motion can begin."""
    lead_s: float
    """How long it is until then."""
    previous: Plan | None
    """The plan before."""
    heading: Mapping[str, Point]
    """Where the motion under way leads; empty if there is none, or it does not lead to the goals."""
    lost: Mapping[str, Floats] = field(default_factory=dict)
    """(m, 2) each: where robots may be that are not heard any more."""
    target: TargetSet | None = None
    """Where an agent may be that announces no way; None: nothing has been measured yet."""
    drift_m_s: Point = (0.0, 0.0)
    """How the middle of that set has been moving."""
    bids: Bids | None = None
    """What was offered in an auction held just before; None: there was none."""


@dataclass(frozen=True, eq=False)
class Answer:
    """A plan and the motion to it."""

    plan: Plan
    course: Course | None
    """None: the motion under way leads there."""
    failure: str = ""
    """Why there is no course, if there should be one."""
    in_sight_s: float = 0.0
    """For how long from the onset on the last relay, where it is then, sees all that the agent can reach; no more than
    a minute is looked ahead."""
