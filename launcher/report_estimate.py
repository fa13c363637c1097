"""What the shared estimate of an independent agent was worth, held against where the agent truly was."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from agents.records import Estimate
from agents.target_set import SIMPLER_M
from launcher.mission_trace import MissionTrace, Trail
from protocol.messages import Point

Floats = NDArray[np.float64]

AT_THE_END_S: Final = 1.5
"""Who has recorded nothing for so long is not there any more, and need not have what was measured since."""


class EstimateFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Over all records of all peers that have one, two a second each."""

    records: int
    error_median_m: float
    """From the center of a set to the agent."""
    error_p95_m: float
    area_median_m2: float
    area_p95_m2: float
    age_p95_s: float
    """Since the newest range."""
    contained: float
    """Share of the sets that the agent was in, between 0 and 1."""
    equal: float | None
    """Share of moments, two seconds after which all peers had the same ranges up to them; none if nothing compares."""
    ranges: int
    """Measured by all."""
    unshared: float
    """Share of these that a peer did not have at the end, in the mean of the peers; those on their way count too."""
    late: int
    """Ranges that came after their place had been given up, over all peers."""
    refused: int
    """What peers said that cannot be, over all who heard it."""


def measure_estimates(trace: MissionTrace) -> EstimateFigures | None:
    """Figures of the estimates; none if nobody has recorded one while the agent was there."""
    agent = next(trail for trail in trace.trails if trail.role == "tracked_agent")
    judged = [
        (estimate, truth)
        for time_s, _, estimate in trace.estimates
        if (truth := _place(agent, time_s, trace.control_hz)) is not None
    ]
    if not judged:
        return None
    # Between two samples of the track the agent may have turned, and outlines leave out what hardly matters.
    tolerance_m = SIMPLER_M + 0.5 * agent.speed_m_s / trace.control_hz
    errors_m = [float(np.hypot(*np.subtract(estimate.center, truth))) for estimate, truth in judged]
    error_m, worst_error_m = np.percentile(errors_m, (50, 95)).tolist()
    area_m2, worst_area_m2 = np.percentile([estimate.area_m2 for estimate, _ in judged], (50, 95)).tolist()
    last = {peer: (time_s, estimate) for time_s, peer, estimate in trace.estimates}
    ends_s = max(time_s for time_s, _ in last.values())
    made = _made(trace.estimates)
    lacking = [max(made - estimate.heard, 0) for time_s, estimate in last.values() if time_s > ends_s - AT_THE_END_S]
    return EstimateFigures(
        records=len(judged),
        error_median_m=error_m,
        error_p95_m=worst_error_m,
        area_median_m2=area_m2,
        area_p95_m2=worst_area_m2,
        age_p95_s=float(np.percentile([estimate.age_s for estimate, _ in judged], 95)),
        contained=float(np.mean([_holds(estimate.rings, truth, tolerance_m) for estimate, truth in judged])),
        equal=_equal(trace.estimates),
        ranges=made,
        unshared=float(np.mean(lacking)) / max(made, 1),
        late=sum(estimate.late for _, estimate in last.values()),
        refused=sum(estimate.refused for _, estimate in last.values()),
    )


def _place(trail: Trail, time_s: float, control_hz: float) -> Point | None:
    """Where the agent was, if it recorded before and after that without a gap."""
    after = int(np.searchsorted(trail.times_s, time_s))
    if not 0 < after < len(trail.times_s) or trail.times_s[after] - trail.times_s[after - 1] > 2.0 / control_hz:
        return None
    x, y = (float(np.interp(time_s, trail.times_s, trail.positions[:, axis])) for axis in (0, 1))
    return x, y


def _holds(rings: Sequence[Sequence[Point]], place: Point, tolerance_m: float) -> bool:
    """Whether a place is inside rings, a ring within another being a hole, or within the tolerance of one."""
    if not rings:
        return False
    begins = np.concatenate([np.asarray(ring) for ring in rings]) - place
    ends = np.concatenate([np.roll(np.asarray(ring), -1, axis=0) for ring in rings]) - place
    along = ends - begins
    share = np.clip(-(begins * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-18), 0.0, 1.0)
    nearest = begins + share[:, None] * along
    if float(np.hypot(*nearest.T).min()) <= tolerance_m:
        return True
    (x0, y0), (x1, y1) = begins.T, ends.T
    crossing = (y0 <= 0.0) != (y1 <= 0.0)
    right = x0[crossing] - y0[crossing] * (x1 - x0)[crossing] / (y1 - y0)[crossing] > 0.0
    return bool(right.sum() % 2)


def _equal(estimates: Sequence[tuple[float, str, Estimate]]) -> float | None:
    said: dict[float, dict[str, int | None]] = {}
    for _, peer, estimate in estimates:
        said.setdefault(estimate.compared_s, {})[peer] = estimate.fingerprint
    several = [list(prints.values()) for prints in said.values() if len(prints) > 1]
    return float(np.mean([len(set(prints)) == 1 for prints in several])) if several else None


def _made(estimates: Sequence[tuple[float, str, Estimate]]) -> int:
    """Ranges measured by all processes: a count that falls has begun anew."""
    made: dict[str, int] = {}
    total = 0
    for _, peer, estimate in estimates:
        before = made.get(peer, 0)
        total += estimate.made - before if estimate.made >= before else estimate.made
        made[peer] = estimate.made
    return total


def failures_of(figures: EstimateFigures | None) -> tuple[str, ...]:
    """What must not happen with an estimate, and did: sentences."""
    if figures is None or figures.contained == 1.0:
        return ()
    return (f"the agent was outside of {100.0 * (1.0 - figures.contained):.2f} % of the sets that are to contain it",)
