"""The process of a peer, as far as it can be tried out without one."""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn

import pytest

from agents import recorder
from agents.casting import Casting
from agents.mission import Mission
from agents.recorder import NullRecorder
from agents.runtime import open_recorder
from planning.environment import Environment


def test_a_peer_whose_recording_cannot_be_written_goes_on_without(
    mission: Mission,
    corner: Environment,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """What rerun says when the disk is full."""

    def full(*_: object, **__: object) -> NoReturn:
        raise RuntimeError("Failed to encode LogMsg: Failed to write: No space left on device (os error 28)")

    monkeypatch.setattr(recorder, "RerunRecorder", full)
    file, agent = tmp_path / "run" / "recordings" / "agent.0.rrd", mission.tracked_agent.name
    opened = open_recorder(file, mission, agent, 0, corner, Casting(mission, corner))
    assert isinstance(opened, NullRecorder)
    said = capsys.readouterr().err
    assert f"{agent} goes on without a recording, {file} cannot be written" in said and "No space left" in said
