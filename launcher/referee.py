"""Who truly saw whom, for the recording of a team whose agent tells nobody where it is.

No peer of such a team knows that, so that it is judged when the mission is over, on the true tracks of all, and drawn
beside what the peers have drawn.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from agents.network import judge_network
from agents.recorder import REFEREE, Recorder
from agents.records import Connectivity
from launcher.mission_trace import MissionTrace
from launcher.report import sample
from planning.environment import Environment
from protocol.messages import Point

NOBODY = Connectivity(links=(), agent_visible=False, chain_connected=False, team_connected=False, lambda2=0.0)
"""Where there is no base station to be connected to."""


def judge(trace: MissionTrace, environment: Environment) -> Iterator[tuple[float, Connectivity]]:
    """Mission time in seconds and who saw whom then, once in each control period.

    Complexity: O(periods · (peers² · walls + peers³)).
    """
    times_s = np.arange(0.0, trace.duration_s, 1.0 / trace.control_hz)
    there, places = sample(trace, times_s)
    names = [trail.peer for trail in trace.trails]
    base = next(trail.peer for trail in trace.trails if trail.role == "base_station")
    decided_s = np.array([time_s for time_s, _ in trace.decisions])
    for time_s, present, at in zip(times_s.tolist(), there, places.tolist(), strict=True):
        known: dict[str, Point] = {name: (x, y) for name, here, (x, y) in zip(names, present, at, strict=True) if here}
        if base not in known:
            yield time_s, NOBODY
            continue
        latest = int(np.searchsorted(decided_s, time_s, side="right")) - 1
        edges = trace.decisions[latest][1].deployment.edges if latest >= 0 else ()
        yield time_s, judge_network(environment, base, trace.agent, known, edges, len(known) == len(names))


def record_verdicts(trace: MissionTrace, environment: Environment, recorder: Recorder) -> None:
    """Put all of :func:`judge` into a recording."""
    for time_s, verdict in judge(trace, environment):
        recorder.record(time_s, REFEREE, verdict)
