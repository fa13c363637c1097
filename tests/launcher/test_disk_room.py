"""A disk that is full, or nearly: said before a run, and while it lasts."""

from __future__ import annotations

import shutil
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import pytest
from rich.console import Console

from agents.mission import Mission
from launcher.disk_room import RoomWatch, check_room
from launcher.journal import Journal
from launcher.run_folder import RunFolder
from launcher.scenario import ScenarioFault
from planning.environment import Environment


class Disk:
    """Stands in for one of a size that the test chooses."""

    free = 0.0

    def usage(self, _folder: Path) -> SimpleNamespace:
        return SimpleNamespace(free=self.free)


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    disk = Disk()
    monkeypatch.setattr(shutil, "disk_usage", disk.usage)
    return disk


def test_a_run_needs_room_for_its_first_minute_and_is_warned_where_the_rest_has_none(
    disk: Disk, tmp_path: Path
) -> None:
    disk.free = 9.4e6  # five peers: 5 MB, and 75 kB a second
    with pytest.raises(ScenarioFault) as refused:
        check_room(tmp_path, 5, 3600.0)
    assert str(refused.value) == (
        f"the disk of {tmp_path} has 9.4 MB left, and the run takes 9.5 MB to begin with; make room, or change to a "
        "folder on another disk"
    )
    assert check_room(tmp_path, 5, 20.0) == ""
    disk.free = 9.6e6
    assert check_room(tmp_path, 5, None) == ""
    assert check_room(tmp_path, 5, 3600.0).endswith("9.6 MB left on the disk, and the whole run takes about 275.0 MB")


def test_a_disk_that_fills_up_is_said_once_each_time(disk: Disk, tmp_path: Path) -> None:
    said: list[str] = []
    watch = RoomWatch(tmp_path, said.append)
    for free_b in (2e6, 0.9e6, 0.0, 2e6, 0.5e6, 6e6, 0.5e6):
        disk.free = free_b
        watch.look()
    assert [text.partition(":")[0] for text in said] == [
        f"only 0.9 MB left on the disk of {tmp_path}",
        f"only 0.5 MB left on the disk of {tmp_path}",
    ]


def test_a_folder_that_cannot_be_written_is_one_sentence_and_nothing_is_left_of_it(
    mission: Mission, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    scenario = tmp_path / "scenario.toml"
    scenario.write_text('map = "square.json"')
    square = Environment([(0, 0), (4, 0), (4, 4), (0, 4)])
    RunFolder.create("first", "team").write(scenario, mission, square)

    def fail(_environment: Environment, _file: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Environment, "save", fail)
    second = RunFolder.create("second", "team")
    with pytest.raises(ScenarioFault) as refused:
        second.write(scenario, mission, square)
    assert str(refused.value).startswith("runs/second cannot be written (No space left on device); make room")
    assert sorted(path.name for path in Path("runs").iterdir()) == ["first", "latest"]
    assert RunFolder.find(None).read_mission() == mission, "the latest is the first"


def test_what_befell_the_team_is_said_though_it_cannot_be_recorded(mission: Mission, tmp_path: Path) -> None:
    paper = StringIO()
    (tmp_path / "file").touch()
    journal = Journal(mission, tmp_path / "file", Console(file=paper, width=200))  # rerun fails as on a full disk
    journal.revived("robot1")
    journal.close()
    said = paper.getvalue().splitlines()
    assert said[0].endswith("s  robot1 is started again")
    assert said[1].startswith("Warning: that is not recorded: ")
