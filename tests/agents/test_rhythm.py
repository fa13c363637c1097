from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from agents.rhythm import Rhythm


def test_is_due_on_its_grid_only() -> None:
    rhythm = Rhythm(0.1, 5.0)
    assert [rhythm.due(now_s) for now_s in (4.9, 5.0, 5.0, 5.05, 5.1, 5.15, 5.2)] == [
        False, True, False, False, True, False, True,
    ]  # fmt: skip


def test_skips_what_it_missed() -> None:
    rhythm = Rhythm(0.1, 0.0)
    assert rhythm.due(0.0)
    assert rhythm.due(7.77)
    assert not rhythm.due(7.79)
    assert abs(rhythm.next_s - 7.8) < 1e-9


@given(st.floats(0.01, 10.0), st.floats(-1e4, 1e4))
def test_waking_when_it_says_beats_every_period(period_s: float, start_s: float) -> None:
    rhythm = Rhythm(period_s, start_s)
    for beat in range(50):
        assert abs(rhythm.next_s - (start_s + beat * period_s)) < 1e-6
        assert rhythm.due(rhythm.next_s)
