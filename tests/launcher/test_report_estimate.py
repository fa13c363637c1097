"""Figures of the shared estimate, from records whose figures are known beforehand."""

from __future__ import annotations

import math

import pytest
from msgspec import structs

from agents.records import AnyRecord, Estimate, Track
from launcher.mission_trace import MissionTrace
from launcher.report_estimate import EstimateFigures, failures_of, measure_estimates
from protocol.messages import Point
from tests.agents.estimate_team import make_mission

MISSION = make_mission(1)
SQUARE: tuple[Point, ...] = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
HOLE: tuple[Point, ...] = ((-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (0.5, -0.5))


def around(x: float, y: float, ring: tuple[Point, ...] = SQUARE) -> tuple[Point, ...]:
    return tuple((x + u, y + v) for u, v in ring)


def an_estimate(time_s: float, **changes: object) -> Estimate:
    """A square around an agent that walks along y = 5 at 1 m/s, its center 0.3 m off."""
    estimate = Estimate(
        center=(time_s, 5.3), area_m2=4.0, age_s=0.1, rings=(around(time_s, 5.0),), made=int(4 * time_s),
        heard=int(8 * time_s), held=3, folded=1, late=0, refused=0, compared_s=math.floor(time_s - 2.0), fingerprint=7,
    )  # fmt: skip
    return structs.replace(estimate, **changes)


def figures(*estimates: tuple[float, str, Estimate]) -> EstimateFigures | None:
    tracks: list[tuple[float, str, AnyRecord]] = [
        (
            0.1 * beat,
            "agent",
            Track(role="tracked_agent", position=(0.1 * beat, 5.0), velocity=(1.0, 0.0), radius_m=0.2, mode="moving"),
        )
        for beat in range(100)
    ]
    return measure_estimates(MissionTrace.of([*tracks, *estimates], MISSION))


def both(time_s: float, **changes: object) -> list[tuple[float, str, Estimate]]:
    return [(time_s, name, an_estimate(time_s, **changes)) for name in ("base", "robot1")]


def test_all_is_well() -> None:
    found = figures(*(entry for beat in range(2, 19) for entry in both(0.5 * beat + 0.03)))
    assert found is not None and found.records == 34
    assert found.error_median_m == found.error_p95_m == pytest.approx(0.3)
    assert (found.area_median_m2, found.area_p95_m2, found.contained, found.equal) == (4.0, 4.0, 1.0, 1.0)
    assert found.age_p95_s == pytest.approx(0.1)
    assert found.ranges == 2 * int(4 * 9.03) and found.unshared == 0.0 and not failures_of(found)


def test_an_agent_outside_of_a_set_is_a_failure() -> None:
    outside = an_estimate(5.0, rings=(around(7.0, 5.0),))
    in_the_hole = an_estimate(5.5, rings=(around(5.5, 5.0), around(5.5, 5.0, HOLE)))
    found = figures(*both(4.5), (5.0, "base", outside), (5.5, "base", in_the_hole))
    assert found is not None and found.contained == 0.5
    assert failures_of(found) == ("the agent was outside of 50.00 % of the sets that are to contain it",)


def test_a_place_between_two_samples_of_the_track_is_judged_with_care() -> None:
    """The agent may have turned there: half of what it can walk in a period is let pass, and not more."""
    walked_m = 0.5 * MISSION.agent_speed_m_s / MISSION.control_hz
    for off_m, contained in ((0.9 * walked_m, 1.0), (walked_m + 0.03, 0.0)):
        found = figures((5.0, "base", an_estimate(5.0, rings=(around(5.0, 6.0 + off_m),))))
        assert found is not None and found.contained == contained


def test_moments_at_which_logs_differ_are_counted_and_those_of_one_peer_alone_are_not() -> None:
    entries = [*both(4.0), *both(5.0), (6.0, "base", an_estimate(6.0))]
    entries[3] = (5.0, "robot1", an_estimate(5.0, fingerprint=8))
    found = figures(*entries)
    assert found is not None and found.equal == 0.5


def test_ranges_of_a_peer_that_starts_again_are_added() -> None:
    found = figures(
        (3.0, "base", an_estimate(3.0, made=10, heard=10)),
        (4.0, "base", an_estimate(4.0, made=2, heard=12)),
        (5.0, "robot1", an_estimate(5.0, made=8, heard=15, late=2, refused=1)),
        (5.0, "base", an_estimate(5.0, made=2, heard=20)),
    )
    assert found is not None and found.ranges == 20
    assert found.unshared == pytest.approx(0.5 * 5 / 20) and (found.late, found.refused) == (2, 1)


def test_without_estimates_there_are_no_figures() -> None:
    assert figures() is None and failures_of(None) == ()
